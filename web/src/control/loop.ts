/** Real time: control steps as they fall due, pictures as the screen takes them, nothing while hidden. */

import { Clock } from "./clock.js";
import { Rate } from "./rates.js";

/** What goes on. Times in s. */
export interface Going {
  /** Returns the control period. */
  stepTime(): number;
  /** Looks at what is held and pulled, before steps. */
  poll(): void;
  step(): void;
  /** Draws, at a share of the way from the last control step but one to the last. */
  draw(share: number, seconds: number): void;
  /** Shows figures, some times a second. */
  showFigures(): void;
  /** The page was hidden, or is seen again. */
  pauseOrGoOn(hidden: boolean): void;
}

/** Times a second that figures are shown. */
const SHOWN = 4;

/** Time between two looks at the clock, ms. */
const TICK = 8;

export class Loop {
  readonly controlRate = new Rate();
  readonly pictureRate = new Rate();
  /** Control steps so far. */
  steps = 0;
  private readonly clock = new Clock();
  private shown = 0;
  private drawn = 0;

  constructor(private readonly going: Going) {}

  /** Begins, and goes on until the page is closed. */
  run(): void {
    document.addEventListener("visibilitychange", () => this.pauseOrGoOn());
    // Not with the pictures: a machine that draws slowly still walks at the speed of real time.
    setInterval(() => {
      if (!document.hidden) this.advance(performance.now() / 1000);
    }, TICK);
    this.drawn = performance.now() / 1000;
    const frame = (now: number) => {
      requestAnimationFrame(frame);
      if (!document.hidden) this.draw(now / 1000);
    };
    requestAnimationFrame(frame);
  }

  private advance(now: number): void {
    const { going } = this;
    going.poll();
    const due = this.clock.tick(now, going.stepTime());
    for (let i = 0; i < due; i++) going.step();
    this.steps += due;
    this.controlRate.add(now, due);
    if ((now - this.shown) * SHOWN < 1) return;
    this.shown = now;
    going.showFigures();
  }

  private draw(now: number): void {
    this.pictureRate.add(now, 1);
    // A picture's time is that of its beginning, which may be before the page was seen again.
    const seconds = Math.max(now - this.drawn, 0);
    this.going.draw(this.clock.share(now, this.going.stepTime()), seconds);
    this.drawn = now;
  }

  /** A hidden tab pauses the robot; it goes on where it was. */
  private pauseOrGoOn(): void {
    this.clock.reset();
    this.controlRate.reset();
    this.pictureRate.reset();
    this.drawn = performance.now() / 1000;
    this.going.pauseOrGoOn(document.hidden);
  }
}
