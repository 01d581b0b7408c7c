/** A comparison on the page: it begins once there is sound, and puts the command back in the end. */

import { Comparison } from "./control/comparison.js";
import type { Steering } from "./control/steering.js";
import type { Outcome } from "./control/walk.js";
import type { LiveWalk } from "./live_walk.js";
import type { Command } from "./physics/page_data.js";
import { Latest } from "./support/latest.js";

/** What a comparison shows. */
export interface ComparisonShown {
  showComparison(text: string, isRunning: boolean): void;
  showCountdown(seconds: number): void;
}

export class Comparing {
  private readonly comparison: Comparison;
  /** What was asked for, which may still wait for sound. */
  private readonly asked = new Latest();
  private before: Command;

  /**
   * @param live What walks, and is heard.
   * @param steering What it is asked to do.
   * @param shown Where it is told how it goes.
   * @param showCommand Shows a command that changed.
   */
  constructor(
    private readonly live: LiveWalk,
    private readonly steering: Steering,
    shown: ComparisonShown,
    private readonly showCommand: () => void,
  ) {
    this.before = steering.command;
    this.comparison = new Comparison({
      begin: (beta) => this.begin(beta),
      tell: (text, isRunning) => shown.showComparison(text, isRunning),
      count: (seconds) => shown.showCountdown(seconds),
      end: () => this.end(),
    });
  }

  /** Begins, or ends where it is. To be called in a gesture, which sound needs. */
  toggle(): void {
    if (this.comparison.isRunning) this.stop();
    else void this.start();
  }

  /** Ends it, or gives up what waits for sound. */
  stop(): void {
    this.asked.drop();
    this.comparison.stop();
  }

  /** Takes note of a control step. */
  follow(outcome: Outcome): void {
    if (outcome !== "walking") this.comparison.fell();
    this.comparison.follow(this.live.seconds, this.live.sound.levels);
  }

  private async start(): Promise<void> {
    const isWanted = this.asked.ask();
    const { sound } = this.live;
    if (!sound.isOn) await sound.turn(true);
    if (!sound.isOn || !isWanted() || this.comparison.isRunning) return;
    this.before = this.steering.command;
    if (this.steering.stands) this.steering.stopOrGo();
    this.comparison.start();
  }

  private begin(beta: number): void {
    this.steering.set({ beta });
    this.showCommand();
    this.live.begin();
  }

  private end(): void {
    this.steering.set(this.before);
    this.live.measureAnew();
    this.showCommand();
  }
}
