/** What the page and its audio thread say to each other. */

import type { SoundscapeOptions } from "./options.js";
import type { SoundTables } from "./tables.js";

/** Name that the audio thread's part is registered by. */
export const PROCESSOR = "mute-sound";

/** What the audio thread begins with. */
export interface ProcessorOptions {
  readonly tables: SoundTables;
  readonly soundscape: SoundscapeOptions;
}

export type ToProcessor =
  | { readonly kind: "readings"; readonly batch: Float32Array }
  | { readonly kind: "surface"; readonly name: string }
  /** The walk begins anew, or goes on in another way: its figures are those of another one. */
  | { readonly kind: "reset" | "measure"; readonly walk: number }
  /** The robot fell. */
  | { readonly kind: "fall" };

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
  /** Number of the walk that this is of: that of the last message with one, or 0. */
  readonly walk: number;
}
