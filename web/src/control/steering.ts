/** What the robot is asked to do, changed step by step, as in Python's `mute.controllers.command`. */

import type { Axis, Command, PageData } from "../physics/page_data.js";

export class Steering {
  private going: Command;

  constructor(
    private current: Command,
    private readonly limits: PageData["command"]["limits"],
  ) {
    this.going = current;
  }

  get command(): Command {
    return this.current;
  }

  /** Whether it asks to stand. */
  get stands(): boolean {
    const { vx, vy, wz } = this.current;
    return vx === 0 && vy === 0 && wz === 0;
  }

  /** Sets parts of the command, held within their limits. */
  set(parts: Partial<Command>): void {
    const next: Record<Axis, number> = { ...this.current };
    for (const [axis, value] of Object.entries(parts) as [Axis, number][]) {
      const [low, high] = this.limits[axis];
      // Rounded, so that steps of 0.1 come back to exactly 0, which asks to stand.
      next[axis] = Math.min(Math.max(Math.round(1e6 * value) / 1e6, low), high);
    }
    this.current = next;
  }

  /** Adds to a part of the command. */
  change(axis: Axis, step: number): void {
    this.set({ [axis]: this.current[axis] + step });
  }

  /** Asks to stand or, if that is what was asked, to go on as before. */
  stopOrGo(): void {
    const { beta } = this.current;
    if (this.stands) this.set({ ...this.going, beta });
    else {
      this.going = this.current;
      this.set({ vx: 0, vy: 0, wz: 0 });
    }
  }
}
