/**
 * From a simulation's sensors to readings, once every physics step: finds the onsets of contact and
 * the power of feet that slide. The port of Python's `mute.acoustics.recorder`, which says why.
 */

import { FEET, type ContactReadings } from "./readings.js";

/** What is measured at the feet in one physics step, as the simulation has it right after it.
 * Vectors are x, y, z of each foot in the world frame; all of the same evaluation of the dynamics. */
export interface FootSensors {
  /** Above 0 where the foot touches the ground, as `{leg}_foot_contact` has it. */
  readonly contact: ArrayLike<number>;
  /** Centre, m. */
  readonly position: ArrayLike<number>;
  /** Velocity of the centre, m/s. */
  readonly velocity: ArrayLike<number>;
  /** Angular velocity, rad/s. */
  readonly angularVelocity: ArrayLike<number>;
  /** Contact force between foot and ground, of the foot on the ground, N. */
  readonly force: ArrayLike<number>;
}

/** What contacts are told by. */
export interface ContactFigures {
  /** Time without contact after which the next contact is a landing, s. */
  readonly release: number;
  /** Share of the largest friction from which on a foot slides. */
  readonly at_limit: number;
  /** m. */
  readonly foot_radius: number;
}

export class Recorder {
  /** Friction coefficient of what the robot stands on. */
  friction: number;
  private readonly release: number;
  /** Steps since each foot last touched the ground. */
  private readonly airborne = new Int32Array(FEET);
  /** Whether each foot has touched the ground since the robot began anew. */
  private readonly stood = new Uint8Array(FEET);

  /**
   * @param timestep Physics step, s.
   * @param friction Friction coefficient of the floor.
   * @param figures What contacts are told by.
   */
  constructor(
    timestep: number,
    friction: number,
    private readonly figures: ContactFigures,
  ) {
    this.friction = friction;
    this.release = Math.max(1, Math.round(figures.release / timestep));
    // All begin on the ground: the first contact is no landing.
    this.stood.fill(1);
  }

  /** Take note that the robot begins anew: each foot's first contact from now on is no landing. */
  restart(): void {
    this.stood.fill(0);
  }

  /**
   * Fills in landings, sliding and the places of the feet of one physics step.
   *
   * @param feet What was measured.
   * @param effectiveMass Returns the mass that a vertical blow at a foot meets,
   *   (n^T J M^-1 J^T n)^-1, kg, in the pose that the step's contacts were found in; it is asked
   *   only of feet that land.
   * @param into Where to; joints and trunk are the caller's.
   */
  record(
    feet: FootSensors,
    effectiveMass: (foot: number) => number,
    into: ContactReadings,
  ): void {
    for (let foot = 0; foot < FEET; foot++) {
      const lands = this.lands(foot, (feet.contact[foot] as number) > 0);
      // The step that first finds contact still carries the velocity of the approach.
      const speed = lands ? Math.max(-(feet.velocity[3 * foot + 2] as number), 0) : 0;
      into.landingSpeed[foot] = speed;
      into.landingMass[foot] = speed > 0 ? effectiveMass(foot) : 0;
      into.frictionPower[foot] = this.frictionPower(feet, foot);
      for (let axis = 3 * foot; axis < 3 * foot + 3; axis++) {
        into.footPosition[axis] = feet.position[axis] as number;
      }
    }
  }

  /** Returns whether a foot lands in this step, and keeps what the next one needs. */
  private lands(foot: number, touches: boolean): boolean {
    if (!touches) {
      this.airborne[foot] = (this.airborne[foot] as number) + 1;
      return false;
    }
    const lands = (this.airborne[foot] as number) >= this.release && this.stood[foot] === 1;
    this.airborne[foot] = 0;
    this.stood[foot] = 1;
    return lands;
  }

  /** Returns the power of a foot's sliding, W: 0 below the cone of friction, where it sticks. */
  private frictionPower(feet: FootSensors, foot: number): number {
    const x = 3 * foot;
    const forceX = feet.force[x] as number;
    const forceY = feet.force[x + 1] as number;
    const limit = this.friction * Math.max(Math.abs(feet.force[x + 2] as number), 1e-6);
    if (!(Math.hypot(forceX, forceY) >= this.figures.at_limit * limit)) return 0;
    // v + w x (0, 0, -r): where the foot touches, a foot that rolls does not slide.
    const radius = this.figures.foot_radius;
    const slideX = (feet.velocity[x] as number) - (feet.angularVelocity[x + 1] as number) * radius;
    const slideY = (feet.velocity[x + 1] as number) + (feet.angularVelocity[x] as number) * radius;
    return Math.max(forceX * slideX + forceY * slideY, 0);
  }
}
