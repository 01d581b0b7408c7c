/** The recorded walks that the sound is held to, and what Python made of them. */

import { readFileSync } from "node:fs";
import { gunzipSync } from "node:zlib";
import { FEET, READINGS_LENGTH } from "../../src/sound/readings";
import type { Mount } from "../../src/sound/microphone";
import { loadSoundTables, type SoundTables } from "../../src/sound/tables";

/** Files are found from `web/`, where the tests are started. */
const FOLDER = "test/sound/reference";

export interface Figures {
  readonly mnl: number;
  readonly pnl: number;
  readonly laeq: number;
  readonly lafmax: number;
  /** Levels of third octaves, dB. */
  readonly bands: readonly number[];
}

export interface WalkFigures extends Figures {
  readonly sources: Readonly<Record<string, Figures>>;
  /** Step, foot, speed, mass. */
  readonly landings: readonly (readonly [number, number, number, number])[];
}

export interface References {
  readonly timestep: number;
  /** What each quantity is kept in steps of, in the order of the readings. */
  readonly steps: Readonly<Record<string, number>>;
  readonly noise_seeds: number;
  /** Edges of the third octaves, Hz. */
  readonly bands: readonly (readonly [number, number])[];
  /** Walks as a listener hears them who walks along. */
  readonly beside: {
    readonly offset: readonly number[];
    readonly walks: Readonly<Record<string, Figures>>;
  };
  /** Where microphones are that go with some trunks. */
  readonly microphones: readonly {
    readonly offset: readonly number[];
    readonly trunk: readonly number[];
    readonly quaternion: readonly number[];
    readonly at: Readonly<Record<Mount, readonly number[]>>;
  }[];
  readonly recorded: {
    readonly friction: number;
    readonly sliding: readonly (readonly [number, number, number])[];
    readonly landings: readonly (readonly [number, number, number])[];
  };
  readonly places: readonly (readonly [number, number, number])[];
  readonly meter: Omit<Figures, "bands"> & { readonly readings: number };
  readonly walks: Readonly<Record<string, WalkFigures>>;
}

export function readReferences(): References {
  return JSON.parse(readFileSync(`${FOLDER}/references.json`, "utf8")) as References;
}

export function readTables(): SoundTables {
  const binary = readFileSync("assets/sound.bin");
  const bytes = binary.buffer.slice(binary.byteOffset, binary.byteOffset + binary.byteLength);
  return loadSoundTables(JSON.parse(readFileSync("assets/sound.json", "utf8")), bytes as ArrayBuffer);
}

/** Returns what the feet's sensors said, step by step: contact, place, velocity, turning, force. */
export function readSensors(): Float32Array {
  const bytes = gunzipSync(readFileSync(`${FOLDER}/sensors.bin.gz`));
  return new Float32Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
}

/** Quantities whose second differences are kept; of the others, the first. */
const TWICE = "joint_position";

/** Returns the readings of a walk, step after step. */
export function readWalk(name: string, references: References): Float32Array {
  const bytes = gunzipSync(readFileSync(`${FOLDER}/${name}.bin.gz`));
  const widths: Record<string, number> = {
    landing_speed: FEET,
    landing_mass: FEET,
    friction_power: FEET,
    trunk_position: 3,
    trunk_quaternion: 4,
  };
  const numbers = countNumbers(bytes);
  const steps = numbers / READINGS_LENGTH;
  const readings = new Float32Array(numbers);
  let at = 0;
  let first = 0;
  const next = () => {
    let value = 0;
    let scale = 1;
    for (;;) {
      const byte = bytes[at++] as number;
      value += (byte & 127) * scale;
      if (byte < 128) break;
      scale *= 128;
    }
    return value % 2 === 0 ? value / 2 : -(value + 1) / 2;
  };
  for (const [quantity, size] of Object.entries(references.steps)) {
    const width = widths[quantity] ?? 12;
    for (let column = first; column < first + width; column++) {
      let value = 0;
      let rise = 0;
      for (let step = 0; step < steps; step++) {
        if (quantity === TWICE) {
          rise += next();
          value += rise;
        } else {
          value += next();
        }
        readings[step * READINGS_LENGTH + column] = value * size;
      }
    }
    first += width;
  }
  return readings;
}

/** Returns how many numbers are coded: each ends with a byte below 128. */
function countNumbers(bytes: Uint8Array): number {
  let count = 0;
  for (const byte of bytes) if (byte < 128) count++;
  return count;
}
