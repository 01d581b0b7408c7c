/** What the page's soundscape makes of a walk. */

import { LevelMeter } from "../../src/sound/level_meter";
import type { SoundscapeOptions } from "../../src/sound/options";
import { READINGS_LENGTH, viewReadings } from "../../src/sound/readings";
import { Soundscape } from "../../src/sound/soundscape";
import type { SoundTables } from "../../src/sound/tables";
import { bandSquares, decibels } from "./spectrum";
import type { Figures } from "./walks";

/** Returns the sound of a walk, Pa. */
export function hear(
  tables: SoundTables,
  readings: Float32Array,
  options: SoundscapeOptions,
): Float32Array {
  const soundscape = new Soundscape(tables, options);
  const steps = readings.length / READINGS_LENGTH;
  const samples = Math.round((options.timestep ?? 0.001) * tables.sample_rate);
  const sound = new Float32Array(steps * samples);
  for (let step = 0; step < steps; step++) {
    soundscape.step(viewReadings(readings, step));
    soundscape.render(sound.subarray(step * samples, (step + 1) * samples));
  }
  return sound;
}

/** Returns figures of draws of a sound: mean levels, and third octaves of mean energies. */
export function figures(
  sounds: readonly Float32Array[],
  tables: SoundTables,
  bands: readonly (readonly [number, number])[],
): Figures {
  const sums = new Float64Array(bands.length);
  const levels = { mnl: 0, pnl: 0, laeq: 0, lafmax: 0 };
  for (const sound of sounds) {
    const meter = new LevelMeter(tables);
    meter.update(sound);
    for (const name of ["mnl", "pnl", "laeq", "lafmax"] as const) {
      levels[name] += meter[name] / sounds.length;
    }
    bandSquares(sound, bands, tables.sample_rate).forEach((square, band) => {
      sums[band] = (sums[band] as number) + square / sounds.length;
    });
  }
  return { ...levels, bands: Array.from(sums, decibels) };
}
