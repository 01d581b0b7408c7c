/** Keys, which do what they do in the window of `play.py`; WASD beside the arrows, and the camera's. */

import type { Axis } from "../physics/page_data.js";

/** What keys ask for. */
export interface KeyActions {
  change(axis: Axis, step: number): void;
  stopOrGo(): void;
  restart(): void;
  push(): void;
  /** Angles, rad, and the logarithm of a factor of the distance. */
  turnCamera(around: number, up: number, away: number): void;
}

const STEP = 0.1;

const STEPS: Readonly<Record<string, readonly [Axis, number]>> = {
  ArrowUp: ["vx", STEP],
  KeyW: ["vx", STEP],
  ArrowDown: ["vx", -STEP],
  KeyS: ["vx", -STEP],
  ArrowLeft: ["wz", STEP],
  KeyA: ["wz", STEP],
  ArrowRight: ["wz", -STEP],
  KeyD: ["wz", -STEP],
  KeyQ: ["vy", STEP],
  KeyE: ["vy", -STEP],
  KeyB: ["beta", STEP],
  KeyV: ["beta", -STEP],
};

/** Of the camera: around, up and away. */
const TURNS: Readonly<Record<string, readonly [number, number, number]>> = {
  KeyJ: [-0.1, 0, 0],
  KeyL: [0.1, 0, 0],
  KeyI: [0, 0.1, 0],
  KeyK: [0, -0.1, 0],
  KeyU: [0, 0, -0.1],
  KeyO: [0, 0, 0.1],
};

/** Begins to listen; whoever types into a field, or works a control, is left alone. */
export function listenToKeys(target: EventTarget, actions: KeyActions): void {
  target.addEventListener("keydown", (raw) => {
    const event = raw as KeyboardEvent;
    if (event.ctrlKey || event.altKey || event.metaKey || isTaken(event)) return;
    if (press(event, actions)) event.preventDefault();
  });
}

function press(event: KeyboardEvent, actions: KeyActions): boolean {
  const step = STEPS[event.code];
  const turn = TURNS[event.code];
  if (step) actions.change(...step);
  else if (turn) actions.turnCamera(...turn);
  else if (event.repeat) return false;
  else if (event.code === "Space") actions.stopOrGo();
  else if (event.code === "KeyR") actions.restart();
  else if (event.code === "KeyP") actions.push();
  else return false;
  return true;
}

/** A focused control has its own use for arrows, letters or the space bar. */
function isTaken(event: KeyboardEvent): boolean {
  const on = event.target;
  if (!(on instanceof Element)) return false;
  if (on.closest("select, textarea, input:not([type=range])")) return true;
  if (on.closest("input[type=range]")) return event.code.startsWith("Arrow");
  return event.code === "Space" && on.closest("button, summary, a") !== null;
}
