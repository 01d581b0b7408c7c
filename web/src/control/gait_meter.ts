/** How the robot walks, in figures, as `mute.evaluation.gait`. */

import type { Command } from "../physics/page_data.js";
import type { Simulation } from "../physics/simulation.js";
import type { Footfalls } from "./footfalls.js";
import type { Observer } from "./observer.js";
import { triple } from "../support/vectors.js";

/** Figures over some time; NaN where nothing happened to measure. */
export interface Gait {
  /** Mean forward speed, body frame, m/s. */
  readonly speed: number;
  /** Mean of |v_xy^cmd - v_xy|^2, (m/s)^2. */
  readonly velocity_error_sq: number;
  /** Mean of (w_z^cmd - w_z)^2, (rad/s)^2. */
  readonly yaw_rate_error_sq: number;
  /** Mean over landings of the landing speed, m/s. */
  readonly landing_speed_mean: number;
  /** Root mean square of it, m/s. */
  readonly landing_speed_rms: number;
  /** Mean over swings of the highest clearance, m. */
  readonly apex_mean: number;
  /** Share of the time that a foot is on the ground. */
  readonly duty_factor: number;
  /** Landings of a foot per second, Hz. */
  readonly stride_frequency: number;
  /** Mean over time of the sum over joints of |torque times velocity|, W. */
  readonly power: number;
  /** Falls. */
  readonly falls: number;
}

const FEET = 4;

export class GaitMeter {
  private age = 0;
  private steps = 0;
  private readonly sums = new Map<string, number>();
  private falls = 0;
  private readonly settleSteps: number;

  /**
   * @param stepTime Control period, s.
   * @param settleTime Time after the robot begins, or begins anew, that is not measured, s.
   */
  constructor(
    private readonly stepTime: number,
    settleTime: number,
  ) {
    this.settleSteps = Math.round(settleTime / stepTime);
  }

  /** Takes in a control step that the robot did not end by a fall. */
  update(command: Command, seen: Observer, feet: Footfalls, simulation: Simulation): void {
    if (++this.age <= this.settleSteps) return;
    this.steps++;
    const [vx, vy] = triple(seen.base_lin_vel);
    this.add("speed", vx);
    this.add("velocity", (command.vx - vx) ** 2 + (command.vy - vy) ** 2);
    this.add("yaw", (command.wz - (seen.base_ang_vel[2] as number)) ** 2);
    this.add("power", power(simulation));
    for (let foot = 0; foot < FEET; foot++) {
      this.add("contact", (feet.contactShare[foot] as number) / FEET);
      if (!feet.touchdown[foot]) continue;
      this.add("landings", 1);
      this.add("landing", feet.landingSpeed[foot] as number);
      this.add("landing squared", (feet.landingSpeed[foot] as number) ** 2);
      this.add("apex", feet.swingApex[foot] as number);
    }
  }

  /** Takes note that the robot begins anew, after a fall or because its numbers blew up. */
  interrupt(isFall: boolean): void {
    if (isFall) this.falls++;
    this.age = 0;
  }

  /** Forgets all but falls. */
  forget(): void {
    this.age = 0;
    this.steps = 0;
    this.sums.clear();
  }

  gait(): Gait {
    const { steps } = this;
    const sum = (name: string) => this.sums.get(name) ?? 0;
    const landings = sum("landings");
    return {
      speed: sum("speed") / steps,
      velocity_error_sq: sum("velocity") / steps,
      yaw_rate_error_sq: sum("yaw") / steps,
      landing_speed_mean: sum("landing") / landings,
      landing_speed_rms: Math.sqrt(sum("landing squared") / landings),
      apex_mean: sum("apex") / landings,
      duty_factor: sum("contact") / steps,
      stride_frequency: landings / (steps * FEET * this.stepTime),
      power: sum("power") / steps,
      falls: this.falls,
    };
  }

  private add(name: string, value: number): void {
    this.sums.set(name, (this.sums.get(name) ?? 0) + value);
  }
}

function power(simulation: Simulation): number {
  const { torque, qvel } = simulation;
  let sum = 0;
  for (let joint = 0; joint < 12; joint++) {
    sum += Math.abs((torque[joint] as number) * (qvel[6 + joint] as number));
  }
  return sum;
}
