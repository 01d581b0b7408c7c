/** What is told of falls and blow-ups: of a robot that blows up all the time, once. */

import type { Outcome } from "./walk.js";

/** Time that a robot has to walk before it is told anew that it blew up, s. */
const CALM = 1;

export class Mishaps {
  private calm = Infinity;

  /**
   * Takes note of a control step.
   *
   * @param outcome What it ended with.
   * @param seconds How long it was, s.
   * @returns What is to be told, if anything.
   */
  after(outcome: Outcome, seconds: number): string | null {
    if (outcome === "fallen") return "The robot fell and starts again.";
    if (outcome === "walking") {
      this.calm += seconds;
      return null;
    }
    const isNew = this.calm >= CALM;
    this.calm = 0;
    return isNew ? "The robot blew up and starts again." : null;
  }
}
