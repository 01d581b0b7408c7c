/** A walk that is heard without a loudspeaker, as fast as it comes: for tests and measurements. */

import { LevelMeter } from "./level_meter.js";
import type { SoundscapeOptions } from "./options.js";
import { type ContactReadings, READINGS_LENGTH, viewReadings } from "./readings.js";
import { Soundscape } from "./soundscape.js";
import type { SoundTables } from "./tables.js";

export class OfflineSound {
  private readonly soundscape: Soundscape;
  private readonly meter: LevelMeter;
  private readonly readings: ContactReadings = viewReadings();
  private readonly block: Float32Array;

  constructor(tables: SoundTables, options: SoundscapeOptions) {
    this.soundscape = new Soundscape(tables, options);
    this.meter = new LevelMeter(tables);
    this.meter.measureAnew();
    this.block = new Float32Array(Math.round((options.timestep ?? 0.001) * tables.sample_rate));
  }

  /** Mean noise level so far, dBA. */
  get mnl(): number {
    return this.meter.mnl;
  }

  /** Peak noise level so far, dBA. */
  get pnl(): number {
    return this.meter.pnl;
  }

  /** The robot fell and begins anew. */
  leaveOut(): void {
    this.meter.leaveOut();
  }

  /** Hears physics steps, one after the other. */
  feed(batch: Float32Array): void {
    const steps = batch.length / READINGS_LENGTH;
    for (let step = 0; step < steps; step++) {
      const at = step * READINGS_LENGTH;
      this.readings.packed.set(batch.subarray(at, at + READINGS_LENGTH));
      this.soundscape.step(this.readings);
      this.soundscape.render(this.block);
      this.meter.update(this.block);
    }
  }
}
