/** The same walk at beta 0 and at beta 1, one after the other, with both levels. */

/** What a comparison does with the page. */
export interface Compared {
  /** Begins the walk again, at some beta. */
  begin(beta: number): void;
  /** Tells how it goes, or went. */
  tell(text: string, isRunning: boolean): void;
  /** Puts things back as they were. */
  end(): void;
}

/** Time that is walked before it is measured, s: the robot and the meter have to get going. */
const SETTLE = 1.5;
/** Time that is measured, s. */
const MEASURED = 10;

const BETAS = [0, 1];

export class Comparison {
  private index = -1;
  private readonly levels: number[] = [];

  constructor(private readonly page: Compared) {}

  get isRunning(): boolean {
    return this.index >= 0;
  }

  start(): void {
    this.levels.length = 0;
    this.next();
  }

  /** Ends it where it is. */
  stop(text = "Comparing was stopped."): void {
    if (!this.isRunning) return;
    this.index = -1;
    this.page.tell(text, false);
    this.page.end();
  }

  /**
   * Takes note of how far the walk is.
   *
   * @param seconds Time walked, s.
   * @param mnl Its mean noise level so far, dBA.
   */
  follow(seconds: number, mnl: number): void {
    if (!this.isRunning) return;
    // Of a walk that is hardly heard there is no level yet.
    if (seconds < SETTLE + MEASURED || Number.isNaN(mnl)) {
      const left = Math.max(Math.ceil(SETTLE + MEASURED - seconds), 0);
      this.page.tell(`β ${BETAS[this.index]}: ${left} s to go. ${this.soFar()}`.trim(), true);
      return;
    }
    this.levels.push(mnl);
    this.next();
  }

  private next(): void {
    this.index++;
    if (this.index < BETAS.length) this.page.begin(BETAS[this.index]);
    else this.stop(this.verdict());
  }

  private soFar(): string {
    return this.levels.map((level, i) => `β ${BETAS[i]}: ${level.toFixed(1)} dBA.`).join(" ");
  }

  private verdict(): string {
    const [loud, quiet] = this.levels;
    const difference = loud - quiet;
    const word = difference >= 0 ? "quieter" : "louder";
    return `${this.soFar()} ${Math.abs(difference).toFixed(1)} dB ${word} at β 1.`;
  }
}
