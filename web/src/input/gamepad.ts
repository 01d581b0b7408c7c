/** A gamepad: its left stick drives, its right one turns, buttons push, stop and begin again. */

import { withoutSlack } from "./joystick.js";

/** What a gamepad asks for; shares from -1 to 1. */
export interface PadActions {
  drive(forward: number, left: number, turn: number): void;
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
const RESTART = 9;

export class GamepadInput {
  private pressed = new Set<number>();
  private drives = false;

  constructor(private readonly actions: PadActions) {
    window.addEventListener("gamepadconnected", ({ gamepad }) => actions.connected(gamepad.id));
    window.addEventListener("gamepaddisconnected", ({ gamepad }) => {
      this.letGo();
      actions.lost(gamepad.id);
    });
  }

  /** Reads it; to be called for each picture. */
  poll(): void {
    const pad = navigator.getGamepads?.().find((found) => found?.connected);
    if (!pad) return;
    this.readSticks(pad);
    const actions = { [STOP]: "stopOrGo", [PUSH]: "push", [RESTART]: "restart" } as const;
    for (const [index, action] of Object.entries(actions)) {
      if (this.isNewlyPressed(pad, Number(index))) this.actions[action]();
    }
  }

  private readSticks(pad: Gamepad): void {
    const pull = (axis: number) => -withoutSlack(pad.axes[axis] ?? 0) || 0;
    const [x, y, turn] = [pull(0), pull(1), pull(2)];
    const pulled = x !== 0 || y !== 0 || turn !== 0;
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
