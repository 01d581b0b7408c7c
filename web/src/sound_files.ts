/** Where the page's sound comes from: its tables, loaded once they are wanted, and what plays them. */

import type { Hearing } from "./control/hearing.js";
import type { OfflineHearing } from "./control/measure.js";
import { LevelMeter } from "./sound/level_meter.js";
import { READINGS_LENGTH, viewReadings } from "./sound/readings.js";
import { Soundscape } from "./sound/soundscape.js";
import { loadSoundTables, type SoundTables } from "./sound/tables.js";

/** Time at the start of a walk that its figures leave out, s. */
const SETTLE_TIME = 1;

/** Loads the tables, once. */
export type SoundFiles = () => Promise<SoundTables>;

export function soundFiles(load: (name: string) => Promise<Response>): SoundFiles {
  let tables: Promise<SoundTables> | null = null;
  return () => {
    tables ??= Promise.all([
      load("sound.json").then((file) => file.json() as Promise<unknown>),
      load("sound.bin").then((file) => file.arrayBuffer()),
    ]).then(([json, binary]) => loadSoundTables(json, binary));
    return tables;
  };
}

/** Hears a walk sample by sample, without a loudspeaker. */
export class MeasuredSound implements OfflineHearing {
  private readonly soundscape: Soundscape;
  private readonly meter: LevelMeter;
  private readonly samples: Float32Array;

  constructor(tables: SoundTables, surface: string, timestep: number) {
    this.soundscape = new Soundscape(tables, { surface, seed: 0, timestep });
    this.meter = new LevelMeter(tables);
    this.meter.forget(SETTLE_TIME);
    this.samples = new Float32Array(Math.round(tables.sample_rate * timestep));
  }

  feed(batch: Float32Array): void {
    for (let step = 0; step * READINGS_LENGTH < batch.length; step++) {
      this.soundscape.step(viewReadings(batch, step));
      this.soundscape.render(this.samples);
      this.meter.update(this.samples);
    }
  }

  get mnl(): number {
    return this.meter.mnl;
  }

  get pnl(): number {
    return this.meter.pnl;
  }
}

export function hearingStarter(
  _sound: SoundFiles,
): ((surface: string) => Promise<Hearing>) | null {
  return null;
}
