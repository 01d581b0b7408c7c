/** The page's sound: its tables, loaded once they are wanted, and what makes sound of them. */

import type { Hearing } from "./control/hearing.js";
import { openContext, startPlayer } from "./sound/player.js";
import { loadSoundTables, type SoundTables } from "./sound/tables.js";

/** Address of the audio thread's part. */
export const WORKLET = "sound-worklet.js";

/** Loads the tables, once. */
export type SoundFiles = () => Promise<SoundTables>;

export function soundFiles(load: (name: string) => Promise<Response>): SoundFiles {
  let tables: Promise<SoundTables> | null = null;
  return () => {
    tables ??= Promise.all([
      load("sound.json").then((file) => file.json() as Promise<unknown>),
      load("sound.bin").then((file) => file.arrayBuffer()),
    ]).then(([json, binary]) => loadSoundTables(json, binary));
    // What could not be loaded may be there the next time.
    tables.catch(() => (tables = null));
    return tables;
  };
}

/** Begins sound on a floor, in a gesture. */
export type StartHearing = (surface: string) => Promise<Hearing>;

/** Returns what begins sound; null where this browser has none. */
export function hearingStarter(
  files: SoundFiles,
  timestep: number,
  sampleRate: number,
): StartHearing | null {
  if (typeof AudioContext !== "function" || typeof AudioWorkletNode !== "function") return null;
  // The context first, while the gesture lasts; then what takes time.
  return async (surface) =>
    startPlayer(openContext(sampleRate), files(), WORKLET, { surface, timestep });
}
