/** What the robot is asked to do, changed step by step, as in Python's `mute.controllers.command`. */

import type { Axis, Command, PageData } from "../physics/page_data.js";

/** Steps of what is set by hand, as those of the sliders. */
const FINENESS = 0.05;

export class Steering {
  /** How it goes on where it was stopped; never a stand. */
  private going: Command;

  /**
   * @param current What is asked at first, maybe to stand.
   * @param page Limits, and what is asked where nobody asked for anything.
   */
  constructor(
    private current: Command,
    private readonly page: PageData["command"],
  ) {
    this.going = this.stands ? page.start : current;
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
      const [low, high] = this.page.limits[axis];
      // Rounded, so that steps of 0.1 come back to exactly 0, which asks to stand.
      next[axis] = Math.min(Math.max(Math.round(1e6 * value) / 1e6, low), high);
    }
    const before = this.current;
    const moved = !this.stands;
    this.current = next;
    if (moved && this.stands) this.going = before;
  }

  /** Sets speeds by hand: shares from -1 to 1 of those that are trained. */
  pull(forward: number, left: number, turn: number): void {
    this.set(this.pulled(forward, left, turn));
  }

  /** Returns whether such a pull would change nothing. */
  isPulled(forward: number, left: number, turn: number): boolean {
    const wanted = Object.entries(this.pulled(forward, left, turn)) as [Axis, number][];
    return wanted.every(([axis, value]) => Math.abs(this.current[axis] - value) < FINENESS / 2);
  }

  /** Adds to a part of the command. */
  change(axis: Axis, step: number): void {
    this.set({ [axis]: this.current[axis] + step });
  }

  /** Asks to stand or, if that is what was asked, to go on as before. */
  stopOrGo(): void {
    const { beta } = this.current;
    this.set(this.stands ? { ...this.going, beta } : { vx: 0, vy: 0, wz: 0 });
  }

  private pulled(forward: number, left: number, turn: number) {
    const part = (share: number, axis: "vx" | "vy" | "wz") => {
      const [low, high] = this.page.trained[axis];
      return FINENESS * Math.round((share < 0 ? -share * low : share * high) / FINENESS);
    };
    return { vx: part(forward, "vx"), vy: part(left, "vy"), wz: part(turn, "wz") };
  }
}
