/**
 * A force that presses on a plate for a while, at the sample rate and in each tier. What tones need
 * of it is its difference over two samples: a tone is struck with a velocity, and one that is pressed
 * evenly is not struck at all.
 */

import type { SoundTables } from "./tables.js";

/** A force at one rate. */
export class TierForce {
  /** As means over the samples, N. */
  readonly force: Float64Array;
  /** Differences over two samples, once `differ` has made them. */
  readonly steps: Float64Array;
  /** Whether the differences of this block are anything but 0. */
  moves = false;
  private before = 0;
  private last = 0;

  /** @param samples Most samples of a block. */
  constructor(samples: number) {
    this.force = new Float64Array(samples);
    this.steps = new Float64Array(samples);
  }

  /** Take it that nothing pressed so far. */
  begin(): void {
    this.before = 0;
    this.last = 0;
  }

  /** Makes the differences of a whole block. */
  differ(): void {
    const { force, steps } = this;
    let before = this.before;
    let last = this.last;
    this.moves = false;
    for (let i = 0; i < force.length; i++) {
      const now = force[i] as number;
      const step = now - before;
      if (step !== 0) this.moves = true;
      steps[i] = step;
      before = last;
      last = now;
    }
    this.before = before;
    this.last = last;
  }
}

export class Press {
  /** The force at the sample rate, as means over the samples, N. */
  readonly force: Float64Array;
  readonly tiers: TierForce[];
  /** Which of the plate's places is pressed on. */
  place = 0;
  /** Factor of what is radiated at once. */
  near = 0;
  /** Factor of the tones, by octave. */
  readonly gains: Float64Array;

  /**
   * @param tables Where the tiers are told.
   * @param samples Samples of a block.
   */
  constructor(tables: SoundTables, samples: number) {
    const { spread, distances } = tables.shell.plate;
    this.force = new Float64Array(samples);
    this.tiers = tables.tiers.map((tier) => new TierForce(samples / tier.divisor));
    this.gains = new Float64Array(spread.length / distances.length);
  }

  /** Take it that nothing pressed so far. */
  begin(): void {
    for (const tier of this.tiers) tier.begin();
  }

  /** Makes the differences of a block. */
  differ(): void {
    for (const tier of this.tiers) tier.differ();
  }
}
