/** What the page and its audio thread say to each other. */

import type { SoundscapeOptions } from "./options.js";
import type { SoundTables } from "./tables.js";

/** Name that the audio thread's part is registered by. */
export const PROCESSOR = "mute-sound";

/**
 * Sound pressure of a sample of 1, Pa, as in the WAV files of Python. Always the same, so that a quiet
 * walk sounds quiet beside a loud one; a boarded floor under a foot has peaks of half of it.
 */
export const FULL_SCALE = 10;

/** What the audio thread begins with. */
export interface ProcessorOptions {
  readonly tables: SoundTables;
  readonly soundscape: SoundscapeOptions;
}

export type ToProcessor =
  | { readonly kind: "readings"; readonly batch: Float32Array }
  | { readonly kind: "surface"; readonly name: string }
  | { readonly kind: "reset"; readonly walk: number };

/** Levels in dBA; NaN before there is one. */
export interface Levels {
  /** A-weighted and Fast, now. */
  readonly level: number;
  /** Mean and peak noise level of the walk, */
  readonly mnl: number;
  readonly pnl: number;
  /** and the time that they are over, s. */
  readonly seconds: number;
}

/** What is told twenty times a second. */
export interface FromProcessor extends Levels {
  /** Time that waits to be heard, s. */
  readonly waiting: number;
  /** Number of the walk that this is of: that of the last reset, or 0. */
  readonly walk: number;
}
