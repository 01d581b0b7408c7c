/** How finely to draw: as the screen is, or more coarsely where the machine cannot keep up. */

/** Longest mean time between pictures that is good enough, s. */
const SLOWEST = 1 / 40;

/** Pictures that are looked at together. */
const COUNT = 24;

/** Longer ones are no matter of drawing: the tab was hidden. */
const PAUSE = 0.5;

const STEPS = [1, 0.75, 0.5, 0.35];

export class PixelBudget {
  private step = 0;
  private sum = 0;
  private pictures = 0;

  /** Returns pixels drawn for each of the page's. */
  ratio(screen: number): number {
    return Math.min(screen, 2) * STEPS[this.step];
  }

  /**
   * Takes note of the time since the last picture, s.
   *
   * @returns Whether `ratio` is another one from now on.
   */
  after(seconds: number): boolean {
    if (seconds > PAUSE) return false;
    this.sum += seconds;
    if (++this.pictures < COUNT) return false;
    const slow = this.sum / this.pictures > SLOWEST;
    this.sum = this.pictures = 0;
    if (!slow || this.step === STEPS.length - 1) return false;
    this.step++;
    return true;
  }
}
