/**
 * A blow as it is pressed out in time: Python's `mute.acoustics.physics.contact`, by its tables, and
 * the forces of `mute.acoustics.sources.landings`.
 */

import type { FloorTable, LawTable } from "./tables.js";

export class Blow {
  /** Time of contact, s. */
  duration = 0;
  /** N s. */
  impulse = 0;
  /** Share of the impulse that has passed at equal steps of the contact. */
  private readonly shape: Float64Array;
  /** The row of the table below the ground's mobility, and how far on to the next it is. */
  private row = 0;
  private share = 0;

  /** @param points Number of steps of the contact that the tables have, and one. */
  constructor(points: number) {
    this.shape = new Float64Array(points);
  }

  /**
   * Sets what the blow is like.
   *
   * @param floor What is struck.
   * @param law Its law.
   * @param mass Effective mass, kg.
   * @param speed Above 0, m/s.
   */
  strike(floor: FloorTable, law: LawTable, mass: number, speed: number): void {
    const { exponent, stiffness, mobility } = floor;
    const energy = ((exponent + 1) * mass * speed * speed) / (2 * stiffness);
    const depth = energy ** (1 / (exponent + 1));
    this.look(law, (mobility * mass * speed) / depth);
    this.duration = (this.between(law.duration) * depth) / speed;
    this.impulse = this.between(law.impulse) * mass * speed;
    const { shape } = this;
    const at = this.row * shape.length;
    for (let i = 0; i < shape.length; i++) {
      const low = law.passed[at + i] as number;
      const high = law.passed[at + shape.length + i] as number;
      shape[i] = low + this.share * (high - low);
    }
  }

  /** Finds the rows of the table that a relative mobility lies between. */
  private look(law: LawTable, give: number): void {
    const { yields } = law;
    const last = yields.length - 1;
    let row = 0;
    while (row < last - 1 && (yields[row + 1] as number) <= give) row++;
    const low = yields[row] as number;
    const high = yields[row + 1] as number;
    this.row = row;
    this.share = Math.min(Math.max((give - low) / (high - low), 0), 1);
  }

  private between(column: Float32Array): number {
    const low = column[this.row] as number;
    return low + this.share * ((column[this.row + 1] as number) - low);
  }

  /**
   * Fills in the forces of coming samples, as many as there is room for, as means over the time
   * before each, N.
   *
   * @param elapsed Time since the beginning at the first sample, s.
   * @param rate Samples a second, Hz.
   */
  press(elapsed: number, rate: number, into: Float64Array): void {
    const { shape } = this;
    const last = shape.length - 1;
    const scale = this.impulse * rate;
    const step = last / (this.duration * rate);
    let position = (elapsed * last) / this.duration - step;
    let before = 0;
    for (let i = -1; i < into.length; i++) {
      let passed = position <= 0 ? 0 : 1;
      if (position > 0 && position < last) {
        const index = Math.floor(position);
        const low = shape[index] as number;
        passed = low + (position - index) * ((shape[index + 1] as number) - low);
      }
      if (i >= 0) into[i] = (passed - before) * scale;
      before = passed;
      position += step;
    }
  }
}
