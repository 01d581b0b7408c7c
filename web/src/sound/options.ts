/** What a soundscape is made with. */

import type { Mount } from "./microphone.js";
import type { SoundTables } from "./tables.js";

/** All that can be heard, each alone or together. */
export const SOURCES = ["impacts", "body", "drive", "scuffing", "fan"] as const;
export type Source = (typeof SOURCES)[number];

export interface SoundscapeOptions {
  /** Name of the floor. */
  readonly surface: string;
  /** Of all noise, a whole number. */
  readonly seed?: number;
  /** Hz; only that of the tables. */
  readonly sampleRate?: number;
  /** Physics step, s: a whole number of samples of each tier. */
  readonly timestep?: number;
  /** What to hear. */
  readonly sources?: readonly Source[];
  /** Where to listen. Default: on the trunk, as Python's levels are. */
  readonly microphone?: { readonly mount: Mount; readonly offset: readonly number[] };
}

export interface Settings {
  readonly surface: string;
  readonly seed: number;
  readonly timestep: number;
  /** Samples of a physics step. */
  readonly samples: number;
  readonly sources: readonly Source[];
  readonly microphone: { readonly mount: Mount; readonly offset: readonly number[] };
}

/** Samples that a step may have, so that its arrays stay small. */
const MOST_SAMPLES = 960;

/** Returns the settings, or throws a RangeError that names what is not allowed. */
export function checkOptions(tables: SoundTables, options: SoundscapeOptions): Settings {
  const rate = options.sampleRate ?? tables.sample_rate;
  if (rate !== tables.sample_rate) {
    throw new RangeError(`sampleRate must be ${tables.sample_rate} Hz, got ${rate}`);
  }
  const timestep = options.timestep ?? 0.001;
  const divisor = Math.max(...tables.tiers.map((tier) => tier.divisor));
  const frames = (timestep * rate) / divisor;
  const samples = Math.round(frames) * divisor;
  if (!(Math.abs(frames - Math.round(frames)) < 1e-6 && samples > 0 && samples <= MOST_SAMPLES)) {
    throw new RangeError(
      `timestep must be a multiple of ${divisor}/${rate} s, at most ` +
        `${MOST_SAMPLES / rate} s, got ${timestep}`,
    );
  }
  const sources = options.sources ?? SOURCES;
  for (const name of sources) {
    if (!SOURCES.includes(name)) {
      throw new RangeError(`sources must be of ${SOURCES.join(", ")}, got ${String(name)}`);
    }
  }
  const microphone = options.microphone ?? { mount: "trunk", offset: tables.microphone.offset };
  const seed = Math.trunc(options.seed ?? 0);
  return { surface: options.surface, seed, timestep, samples, sources, microphone };
}
