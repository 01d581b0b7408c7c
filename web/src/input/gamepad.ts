/** A gamepad: its left stick drives, its right one turns, buttons do the rest, as in `play.py`. */

import type { Axis } from "../physics/page_data.js";
import { withoutSlack } from "./joystick.js";

/** What a gamepad asks for; shares from -1 to 1. */
export interface PadActions {
  drive(forward: number, left: number, turn: number): void;
  change(axis: Axis, step: number): void;
  stopOrGo(): void;
  push(): void;
  restart(): void;
  /** A gamepad came, or went while it drove or not. */
  connected(name: string): void;
  lost(name: string): void;
}

/** Buttons of the standard layout. */
const STOP = 0;
const PUSH = 2;
const LESS_QUIET = 4;
const QUIETER = 5;
const RESTART = 9;

const BETA_STEP = 0.1;

export class GamepadInput {
  private pressed = new Set<number>();
  private drives = false;
  /** Whether sticks that are held count as let go, until they rest. */
  private released = false;
  /** Which of all gamepads it is, once there is one. */
  private index: number | null = null;

  constructor(private readonly actions: PadActions) {
    window.addEventListener("gamepadconnected", ({ gamepad }) => actions.connected(gamepad.id));
    window.addEventListener("gamepaddisconnected", ({ gamepad }) => {
      // Another one that goes takes nothing along.
      if (this.index !== null && gamepad.index !== this.index) return;
      this.index = null;
      this.pressed.clear();
      this.letGo();
      actions.lost(gamepad.id);
    });
  }

  /** Reads it; to be called for each picture. */
  poll(): void {
    const pad = navigator.getGamepads?.().find((found) => found?.connected);
    if (!pad) return;
    this.index = pad.index;
    this.readSticks(pad);
    for (const index of [STOP, PUSH, LESS_QUIET, QUIETER, RESTART]) {
      if (this.isNewlyPressed(pad, index)) this.press(index);
    }
  }

  /** Takes sticks that are held for let go, until they rest: who stops the robot wants it to stand. */
  release(): void {
    this.released ||= this.drives;
    this.drives = false;
  }

  private press(button: number): void {
    if (button === STOP) this.actions.stopOrGo();
    else if (button === PUSH) this.actions.push();
    else if (button === RESTART) this.actions.restart();
    else this.actions.change("beta", button === QUIETER ? BETA_STEP : -BETA_STEP);
  }

  private readSticks(pad: Gamepad): void {
    const pull = (axis: number) => -withoutSlack(pad.axes[axis] ?? 0) || 0;
    const [x, y, turn] = [pull(0), pull(1), pull(2)];
    const held = x !== 0 || y !== 0 || turn !== 0;
    this.released &&= held;
    const pulled = held && !this.released;
    // A stick that rests leaves the command to keys and sliders.
    if (pulled) this.actions.drive(y, x, turn);
    else this.letGo();
    this.drives = pulled;
  }

  private letGo(): void {
    if (this.drives) this.actions.drive(0, 0, 0);
    this.drives = false;
  }

  private isNewlyPressed(pad: Gamepad, index: number): boolean {
    const before = this.pressed.has(index);
    const now = pad.buttons[index]?.pressed ?? false;
    if (now) this.pressed.add(index);
    else this.pressed.delete(index);
    return now && !before;
  }
}
