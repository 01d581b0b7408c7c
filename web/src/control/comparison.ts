/** The same walk at beta 0 and at beta 1, one after the other, with both levels. */

/** What a comparison does with the page. */
export interface Compared {
  /** Begins the walk again, at some beta. */
  begin(beta: number): void;
  /** Tells how it goes, or went; called where that changes. */
  tell(text: string, isRunning: boolean): void;
  /** Tells how many seconds are left of this walk. */
  count(seconds: number): void;
  /** Puts things back as they were. */
  end(): void;
}

/** What was heard of the walk, see `Levels`. */
export interface Heard {
  /** dBA. */
  readonly mnl: number;
  /** s. */
  readonly seconds: number;
}

/** Time that is measured, s. */
const MEASURED = 10;

/** Time that may be walked for it, s: what a robot does that fell is in no level. */
const LONGEST = 40;

const BETAS = [0, 1];

export class Comparison {
  private index = -1;
  private left = NaN;
  private readonly levels: number[] = [];
  private readonly falls = [0, 0];

  constructor(private readonly page: Compared) {}

  get isRunning(): boolean {
    return this.index >= 0;
  }

  /** Begins it, unless it is running. */
  start(): void {
    if (this.isRunning) return;
    this.levels.length = 0;
    this.falls.fill(0);
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
   * @param walked Time walked, s.
   * @param heard What was heard of it so far.
   */
  follow(walked: number, heard: Heard): void {
    if (!this.isRunning) return;
    if (heard.seconds >= MEASURED && !Number.isNaN(heard.mnl)) {
      this.levels.push(heard.mnl);
      this.next();
    } else if (walked > LONGEST) {
      this.stop(this.failure(heard));
    } else {
      this.count(Math.max(Math.ceil(MEASURED - heard.seconds), 0));
    }
  }

  /** Takes note that the robot fell, or blew up, and begins anew. */
  fell(): void {
    if (this.isRunning) (this.falls[this.index] as number)++;
  }

  private next(): void {
    this.index++;
    const beta = BETAS[this.index];
    if (beta === undefined) {
      this.stop(this.verdict());
      return;
    }
    this.page.begin(beta);
    this.page.tell(`β ${beta} walks. ${this.soFar()}`.trim(), true);
    this.count(MEASURED);
  }

  private count(seconds: number): void {
    if (seconds === this.left) return;
    this.left = seconds;
    this.page.count(seconds);
  }

  private soFar(): string {
    return this.levels.map((level, i) => `β ${BETAS[i]}: ${level.toFixed(1)} dBA.`).join(" ");
  }

  private verdict(): string {
    const [loud = NaN, quiet = NaN] = this.levels;
    const difference = loud - quiet;
    const word = difference >= 0 ? "quieter" : "louder";
    const words = `${Math.abs(difference).toFixed(1)} dB ${word} at β 1.`;
    return `${this.soFar()} ${words} ${this.fallen()}`.trim();
  }

  private failure({ seconds }: Heard): string {
    const told = `Not compared: in ${LONGEST} s at β ${BETAS[this.index]} only`;
    return `${told} ${seconds.toFixed(0)} s could be heard. ${this.fallen()}`.trim();
  }

  private fallen(): string {
    const told = this.falls.map((falls, i) => (falls ? `${falls} at β ${BETAS[i]}` : ""));
    const all = told.filter(Boolean).join(", ");
    return all && `Falls, which are left out: ${all}.`;
  }
}
