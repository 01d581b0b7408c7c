/** What `python -m mute.web` says of the simulation in `page.json`, see `mute.web.assets`. */

export interface Command {
  /** Forward velocity, m/s. */
  readonly vx: number;
  /** Velocity to the left, m/s. */
  readonly vy: number;
  /** Yaw rate, rad/s. */
  readonly wz: number;
  /** Quiet factor, 0 for speed, 1 for silence. */
  readonly beta: number;
}

export type Axis = keyof Command;

export interface Floor {
  readonly name: string;
  readonly friction: number;
  readonly solref: readonly [number, number];
  readonly colour: readonly [number, number, number];
}

/** How stairs are laid, lengths in m. */
export interface StairsFigures {
  readonly boxes: number;
  readonly steps: number;
  readonly top: number;
  readonly valley: number;
  readonly tread: number;
  readonly risers: readonly number[];
  readonly depth: number;
  readonly half_width: number;
  readonly drawn_half_width: number;
}

export interface ControllerEntry {
  readonly name: string;
  readonly label: string;
  readonly file: string;
}

export interface PageData {
  readonly format: number;
  readonly controllers: readonly ControllerEntry[];
  readonly legs: readonly string[];
  readonly joint_names: readonly string[];
  readonly foot_radius: number;
  readonly decimation: number;
  readonly max_tilt: number;
  readonly max_speed: number;
  readonly command: {
    readonly limits: Readonly<Record<Axis, readonly [number, number]>>;
    readonly trained: Readonly<Record<"vx" | "vy" | "wz", readonly [number, number]>>;
    readonly start: Command;
  };
  readonly footfall: {
    readonly min_segment: number;
    readonly max_segment: number;
    readonly landing_window: number;
    /** How far from a foot ground counts as near, m. */
    readonly near: number;
  };
  /** What the onset of contacts and sliding are told by, see `mute.acoustics.recorder`. */
  readonly contact: {
    /** Time without contact after which the next contact is a landing, s. */
    readonly release: number;
    /** Share of the largest friction from which on a foot slides. */
    readonly at_limit: number;
  };
  /** Time after the robot begins that is in no figure, s. */
  readonly settle_time: number;
  /** Of the sound, Hz. */
  readonly sample_rate: number;
  readonly surface: string;
  readonly floors: readonly Floor[];
  readonly stairs: StairsFigures;
}

/** Returns what the onset of contacts and sliding are told by. */
export function contactFigures({ contact, foot_radius }: PageData) {
  return { ...contact, foot_radius };
}

const FORMAT = 2;

/**
 * Takes what `page.json` holds.
 *
 * @throws Error If it is of another version.
 */
export function readPageData(content: unknown): PageData {
  const data = content as PageData;
  if (data?.format !== FORMAT) {
    throw new Error(`page.json has the format ${data?.format}, this page needs ${FORMAT}`);
  }
  return data;
}
