/** How finely to draw: as the screen is, or more coarsely where the machine cannot keep up. */

/** Longest mean time between pictures that is good enough, s. */
const SLOWEST = 1 / 40;

/** Pictures that are looked at together, and the time that is long enough for fewer. */
const COUNT = 24;
const SPAN = 1.5;

/** A way to draw. */
interface Fineness {
  /** Share of the screen's pixels along each side. */
  readonly share: number;
  readonly shadows: boolean;
}

const STEPS: readonly Fineness[] = [
  { share: 1, shadows: true },
  { share: 0.75, shadows: true },
  { share: 0.7, shadows: false },
  { share: 0.5, shadows: false },
  { share: 0.35, shadows: false },
];

/** Where machines begin that draw without a graphics card. */
const WITHOUT_CARD = 3;

export class PixelBudget {
  private step: number;
  private sum = 0;
  private pictures = 0;

  /** @param software Whether the browser draws without a graphics card. */
  constructor(software: boolean) {
    this.step = software ? WITHOUT_CARD : 0;
  }

  /** Returns pixels drawn for each of the page's. */
  ratio(screen: number): number {
    return Math.min(screen, 2) * STEPS[this.step].share;
  }

  get shadows(): boolean {
    return STEPS[this.step].shadows;
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
    const slow = this.sum / this.pictures > SLOWEST;
    this.forget();
    if (!slow || this.step === STEPS.length - 1) return false;
    this.step++;
    return true;
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
