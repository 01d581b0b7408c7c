/** A compiled model with its state: what a simulation reads and writes of MuJoCo. */

import { idOf, type MainModule, type MjData, type MjModel } from "./mujoco.js";
import type { Floor, PageData } from "./page_data.js";
import type { Stairs } from "./stairs.js";

export const FEET = 4;

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

/** Views of the module's memory are kept until that memory moves. */
export class World {
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
    // What blows up stays so, to be noticed: MuJoCo would lay the robot back to where it began, unasked.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET.value;
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
    if (kept?.buffer.byteLength) return kept;
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
    return (data[this.trunkContact] as number) > 0 || (data[this.trunkContact + 1] as number) > 0;
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
      model.actuator_biasprm[width * servo + 1] = -(stiffness[joint] as number);
      model.actuator_biasprm[width * servo + 2] = -(damping[joint] as number);
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
    mujoco.mj_jacSite(model, scratch, jacobian, null, this.sites[foot] as number);
    const down = Array.from(
      jacobian.GetView().subarray(2 * model.nv, 3 * model.nv) as Float64Array,
    );
    mujoco.mj_solveM(model, scratch, solved, down);
    const response = solved.GetView() as Float64Array;
    return 1 / down.reduce((sum, value, i) => sum + value * (response[i] as number), 0);
  }
}
