/** How finely to draw: as the screen is, or more coarsely where the machine cannot keep up. */

/** Longest mean time between pictures that is good enough, s: screens with 30 a second are. */
const SLOWEST = 1 / 28;

/** Pictures that are looked at together, and the time that is long enough for fewer, s. */
const COUNT = 24;
const SPAN = 1.5;

/**
 * Time that goes well before drawing more finely is tried, s. It doubles each time that this was too
 * much, up to some minutes, so that who has found its way is left in peace.
 */
const PATIENCE = 8;
const MOST_PATIENCE = 256;

/** A way to draw. */
interface Fineness {
  /** Share of the screen's pixels along each side. */
  readonly share: number;
  readonly shadows: boolean;
}

const FINEST: Fineness = { share: 1, shadows: true };
const STEPS: readonly Fineness[] = [
  FINEST,
  { share: 0.75, shadows: true },
  { share: 0.7, shadows: false },
  { share: 0.5, shadows: false },
  { share: 0.35, shadows: false },
];

/** Where machines begin, and stay, that draw without a graphics card. */
const WITHOUT_CARD = 3;

export class PixelBudget {
  private readonly first: number;
  private step: number;
  private sum = 0;
  private pictures = 0;
  /** Time that went well since the last change, and what it takes to try more, s. */
  private good = 0;
  private patience = PATIENCE;
  /** Whether the last change was to more. */
  private tries = false;

  /** @param software Whether the browser draws without a graphics card. */
  constructor(software: boolean) {
    this.first = this.step = software ? WITHOUT_CARD : 0;
  }

  /** Returns pixels drawn for each of the page's. */
  ratio(screen: number): number {
    return Math.min(screen, 2) * this.now.share;
  }

  get shadows(): boolean {
    return this.now.shadows;
  }

  /** Forgets what was: after a pause, say. */
  forget(): void {
    this.sum = this.pictures = 0;
  }

  /**
   * Takes note of the time since the last picture, s.
   *
   * @returns Whether to draw in another way from now on.
   */
  after(seconds: number): boolean {
    this.sum += seconds;
    if (++this.pictures < COUNT && this.sum < SPAN) return false;
    const { sum } = this;
    const slow = sum / this.pictures > SLOWEST;
    this.forget();
    return slow ? this.draw(1) : this.tryMore(sum);
  }

  private tryMore(seconds: number): boolean {
    this.good += seconds;
    if (this.good < this.patience) return false;
    // What it tried last is no trial any more.
    this.tries = false;
    return this.draw(-1);
  }

  private draw(change: 1 | -1): boolean {
    const before = this.step;
    this.step = Math.min(Math.max(this.step + change, this.first), STEPS.length - 1);
    this.good = 0;
    if (change > 0 && this.tries) this.patience = Math.min(2 * this.patience, MOST_PATIENCE);
    this.tries = change < 0 && this.step !== before;
    return this.step !== before;
  }

  private get now(): Fineness {
    return STEPS[this.step] ?? FINEST;
  }
}

/** Tells whether a browser draws without a graphics card. */
export function drawsInSoftware(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) return false;
  const names = context.getExtension("WEBGL_debug_renderer_info");
  const parameter = names ? names.UNMASKED_RENDERER_WEBGL : context.RENDERER;
  const name = String(context.getParameter(parameter));
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}
