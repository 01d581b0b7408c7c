/**
 * What Python has worked out for the sound, as `python -m mute.web` writes it: `sound.json`, and
 * `sound.bin` with the arrays. Made by `mute/web/sound_tables.py`.
 */

/** Layout that is understood here. */
const FORMAT = 2;

/** A section of a filter as scipy writes it: b0, b1, b2, 1, a1, a2. */
export type Section = readonly number[];

/** A plate: what it makes of a force, as tones by third octave and a filter. */
export interface PlateTable {
  /** What is radiated at once, times the distance, over the force, Pa m / N; then `direct`. */
  readonly direct_gain: number;
  readonly direct: readonly Section[];
  /** Filters of all that comes from the plate. */
  readonly after: readonly Section[];
  /** Of each third octave: index of its octave, */
  readonly octaves: readonly number[];
  /** number of its tones, */
  readonly counts: readonly number[];
  /** time in which they fall by 60 dB, s, */
  readonly decays: readonly number[];
  /** and index of the tier that they ring in. */
  readonly tiers: readonly number[];
  /** Of each tone, third octave by third octave, Hz. */
  readonly frequencies: Float32Array;
  /** Strength of each tone at each place, Pa m / (N s): places by tones. */
  readonly strengths: Float32Array;
  /** Distances of `spread`, m, each a constant factor beyond the last. */
  readonly distances: Float32Array;
  /** Pressure over what rings, times the distance: distances by octaves. */
  readonly spread: Float32Array;
}

/** Blows of one law, by the relative mobility of the ground; see `mute.acoustics.physics.contact`. */
export interface LawTable {
  readonly yields: Float32Array;
  /** Time of contact, in D / v. */
  readonly duration: Float32Array;
  /** Impulse, in m v. */
  readonly impulse: Float32Array;
  /** Share of the impulse that has passed at equal steps of the contact: yields by points. */
  readonly passed: Float32Array;
}

export interface FloorTable {
  /** Index into `contact_laws`. */
  readonly law: number;
  /** k of F = k d^n, N / m^n. */
  readonly stiffness: number;
  /** n. */
  readonly exponent: number;
  /** m / (N s). */
  readonly mobility: number;
  /** Of the rubber foot. */
  readonly friction: number;
  /** MuJoCo's contact reference. */
  readonly solref: readonly number[];
  /** Red, green, blue of 0 to 1. */
  readonly colour: readonly number[];
  readonly plate: PlateTable;
}

/** A fraction of the sample rate, at which some tones ring. */
export interface TierTable {
  /** Samples of sound for one of the tier. */
  readonly divisor: number;
  /** Samples of the tier that one of sound is made of. */
  readonly taps: number;
  /** By how many samples of sound it comes later than it is given. */
  readonly late: number;
  /** The filter between samples, taps times divisor. */
  readonly interpolator: readonly number[];
}

export interface SoundTables {
  readonly format: number;
  /** The only one that the tables are for, Hz. */
  readonly sample_rate: number;
  /**
   * Sound pressure of a sample of 1, Pa, as in the WAV files of Python. Always the same, so that a quiet
   * walk sounds quiet beside a loud one; a boarded floor under a foot has peaks of half of it.
   */
  readonly full_scale: number;
  readonly air: { readonly speed_of_sound: number; readonly impedance: number };
  readonly tiers: readonly TierTable[];
  readonly landing: {
    /** m. */
    readonly foot_radius: number;
    /** Speed up to which a landing is not heard, m/s. */
    readonly faintest: number;
    /** Length of the squares within which a floor sounds alike, m. */
    readonly place_size: number;
  };
  readonly contact_laws: readonly LawTable[];
  readonly floors: Readonly<Record<string, FloorTable>>;
  readonly shell: {
    /** Share of a force at a foot that comes to the shell. */
    readonly transmissibility: number;
    /** Which way each foot moves it. */
    readonly sides: Float32Array;
    readonly plate: PlateTable;
  };
  readonly drive: {
    /** Of the rotors, as the joints feel it, kg m^2. */
    readonly inertia: Float32Array;
    /** rad. */
    readonly backlash: number;
    /** N m / rad. */
    readonly stiffness: number;
    /** m. */
    readonly lever: number;
    /** By how many radians the phase of each tone goes on in a radian of each joint. */
    readonly tone_periods: Float32Array;
    /** Share of the torque that alternates. */
    readonly tone_shares: readonly number[];
  };
  /** Noise through `filter`, of this mean square at 1 m, Pa^2. */
  readonly fan: { readonly mean_square: number; readonly filter: Section };
  /** Noise through `filter`, of this share of the friction power. */
  readonly scuffing: { readonly efficiency: number; readonly filter: Section };
  readonly microphone: {
    /** In the trunk's frame, m. */
    readonly offset: readonly number[];
    readonly min_distance: number;
  };
  readonly meter: {
    /** Root mean square of 0 dB, Pa. */
    readonly reference: number;
    readonly a_weighting: readonly Section[];
    /** Of the detector, s. */
    readonly time_constant: number;
    readonly readings_per_second: number;
    /** Time before the first reading, s. */
    readonly settling: number;
    /** Time after the start of a walk, or a fall, that is left out of its figures, s. */
    readonly settle_time: number;
  };
}

/**
 * Returns the tables.
 *
 * @param json What `sound.json` holds, parsed.
 * @param binary What `sound.bin` holds.
 * @throws Error if they are of another layout, or do not belong together.
 */
export function loadSoundTables(json: unknown, binary: ArrayBuffer): SoundTables {
  const format = (json as { format?: unknown } | null)?.format;
  if (format !== FORMAT) {
    throw new Error(`the sound's tables have the format ${String(format)}, not ${FORMAT}`);
  }
  const numbers = new Float32Array(binary);
  return withArrays(json, numbers) as SoundTables;
}

/** Returns a value with arrays in the place of what refers to them. */
function withArrays(value: unknown, numbers: Float32Array): unknown {
  if (Array.isArray(value)) return value.map((own) => withArrays(own, numbers));
  if (typeof value !== "object" || value === null) return value;
  const { shape, offset } = value as { shape?: number[]; offset?: number };
  if (shape !== undefined && offset !== undefined) {
    const length = shape.reduce((product, own) => product * own, 1);
    if (offset + length > numbers.length) {
      throw new Error("the sound's tables end before the last array");
    }
    return numbers.slice(offset, offset + length);
  }
  const entries = Object.entries(value).map(([name, own]) => [name, withArrays(own, numbers)]);
  return Object.fromEntries(entries) as unknown;
}
