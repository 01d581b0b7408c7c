/** Where the page's sound comes from: its tables, loaded once they are wanted, and what plays them. */

import type { Hearing } from "./control/hearing.js";
import type { OfflineHearing } from "./control/measure.js";

/** Loads what a measurement needs to hear; null where the page was built without sound. */
export type SoundFiles = () => Promise<((surface: string) => OfflineHearing) | null>;

export function soundFiles(_load: (name: string) => Promise<Response>): SoundFiles {
  return async () => null;
}

export function hearingStarter(
  _sound: SoundFiles,
): ((surface: string) => Promise<Hearing>) | null {
  return null;
}
