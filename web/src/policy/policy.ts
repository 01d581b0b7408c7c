/**
 * An exported policy as a controller of one robot: its networks, what they remember, and what the
 * file says of its observations and actions.
 */

import { buildGraph, type Graph } from "./graph.js";
import { readOnnx } from "./onnx_file.js";

/** A file that is no policy for this page; the message is one line for the user. */
export class PolicyError extends Error {}

/** What a policy must fit: the robot and the physics of the page. */
export interface Robot {
  readonly jointNames: readonly string[];
  /** Physics step, s. */
  readonly timestep: number;
}

/** Parts of an observation, in whatever order the policy sees them. */
export interface Observation {
  /** Angular velocity of the trunk in its own frame, rad/s. */
  readonly base_ang_vel: Float32Array;
  /** Direction of gravity in the trunk's frame. */
  readonly projected_gravity: Float32Array;
  /** Joint positions beside the policy's default ones, rad. */
  readonly joint_pos: Float32Array;
  /** rad/s. */
  readonly joint_vel: Float32Array;
  /** What the policy did last. */
  readonly last_action: Float32Array;
  /** (v_x, v_y, w_z, beta), m/s and rad/s. */
  readonly command: Float32Array;
}

const WIDTHS: Readonly<Record<keyof Observation, number>> = {
  base_ang_vel: 3,
  projected_gravity: 3,
  joint_pos: 12,
  joint_vel: 12,
  last_action: 12,
  command: 4,
};

/** What is allowed: those of gains and scales are what Python takes, too. */
const RANGES: Readonly<Record<string, readonly [least: number, most: number, unit: string]>> = {
  joint_stiffness: [0, 1e4, " N m/rad"],
  joint_damping: [0, 1e3, " N m s/rad"],
  default_joint_pos: [-2 * Math.PI, 2 * Math.PI, " rad"],
  action_scale: [0, 100, " rad"],
  action_clip: [0, 1e6, ""],
  observation_scales: [-1e6, 1e6, ""],
};

const COMMAND_NAMES = "lin_vel_x,lin_vel_y,ang_vel_z,beta";

/** Bytes of the largest file that is read. */
const LARGEST_FILE = 32 * 1024 * 1024;

/** @throws PolicyError If a file has too many bytes, which is known before it is read. */
export function checkSize(bytes: number): void {
  if (bytes > LARGEST_FILE) throw new PolicyError("it is larger than 32 MB");
}

export class Policy {
  /** N m/rad, of each joint. */
  readonly stiffness: Float64Array;
  /** N m s/rad, of each joint. */
  readonly damping: Float64Array;
  /** rad, of each joint. */
  readonly defaultJointPos: Float32Array;
  /** rad for an action of 1, of each joint. */
  readonly actionScale: Float32Array;
  /** Largest magnitude of an action. */
  readonly actionClip: number;
  /** Physics steps in a control step. */
  readonly decimation: number;
  /** What it did last. */
  readonly action = new Float32Array(12);
  private readonly graph: Graph;
  private readonly order: readonly (keyof Observation)[];
  private readonly scales: readonly number[];
  private readonly remembered: readonly [into: Float32Array, from: Float32Array][];
  private readonly input: Float32Array;
  private readonly output: Float32Array;

  /**
   * Reads a policy that `python -m mute.export` wrote.
   *
   * @param file The bytes of the file.
   * @param robot What it has to fit.
   * @throws PolicyError If it is anything else.
   */
  constructor(file: Uint8Array, robot: Robot) {
    checkSize(file.length);
    try {
      const onnx = readOnnx(file);
      const metadata = new Metadata(onnx.metadata);
      metadata.exactly("joint_names", robot.jointNames.join(","));
      metadata.exactly("command_names", COMMAND_NAMES);
      this.stiffness = Float64Array.from(metadata.within("joint_stiffness", 12));
      this.damping = Float64Array.from(metadata.within("joint_damping", 12));
      this.defaultJointPos = Float32Array.from(metadata.within("default_joint_pos", 12));
      this.actionScale = Float32Array.from(metadata.within("action_scale", 12));
      this.actionClip = metadata.within("action_clip", 1)[0] as number;
      this.decimation = metadata.steps("control_dt", robot.timestep);
      this.order = metadata.observationNames();
      this.scales = metadata.scales(this.order);
      this.graph = buildGraph(onnx, this.decimation * robot.timestep);
      this.remembered = metadata.recurrentState().map(([into, from]) => {
        return [buffer(this.graph.inputs, into), buffer(this.graph.outputs, from)];
      });
      this.input = buffer(this.graph.inputs, "obs");
      this.output = buffer(this.graph.outputs, "action");
      this.checkWidths();
    } catch (error) {
      if (error instanceof RangeError || error instanceof TypeError) {
        throw new PolicyError(`it is no policy that MUTE exported: ${error.message}`);
      }
      throw error;
    }
  }

  /** Forget the past. */
  reset(): void {
    for (const [into] of this.remembered) into.fill(0);
    this.action.fill(0);
  }

  /** Returns the action for one control step, also `action`, and moves what is remembered on. */
  act(observation: Observation): Float32Array {
    let at = 0;
    this.order.forEach((name, part) => {
      const scale = this.scales[part] as number;
      for (const value of observation[name]) this.input[at++] = value * scale;
    });
    return this.actOn(this.input);
  }

  /** The same on an observation that is laid out and scaled already. */
  actOn(scaled: Float32Array): Float32Array {
    if (scaled !== this.input) this.input.set(scaled);
    this.graph.run();
    for (const [into, from] of this.remembered) into.set(from);
    const clip = this.actionClip;
    this.output.forEach((value, joint) => {
      // What is not a number would pass a clamp and reach the physics.
      this.action[joint] = Number.isNaN(value) ? 0 : Math.min(Math.max(value, -clip), clip);
    });
    return this.action;
  }

  private checkWidths(): void {
    const width = this.order.reduce((sum, name) => sum + WIDTHS[name], 0);
    if (this.input.length !== width) throw new RangeError(`its input is ${this.input.length} wide`);
    if (this.output.length !== 12) throw new RangeError(`its action is ${this.output.length} wide`);
    for (const [into, from] of this.remembered) {
      if (into.length !== from.length) throw new RangeError("what it remembers changes its width");
    }
  }
}

function buffer(buffers: ReadonlyMap<string, Float32Array>, name: string): Float32Array {
  const found = buffers.get(name);
  if (!found) throw new RangeError(`it has no ${name}`);
  return found;
}

/** Returns a value that is within its range. */
function checked(name: string, value: number): number {
  const [least, most, unit] = RANGES[name] ?? [-Infinity, Infinity, ""];
  if (value >= least && value <= most) return value;
  const [low, high] = [least, most].map((end) => `${Math.round(100 * end) / 100}`);
  throw new RangeError(`its ${name} must be from ${low} to ${high}${unit}, one is ${value}`);
}

/** The metadata of an export, checked. */
class Metadata {
  constructor(private readonly entries: ReadonlyMap<string, string>) {}

  text(name: string): string {
    const value = this.entries.get(name);
    if (value === undefined) throw new RangeError(`it does not tell ${name}`);
    return value;
  }

  exactly(name: string, expected: string): void {
    if (this.text(name) !== expected) throw new RangeError(`it has other ${name}`);
  }

  number(name: string): number {
    return this.numbers(name, 1)[0] as number;
  }

  numbers(name: string, count: number): number[] {
    const values = this.text(name).split(",").map(Number);
    if (values.length !== count || !values.every(Number.isFinite)) {
      throw new RangeError(`its ${name} are not ${count} numbers`);
    }
    return values;
  }

  /** The same, each of which has to be within its range. */
  within(name: string, count: number): number[] {
    return this.numbers(name, count).map((value) => checked(name, value));
  }

  /** Returns how many physics steps a time takes. */
  steps(name: string, timestep: number): number {
    const time = this.number(name);
    const steps = Math.round(time / timestep);
    if (!(steps >= 1 && steps <= 1000 && Math.abs(steps * timestep - time) < 1e-9)) {
      throw new RangeError(`its ${name} is no multiple of the physics step`);
    }
    return steps;
  }

  observationNames(): (keyof Observation)[] {
    const names = this.text("observation_names").split(",");
    for (const name of names)
      if (!(name in WIDTHS)) throw new RangeError(`it wants to see ${name}`);
    return names as (keyof Observation)[];
  }

  scales(names: readonly string[]): number[] {
    const scales = this.json("observation_scales");
    return names.map((name) => {
      const scale = scales[name];
      if (typeof scale !== "number") throw new RangeError(`it does not tell the scale of ${name}`);
      return checked("observation_scales", scale);
    });
  }

  recurrentState(): [into: string, from: string][] {
    return Object.entries(this.json("recurrent_state")).map(([into, from]) => {
      if (typeof from !== "string") throw new RangeError("its recurrent_state is damaged");
      return [into, from];
    });
  }

  private json(name: string): Record<string, unknown> {
    let value: unknown;
    try {
      value = JSON.parse(this.text(name));
    } catch (error) {
      if (error instanceof SyntaxError) throw new RangeError(`its ${name} is damaged`);
      throw error;
    }
    if (typeof value !== "object" || value === null) throw new RangeError(`its ${name} is damaged`);
    return value as Record<string, unknown>;
  }
}
