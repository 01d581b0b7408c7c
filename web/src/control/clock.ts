/** Real time in control steps: how many are due, and how far the next one is. */

/** Lag behind real time from which on it is given up to catch up, s. */
const MAX_LAG = 0.1;

/** Longer times between two looks are a machine asleep, s. */
const PAUSE = 2;

export class Clock {
  private last: number | null = null;
  private lag = 0;

  /** Begins anew after a pause, without a jump. */
  reset(): void {
    this.last = null;
    this.lag = 0;
  }

  /**
   * Takes note of the time.
   *
   * @param now Time, s.
   * @param step Control period, s.
   * @returns Steps that are due.
   */
  tick(now: number, step: number): number {
    const seconds = this.last === null ? 0 : now - this.last;
    this.last = now;
    this.lag = seconds > PAUSE ? 0 : Math.min(this.lag + Math.max(seconds, 0), MAX_LAG + step);
    const due = Math.floor(this.lag / step + 1e-9);
    this.lag -= due * step;
    return due;
  }

  /**
   * Returns which share of a control step has gone by since the last one that was due.
   *
   * @param now Time, s.
   * @param step Control period, s.
   */
  share(now: number, step: number): number {
    if (this.last === null) return 1;
    return Math.min(Math.max((this.lag + now - this.last) / step, 0), 1);
  }
}
