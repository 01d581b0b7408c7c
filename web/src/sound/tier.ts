/**
 * Tones that ring at a fraction of the sample rate, and are brought to it by a filter. Its delay is
 * made up for by whoever presses: a tier is given its forces ahead of time.
 */

import type { Press } from "./press.js";
import { type Band, Resonators } from "./resonators.js";
import type { SoundTables, TierTable } from "./tables.js";

export class Tier {
  private readonly table: TierTable;
  private readonly tones: Resonators;
  private readonly interpolator: Float64Array;
  /** The last samples, and after them those of this block. */
  private readonly sound: Float64Array;
  private readonly block: Float64Array;
  /** Samples of it that are still to come out of the filter once nothing rings. */
  private left = 0;

  /**
   * @param bands What rings.
   * @param tables Where the tiers are told.
   * @param index Which of them this is.
   * @param samples Samples of sound in a block.
   */
  constructor(bands: readonly Band[], tables: SoundTables, index: number, samples: number) {
    this.table = tables.tiers[index] as TierTable;
    const { divisor, taps, interpolator } = this.table;
    const frames = samples / divisor;
    this.tones = new Resonators(bands, index, tables.sample_rate / divisor, frames);
    this.interpolator = Float64Array.from(interpolator);
    this.sound = new Float64Array(taps - 1 + frames);
    this.block = this.sound.subarray(taps - 1);
  }

  /** Silence. */
  reset(): void {
    this.tones.reset();
    this.left = 0;
    this.sound.fill(0);
  }

  /** Adds a block of what rings, of which the first `count` forces press. */
  ring(presses: readonly Press[], count: number, out: Float64Array): void {
    const { interpolator, sound, block } = this;
    const { divisor, taps } = this.table;
    const frames = block.length;
    block.fill(0);
    if (this.tones.ring(presses, count, block, frames)) this.left = taps;
    else if (this.left <= 0) return;
    else this.left -= frames;
    for (let frame = 0; frame < frames; frame++) {
      for (let phase = 0; phase < divisor; phase++) {
        let sum = 0;
        for (let tap = 0; tap < taps; tap++) {
          const sample = sound[frame + taps - 1 - tap] as number;
          sum += sample * (interpolator[tap * divisor + phase] as number);
        }
        const at = frame * divisor + phase;
        out[at] = (out[at] as number) + sum;
      }
    }
    sound.copyWithin(0, frames);
  }
}
