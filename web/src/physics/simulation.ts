/**
 * One Go1 in MuJoCo, on flat ground or on stairs: the model that Python steps, stepped likewise.
 *
 * What walks it, and what is made of what it does, is left to others.
 */

import { compile, type MainModule } from "./mujoco.js";
import type { Floor, PageData } from "./page_data.js";
import { Stairs } from "./stairs.js";
import { FEET, type FootReadings, World } from "./world.js";
import { quadruple, triple } from "../support/vectors.js";

export type Ground = "flat" | "stairs";

/** What is told after every physics step. */
export type Listener = (simulation: Simulation) => void;

/** Where MuJoCo itself takes a position for a blow-up (mjMAXVAL), m or rad. */
const FURTHEST = 1e10;

export class Simulation {
  /** Physics step, s. */
  readonly timestep: number;
  private readonly worlds: Readonly<Record<Ground, World>>;
  private world: World;
  private ground: Ground = "flat";
  private stairs: Stairs;
  private cell = "";
  private floorName: string;

  /**
   * @param mujoco The WebAssembly module.
   * @param scenes MJCF of each ground, as `python -m mute.web` writes it.
   * @param page What it writes beside them.
   */
  constructor(
    private readonly mujoco: MainModule,
    scenes: Readonly<Record<Ground, string>>,
    private readonly page: PageData,
  ) {
    this.worlds = {
      flat: new World(mujoco, compile(mujoco, scenes.flat, false), page),
      stairs: new World(mujoco, compile(mujoco, scenes.stairs, false), page),
    };
    this.world = this.worlds.flat;
    this.timestep = this.world.model.opt.timestep;
    this.stairs = new Stairs(page.stairs, 0);
    this.floorName = page.surface;
    this.setFloor(page.surface);
    this.reset();
  }

  /** Frees the memory of the module that it takes. */
  delete(): void {
    for (const world of Object.values(this.worlds)) world.delete();
  }

  /** Generalised positions; those of the trunk's free joint come first. A view, to be written. */
  get qpos(): Float64Array {
    return this.world.view("qpos");
  }

  /** Generalised velocities, likewise. */
  get qvel(): Float64Array {
    return this.world.view("qvel");
  }

  /** Set points of the joints, rad. */
  get ctrl(): Float64Array {
    return this.world.view("ctrl");
  }

  /** Torques of the motors, N m. */
  get torque(): Float64Array {
    return this.world.view("actuator_force");
  }

  /** Where each body is in the world, m: x, y, z of each. */
  get bodyPosition(): Float64Array {
    return this.world.view("xpos");
  }

  /** Its orientation, w x y z of each. */
  get bodyQuaternion(): Float64Array {
    return this.world.view("xquat");
  }

  /** What the sensors of the feet read: vectors in the world frame. Views of the last step. */
  get feet(): FootReadings {
    return this.world.feet();
  }

  get floor(): Floor {
    return floorOf(this.page, this.floorName);
  }

  /** Lets the robot walk on another floor, from the next physics step on. */
  setFloor(name: string): void {
    const floor = floorOf(this.page, name);
    this.floorName = name;
    for (const world of Object.values(this.worlds)) world.setFloor(floor);
  }

  /** Sets the gains of the joints' position controllers, N m/rad and N m s/rad. */
  setGains(stiffness: ArrayLike<number>, damping: ArrayLike<number>): void {
    for (const world of Object.values(this.worlds)) world.setGains(stiffness, damping);
  }

  /** Changes the ground; the robot has to begin anew on it. */
  setGround(ground: Ground, level: number): void {
    this.ground = ground;
    this.world = this.worlds[ground];
    this.stairs = new Stairs(this.page.stairs, level);
    this.reset();
  }

  /** The stairs that there are, if there are any. */
  get flights(): Stairs | null {
    return this.ground === "stairs" ? this.stairs : null;
  }

  /** Returns the height of the ground, m. */
  groundHeight(x: number): number {
    return this.ground === "stairs" ? this.stairs.height(x) : 0;
  }

  /** Puts the robot into the stance, its lowest feet on the ground. */
  reset(): void {
    const { world, mujoco } = this;
    mujoco.mj_resetDataKeyframe(world.model, world.data, 0);
    this.cell = "";
    this.lay();
    mujoco.mj_forward(world.model, world.data);
    const { position } = world.feet();
    let lowest = Infinity;
    for (let foot = 0; foot < FEET; foot++) {
      const [x, , z] = triple(position, foot);
      lowest = Math.min(lowest, z - this.page.foot_radius - this.groundHeight(x));
    }
    (this.qpos[2] as number) -= lowest;
    mujoco.mj_forward(world.model, world.data);
  }

  /** Puts the robot into a state. */
  setState(qpos: ArrayLike<number>, qvel: ArrayLike<number>): void {
    this.reset();
    this.qpos.set(qpos);
    this.qvel.set(qvel);
    this.mujoco.mj_forward(this.world.model, this.world.data);
  }

  /** Pushes the trunk: adds to its velocity in the world frame, m/s. */
  push(x: number, y: number): void {
    (this.qvel[0] as number) += x;
    (this.qvel[1] as number) += y;
  }

  /** Advances by some physics steps, in which `ctrl` holds. */
  step(steps: number, listener?: Listener): void {
    const { mujoco, world } = this;
    this.lay();
    for (let i = 0; i < steps; i++) {
      if (listener) world.keepPose();
      mujoco.mj_step(world.model, world.data);
      listener?.(this);
    }
  }

  /** Whether the trunk or the head touches the ground, or the trunk is tilted too far. */
  get fallen(): boolean {
    return this.world.trunkTouches() || this.upright < Math.cos(this.page.max_tilt);
  }

  /** Whether the numbers blew up. */
  get unstable(): boolean {
    // Negated, so that what is no number counts as too fast, or too far.
    return !(
      this.qvel.every((speed) => Math.abs(speed) < this.page.max_speed) &&
      this.qpos.every((position) => Math.abs(position) < FURTHEST)
    );
  }

  /** Cosine of the trunk's tilt. */
  get upright(): number {
    const [, x, y] = quadruple(this.qpos.subarray(3, 7));
    return 1 - 2 * (x * x + y * y);
  }

  /**
   * Returns the mass that a vertical blow at a foot meets in the pose before the last physics step,
   * (n^T J M^-1 J^T n)^-1, kg. Within `Listener` alone. See Python's `mute.acoustics.recorder`.
   */
  effectiveMass = (foot: number): number => this.world.effectiveMass(foot);

  private lay(): void {
    if (this.ground !== "stairs") return;
    const [x, y] = triple(this.qpos);
    const cell = this.stairs.cell(x, y);
    if (cell === this.cell) return;
    this.cell = cell;
    this.world.lay(this.stairs, x, y);
  }
}

function floorOf(page: PageData, name: string): Floor {
  const floor = page.floors.find((known) => known.name === name);
  if (!floor) throw new Error(`there is no floor ${name}`);
  return floor;
}
