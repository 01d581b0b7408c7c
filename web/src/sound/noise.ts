/** Band noise: Python's `mute.acoustics.sources.band_noise`, of numbers of its own. */

import { Sections } from "./sections.js";
import type { Section } from "./tables.js";

export class BandNoise {
  private readonly filter: Sections;
  private readonly seed: number;
  private readonly block: Float64Array;
  private state = 1;

  /**
   * @param filter That gives white noise of unit variance unit variance again.
   * @param seed Of the noise.
   * @param samples Most samples of a block.
   */
  constructor(filter: Section, seed: number, samples: number) {
    this.filter = new Sections([filter]);
    // Neighbouring seeds are to have nothing in common; the state must not be 0.
    this.seed = (Math.imul(seed + 1, 0x9e3779b1) ^ 0x5bd1e995) | 1;
    this.block = new Float64Array(samples);
    this.reset();
  }

  /** Begins anew. */
  reset(): void {
    this.filter.reset();
    this.state = this.seed;
    for (let i = 0; i < 16; i++) this.next();
  }

  /** Adds the next samples, of a mean square, Pa^2. */
  sound(meanSquare: number, out: Float64Array, samples: number): void {
    const { block } = this;
    // White noise is shaped first and filtered after, so that steps of the envelope do not click.
    if (meanSquare > 0) {
      // Even from -1 to 1, whose variance is a third; what is heard of it is a sum of many.
      const size = Math.sqrt(3 * meanSquare);
      for (let i = 0; i < samples; i++) block[i] = size * this.next();
    } else if (this.filter.busy) {
      block.fill(0, 0, samples);
    } else {
      return;
    }
    this.filter.filter(block, samples);
    for (let i = 0; i < samples; i++) out[i] = (out[i] as number) + (block[i] as number);
  }

  /** Returns a number from -1 to 1, by the shifts of Marsaglia (2003). */
  private next(): number {
    let x = this.state;
    x ^= x << 13;
    x ^= x >>> 17;
    x ^= x << 5;
    this.state = x;
    return x / 0x80000000;
  }
}
