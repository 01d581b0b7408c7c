/**
 * Joins sounds that do not follow from each other: where one ends and another begins, or silence, the
 * difference between them is let go within some milliseconds, so that nothing clicks.
 */

/** Share of the difference that is left after a sample: a time constant of 3 ms at 48 kHz. */
const KEPT = Math.exp(-1 / (0.003 * 48000));

/** Difference below which there is none: far below hearing. */
const NOTHING = 1e-12;

export class Seam {
  private isOpen = true;
  private fading = false;
  private last = 0;
  private difference = 0;

  /** Take note that what comes next does not follow. */
  open(): void {
    this.isOpen = true;
  }

  /** Gives samples of a sound. */
  join(from: Float64Array, at: number, out: Float32Array, begin: number, samples: number): void {
    if (this.isOpen || this.fading) {
      this.difference = this.last - (from[at] as number);
      this.isOpen = false;
      this.fading = false;
    }
    for (let i = 0; i < samples; i++) {
      out[begin + i] = (from[at + i] as number) + this.difference;
      this.difference *= KEPT;
    }
    if (Math.abs(this.difference) < NOTHING) this.difference = 0;
    if (samples > 0) this.last = out[begin + samples - 1] as number;
  }

  /** Gives silence to the end. */
  fade(out: Float32Array, begin: number): void {
    if (!this.fading) this.difference = this.last;
    this.fading = true;
    for (let i = begin; i < out.length; i++) {
      this.difference *= KEPT;
      out[i] = this.difference;
    }
    if (Math.abs(this.difference) < NOTHING) this.difference = 0;
    this.last = this.difference;
  }
}
