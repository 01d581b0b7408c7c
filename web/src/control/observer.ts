/** What a policy sees of a simulation, as `mute.envs.base_state` and `mute.envs.observations`. */

import type { Observation } from "../policy/policy.js";
import type { Command } from "../physics/page_data.js";
import type { Simulation } from "../physics/simulation.js";
import { quadruple } from "../support/vectors.js";

/** The trunk in the frames that observations and figures ask for; all numbers are single. */
export class Observer implements Observation {
  readonly base_ang_vel = new Float32Array(3);
  readonly projected_gravity = new Float32Array(3);
  readonly joint_pos = new Float32Array(12);
  readonly joint_vel = new Float32Array(12);
  readonly last_action = new Float32Array(12);
  readonly command = new Float32Array(4);
  /** Velocity of the trunk in its own frame, m/s. */
  readonly base_lin_vel = new Float32Array(3);
  private readonly qpos = new Float32Array(19);

  /** Reads a simulation; joint positions are told beside the policy's default ones, rad. */
  read(simulation: Simulation, defaultJointPos: Float32Array): void {
    const { qvel } = simulation;
    this.qpos.set(simulation.qpos);
    const rotation = rotationOf(this.qpos.subarray(3, 7));
    for (let axis = 0; axis < 3; axis++) {
      let speed = 0;
      for (let row = 0; row < 3; row++) {
        speed += (rotation[3 * row + axis] as number) * Math.fround(qvel[row] as number);
      }
      this.base_lin_vel[axis] = speed;
      // MuJoCo gives a free joint's angular velocity in the body frame already.
      this.base_ang_vel[axis] = qvel[3 + axis] as number;
      this.projected_gravity[axis] = -(rotation[6 + axis] as number);
    }
    for (let joint = 0; joint < 12; joint++) {
      this.joint_pos[joint] = (this.qpos[7 + joint] as number) - (defaultJointPos[joint] as number);
      this.joint_vel[joint] = qvel[6 + joint] as number;
    }
  }

  /** Takes note of what the policy did, and of what the robot is asked to do next. */
  ask(command: Command, action: Float32Array): void {
    this.command.set([command.vx, command.vy, command.wz, command.beta]);
    this.last_action.set(action);
  }
}

/** Returns the rotation from body to world of a unit quaternion w x y z, row by row. */
function rotationOf(quaternion: ArrayLike<number>): readonly number[] {
  const [w, x, y, z] = quadruple(quaternion);
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
  ]; // prettier-ignore
}
