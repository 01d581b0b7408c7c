/**
 * One Go1 in MuJoCo, on flat ground or on stairs: the model that Python steps, stepped likewise.
 *
 * What walks it, and what is made of what it does, is left to others.
 */

import { compile, idOf, type MainModule, type MjData, type MjModel } from "./mujoco.js";
import type { Floor, PageData } from "./page_data.js";
import { Stairs } from "./stairs.js";

export type Ground = "flat" | "stairs";

/** What is told after every physics step. */
export type Listener = (simulation: Simulation) => void;

const FEET = 4;

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
      const [x, , z] = position.subarray(3 * foot, 3 * foot + 3);
      lowest = Math.min(lowest, z - this.page.foot_radius - this.groundHeight(x));
    }
    this.qpos[2] -= lowest;
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
    this.qvel[0] += x;
    this.qvel[1] += y;
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
    // Negated, so that what is no number counts as too fast.
    return !this.qvel.every((speed) => Math.abs(speed) < this.page.max_speed);
  }

  /** Cosine of the trunk's tilt. */
  get upright(): number {
    const [, x, y] = this.qpos.subarray(3, 7);
    return 1 - 2 * (x * x + y * y);
  }

  /**
   * Returns the mass that a vertical blow at a foot meets in the pose before the last physics step,
   * (n^T J M^-1 J^T n)^-1, kg. Within `Listener` alone. See Python's `mute.acoustics.recorder`.
   */
  effectiveMass = (foot: number): number => this.world.effectiveMass(foot);

  private lay(): void {
    if (this.ground !== "stairs") return;
    const [x, y] = this.qpos;
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

/** What is measured at the feet: x, y, z of each in the world frame. */
export interface FootReadings {
  /** Number of contacts. */
  readonly contact: Float64Array;
  /** Centre, m. */
  readonly position: Float64Array;
  /** m/s. */
  readonly velocity: Float64Array;
  /** rad/s. */
  readonly angularVelocity: Float64Array;
  /** Contact force, N. */
  readonly force: Float64Array;
}

/** A model with its state. Views of the module's memory are kept until that memory moves. */
class World {
  readonly data: MjData;
  private readonly scratch: MjData;
  private readonly views = new Map<string, Float64Array>();
  private readonly sensors: Readonly<Record<keyof FootReadings, number>>;
  private readonly trunkContact: number;
  private readonly sites: readonly number[];
  private readonly servos: readonly number[];
  private readonly pose: Float64Array;
  private readonly jacobian;
  private readonly solved;
  private readings: FootReadings | null = null;

  constructor(
    private readonly mujoco: MainModule,
    readonly model: MjModel,
    page: PageData,
  ) {
    this.data = new mujoco.MjData(model);
    this.scratch = new mujoco.MjData(model);
    const first = page.legs[0];
    const sensor = (name: string) => model.sensor_adr[idOf(mujoco, model, "sensor", name)];
    this.sensors = {
      contact: sensor(`${first}_foot_contact`),
      position: sensor(`${first}_foot_pos`),
      velocity: sensor(`${first}_foot_vel`),
      angularVelocity: sensor(`${first}_foot_angvel`),
      force: sensor(`${first}_foot_force`),
    };
    this.trunkContact = sensor("trunk_contact");
    this.sites = page.legs.map((leg) => idOf(mujoco, model, "site", `${leg}_foot`));
    this.servos = page.joint_names.map((joint) =>
      idOf(mujoco, model, "actuator", joint.replace(/_joint$/, "")),
    );
    this.pose = new Float64Array(model.nq);
    this.jacobian = new mujoco.DoubleBuffer(3 * model.nv);
    this.solved = new mujoco.DoubleBuffer(model.nv);
  }

  delete(): void {
    for (const object of [this.jacobian, this.solved, this.scratch, this.data, this.model]) {
      object.delete();
    }
  }

  view(name: "qpos" | "qvel" | "ctrl" | "actuator_force" | "xpos" | "xquat" | "sensordata") {
    const kept = this.views.get(name);
    if (kept && kept.buffer.byteLength) return kept;
    // Its memory grew, and the old one is detached.
    this.readings = null;
    const view = this.data[name] as Float64Array;
    this.views.set(name, view);
    return view;
  }

  feet(): FootReadings {
    const data = this.view("sensordata");
    if (!this.readings) {
      const part = (name: keyof FootReadings, width: number) =>
        data.subarray(this.sensors[name], this.sensors[name] + width);
      this.readings = {
        contact: part("contact", FEET),
        position: part("position", 3 * FEET),
        velocity: part("velocity", 3 * FEET),
        angularVelocity: part("angularVelocity", 3 * FEET),
        force: part("force", 3 * FEET),
      };
    }
    return this.readings;
  }

  /** Trunk and head. */
  trunkTouches(): boolean {
    const data = this.view("sensordata");
    return data[this.trunkContact] > 0 || data[this.trunkContact + 1] > 0;
  }

  setFloor(floor: Floor): void {
    const { model } = this;
    for (let geom = 0; geom < model.ngeom; geom++) {
      if (model.geom_bodyid[geom] !== 0) continue;
      model.geom_friction[3 * geom] = floor.friction;
      model.geom_solref.set(floor.solref, 2 * geom);
    }
  }

  setGains(stiffness: ArrayLike<number>, damping: ArrayLike<number>): void {
    const { model } = this;
    const width = model.actuator_gainprm.length / model.nu;
    this.servos.forEach((servo, joint) => {
      model.actuator_gainprm[width * servo] = stiffness[joint];
      model.actuator_biasprm[width * servo + 1] = -stiffness[joint];
      model.actuator_biasprm[width * servo + 2] = -damping[joint];
    });
  }

  lay(stairs: Stairs, x: number, y: number): void {
    const { model, mujoco } = this;
    stairs.near(x, y).forEach((box, index) => {
      const geom = idOf(mujoco, model, "geom", `ground_${index}`);
      const half = box.half.map(Math.fround);
      model.geom_pos.set(box.centre.map(Math.fround), 3 * geom);
      model.geom_size.set(half, 3 * geom);
      model.geom_aabb.set([0, 0, 0, ...half], 6 * geom);
      model.geom_rbound[geom] = Math.hypot(...half);
      model.geom_quat.set([1, 0, 0, 0], 4 * geom);
    });
  }

  keepPose(): void {
    this.pose.set(this.view("qpos"));
  }

  effectiveMass(foot: number): number {
    const { mujoco, model, scratch, jacobian, solved } = this;
    scratch.qpos.set(this.pose);
    mujoco.mj_kinematics(model, scratch);
    mujoco.mj_comPos(model, scratch);
    mujoco.mj_crb(model, scratch);
    mujoco.mj_factorM(model, scratch);
    mujoco.mj_jacSite(model, scratch, jacobian, null, this.sites[foot]);
    const down = Array.from(jacobian.GetView().subarray(2 * model.nv, 3 * model.nv) as Float64Array);
    mujoco.mj_solveM(model, scratch, solved, down);
    const response = solved.GetView() as Float64Array;
    return 1 / down.reduce((sum, value, i) => sum + value * response[i], 0);
  }
}
