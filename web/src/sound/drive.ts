/**
 * Motors and gears as a force on the robot's shell: Python's `mute.acoustics.sources.drive`, which
 * says what is assumed. Teeth that cross their play and meet give pulses; the torque's ripple and the
 * mesh of the gear give tones that follow the joint's angle.
 */

import { type ContactReadings, JOINTS } from "./readings.js";
import type { SoundTables } from "./tables.js";

/** Joints of a leg, each with a rotor, and so a pulse, of its own. */
const LEG = 3;

export class Drive {
  private readonly table: SoundTables["drive"];
  private readonly timestep: number;
  private readonly rate: number;
  private readonly teeth: Teeth;
  /** Pulses of 1 N s, by joint of a leg, as means over the samples, N. */
  private readonly pulses: Float64Array[];
  /** Pulses that have begun, from the next sample on, N. */
  private readonly coming: Float64Array;
  private readonly position = new Float64Array(JOINTS);
  private readonly torque = new Float64Array(JOINTS);
  private begun = false;

  /**
   * @param tables Where the drive is told.
   * @param timestep Physics step, s.
   * @param samples Samples of a step.
   */
  constructor(tables: SoundTables, timestep: number, samples: number) {
    this.table = tables.drive;
    this.timestep = timestep;
    this.rate = tables.sample_rate;
    this.teeth = new Teeth(this.table.inertia, this.table.backlash);
    this.pulses = Array.from({ length: LEG }, (_, joint) => this.pulse(joint));
    const longest = Math.max(...this.pulses.map((pulse) => pulse.length));
    this.coming = new Float64Array(samples + longest);
  }

  /** Half a sine of pi sqrt(I / K), on the gear's stiffness K. */
  private pulse(joint: number): Float64Array {
    const inertia = this.table.inertia[joint] as number;
    const duration = Math.PI * Math.sqrt(inertia / this.table.stiffness) * this.rate;
    const passed = (sample: number) => 0.5 - 0.5 * Math.cos(Math.PI * Math.min(sample / duration, 1));
    return Float64Array.from(
      { length: Math.ceil(duration) + 1 },
      (_, sample) => (passed(sample + 1) - passed(sample)) * this.rate,
    );
  }

  /** Begins anew. */
  reset(): void {
    this.coming.fill(0);
    this.teeth.reset();
    this.begun = false;
  }

  /** Fills in the force of a step, N. */
  press(readings: ContactReadings, into: Float64Array, samples: number): void {
    const { jointPosition, jointTorque } = readings;
    if (!this.begun) {
      this.position.set(jointPosition);
      this.torque.set(jointTorque);
      this.begun = true;
    }
    this.teeth.follow(readings, this.timestep);
    for (let joint = 0; joint < JOINTS; joint++) this.meet(joint);
    for (let i = 0; i < samples; i++) into[i] = this.coming[i] as number;
    this.coming.copyWithin(0, samples);
    this.coming.fill(0, this.coming.length - samples);
    for (let joint = 0; joint < JOINTS; joint++) {
      this.hum(joint, readings, into, samples);
    }
    this.position.set(jointPosition);
    this.torque.set(jointTorque);
  }

  /** Adds the pulse of teeth that met in a step. */
  private meet(joint: number): void {
    const speed = this.teeth.met[joint] as number;
    if (speed === 0) return;
    const impulse = ((this.table.inertia[joint] as number) * speed) / this.table.lever;
    const pulse = this.pulses[joint % LEG] as Float64Array;
    for (let i = 0; i < pulse.length; i++) {
      this.coming[i] = (this.coming[i] as number) + impulse * (pulse[i] as number);
    }
  }

  /** Adds a joint's tones: angle and torque go on evenly within the step, so that nothing jumps. */
  private hum(joint: number, readings: ContactReadings, into: Float64Array, samples: number): void {
    const { tone_periods: periods, tone_shares: shares, lever } = this.table;
    const torque = readings.jointTorque[joint] as number;
    const moved = (readings.jointPosition[joint] as number) - (this.position[joint] as number);
    const from = Math.abs(this.torque[joint] as number) / lever;
    const growth = (Math.abs(torque) / lever - from) / samples;
    for (let tone = 0; tone < shares.length; tone++) {
      const period = periods[tone * JOINTS + joint] as number;
      const share = shares[tone] as number;
      const phase = period * (this.position[joint] as number);
      const turn = (period * moved) / samples;
      const twice = 2 * Math.cos(turn);
      let before = Math.cos(phase - turn);
      let now = Math.cos(phase);
      let size = share * from;
      const grows = share * growth;
      for (let i = 0; i < samples; i++) {
        into[i] = (into[i] as number) + size * now;
        const next = twice * now - before;
        before = now;
        now = next;
        size += grows;
      }
    }
  }
}

/** Teeth of all joints that part and meet, as time goes on. */
class Teeth {
  /** Speed at which the teeth of each joint met in the last step, rad/s; 0 if they did not. */
  readonly met = new Float64Array(JOINTS);
  private readonly inertia: Float64Array;
  private readonly place = new Float64Array(JOINTS);
  private readonly speed = new Float64Array(JOINTS);
  private readonly velocity = new Float64Array(JOINTS);
  private begun = false;

  constructor(
    inertia: ArrayLike<number>,
    private readonly backlash: number,
  ) {
    this.inertia = Float64Array.from(inertia);
  }

  /** Begin with the next torque, at rest on the side that it presses on. */
  reset(): void {
    this.begun = false;
  }

  /** Follows the teeth through a step of the length dt, s, and fills `met`. */
  follow(readings: ContactReadings, dt: number): void {
    const { jointTorque, jointVelocity } = readings;
    for (let joint = 0; joint < JOINTS; joint++) {
      const velocity = jointVelocity[joint] as number;
      const before = this.begun ? (this.velocity[joint] as number) : velocity;
      const torque = jointTorque[joint] as number;
      const push = torque / (this.inertia[joint] as number) - (velocity - before) / dt;
      this.velocity[joint] = velocity;
      if (!this.begun) {
        this.place[joint] = push > 0 ? this.backlash : 0;
        this.speed[joint] = 0;
      }
      const place = this.place[joint] as number;
      const speed = this.speed[joint] as number;
      this.met[joint] = 0;
      if (speed === 0 && (push > 0 ? place >= this.backlash : place <= 0)) continue;
      // Within a step the torque is constant, and what it does is exact.
      const after = place + speed * dt + 0.5 * push * dt * dt;
      if (after > 0 && after < this.backlash) {
        this.place[joint] = after;
        this.speed[joint] = speed + push * dt;
        continue;
      }
      const ends = after >= this.backlash;
      const way = ends ? this.backlash - place : -place;
      const arrived = Math.sqrt(Math.max(speed * speed + 2 * push * way, 0));
      this.place[joint] = ends ? this.backlash : 0;
      this.speed[joint] = 0;
      this.met[joint] = ends ? arrived : -arrived;
    }
    this.begun = true;
  }
}
