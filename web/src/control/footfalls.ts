/**
 * Landings and swings of the feet, as `mute.envs.footfall`: contacts debounced at the control rate,
 * landing speeds from every physics step.
 */

import type { PageData } from "../physics/page_data.js";
import type { Simulation } from "../physics/simulation.js";
import { triple } from "../support/vectors.js";

const FEET = 4;
const NOWHERE = -1e6;

export class Footfalls {
  /** Feet whose landing was confirmed in this control step. */
  readonly touchdown = new Uint8Array(FEET);
  /** Landing speed where `touchdown`, else 0, m/s. */
  readonly landingSpeed = new Float64Array(FEET);
  /** How high the highest point of each foot's swing was above the ground near it, m. */
  readonly swingApex = new Float64Array(FEET);
  /** Share of the physics steps with contact. */
  readonly contactShare = new Float64Array(FEET);
  private readonly minSteps: number;
  private readonly window: number;
  private readonly depth: number;
  /** Downward speeds and contacts of the last `depth` physics steps, the oldest first. */
  private readonly drop: Float64Array[];
  private readonly touch: Uint8Array[];
  private readonly contact = new Uint8Array(FEET);
  private readonly contradicted = new Int32Array(FEET);
  private readonly highest = new Float64Array(FEET);
  private readonly highestGround = new Float64Array(FEET);

  /**
   * @param page Times.
   * @param timestep Physics step, s.
   * @param decimation Physics steps in a control step.
   */
  constructor(
    private readonly page: PageData,
    timestep: number,
    private readonly decimation: number,
  ) {
    const { min_segment, landing_window } = page.footfall;
    this.minSteps = Math.max(1, Math.round(min_segment / (timestep * decimation)));
    this.window = Math.max(1, Math.round(landing_window / timestep));
    this.depth = (this.minSteps + Math.ceil(this.window / decimation)) * decimation;
    this.drop = Array.from({ length: this.depth }, () => new Float64Array(FEET));
    this.touch = Array.from({ length: this.depth }, () => new Uint8Array(FEET));
  }

  /** Forgets the past. */
  reset(simulation: Simulation): void {
    const { contact } = simulation.feet;
    for (let foot = 0; foot < FEET; foot++) {
      const now = (contact[foot] as number) > 0 ? 1 : 0;
      this.contact[foot] = now;
      for (const row of this.touch) row[foot] = now;
    }
    for (const row of this.drop) row.fill(0);
    for (const part of [this.touchdown, this.landingSpeed, this.swingApex, this.contactShare]) {
      part.fill(0);
    }
    this.contradicted.fill(0);
    this.highest.fill(NOWHERE);
    this.highestGround.fill(NOWHERE);
  }

  /** Takes in a physics step. */
  record(simulation: Simulation): void {
    const { velocity, contact } = simulation.feet;
    const drop = this.drop.shift() as Float64Array;
    const touch = this.touch.shift() as Uint8Array;
    for (let foot = 0; foot < FEET; foot++) {
      drop[foot] = Math.max(-(velocity[3 * foot + 2] as number), 0);
      touch[foot] = (contact[foot] as number) > 0 ? 1 : 0;
    }
    this.drop.push(drop);
    this.touch.push(touch);
  }

  /** Closes the control step. */
  update(simulation: Simulation): void {
    for (let foot = 0; foot < FEET; foot++) this.close(simulation, foot);
  }

  private close(simulation: Simulation, foot: number): void {
    let steps = 0;
    for (const touch of this.touch.slice(this.depth - this.decimation)) steps += touch[foot] as number;
    this.contactShare[foot] = steps / this.decimation;
    const inStance = this.contact[foot] === 1;
    this.debounce(foot, steps > 0);
    const lifting = inStance && this.contact[foot] === 0;
    this.raise(simulation, foot, lifting, inStance);
    this.landingSpeed[foot] = this.touchdown[foot] ? this.speedOfLanding(foot) : 0;
  }

  private debounce(foot: number, raw: boolean): void {
    const disagrees = raw !== (this.contact[foot] === 1);
    this.contradicted[foot] = disagrees ? (this.contradicted[foot] as number) + 1 : 0;
    const changed = this.contradicted[foot] >= this.minSteps;
    this.touchdown[foot] = changed && this.contact[foot] === 0 ? 1 : 0;
    if (!changed) return;
    (this.contact[foot] as number) ^= 1;
    this.contradicted[foot] = 0;
  }

  private raise(simulation: Simulation, foot: number, lifting: boolean, inStance: boolean): void {
    const [x, , z] = triple(simulation.feet.position, foot);
    const height = z - this.page.foot_radius;
    const { near } = this.page.footfall;
    const ground = Math.max(...[0, near, -near].map((dx) => simulation.groundHeight(x + dx)));
    if (lifting) {
      this.highest[foot] = height;
      this.highestGround[foot] = ground;
    } else if (!inStance) {
      this.highest[foot] = Math.max(this.highest[foot] as number, height);
      this.highestGround[foot] = Math.max(this.highestGround[foot] as number, ground);
    }
    if (lifting || !inStance) {
      this.swingApex[foot] = (this.highest[foot] as number) - (this.highestGround[foot] as number);
    }
  }

  /** Returns the largest downward speed in the window that ends with the first contact. */
  private speedOfLanding(foot: number): number {
    const begin = this.depth - this.minSteps * this.decimation;
    let first = begin;
    while (first < this.depth && !this.touch[first]?.[foot]) first++;
    let speed = 0;
    for (let i = Math.max(first - this.window + 1, 0); i <= first && i < this.depth; i++) {
      speed = Math.max(speed, this.drop[i]?.[foot] ?? 0);
    }
    return speed;
  }
}
