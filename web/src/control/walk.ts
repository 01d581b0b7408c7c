/**
 * A walk that can be steered: the robot, what drives it, and what is measured, control step by
 * control step. The order of things is that of Python's `mute.envs.quadruped_env`.
 */

import type { Command, PageData } from "../physics/page_data.js";
import type { Listener, Simulation } from "../physics/simulation.js";
import type { Policy } from "../policy/policy.js";
import { Footfalls } from "./footfalls.js";
import { type Gait, GaitMeter } from "./gait_meter.js";
import { Observer } from "./observer.js";

/** What a control step ended with. */
export type Outcome = "walking" | "fallen" | "unstable";

export class Walk {
  /** What the robot is asked to do, from the next step on. */
  command: Command;
  /** Control steps since the start. */
  steps = 0;
  private readonly seen = new Observer();
  private feet: Footfalls;
  private meter: GaitMeter;

  /**
   * @param simulation The robot.
   * @param policy What drives it.
   * @param page Limits and times.
   * @param command What it is asked to do at first.
   */
  constructor(
    readonly simulation: Simulation,
    private policy: Policy,
    private readonly page: PageData,
    command: Command,
  ) {
    this.command = command;
    this.feet = this.newFeet();
    this.meter = this.newMeter();
    this.drive(policy);
  }

  /** Control period, s. */
  get stepTime(): number {
    return this.simulation.timestep * this.policy.decimation;
  }

  /** Time walked since the start, s. */
  get seconds(): number {
    return this.steps * this.stepTime;
  }

  /** Lets another policy drive, which begins with a robot that stands. */
  drive(policy: Policy): void {
    this.policy = policy;
    this.simulation.setGains(policy.stiffness, policy.damping);
    this.restart();
  }

  /** Begins anew: robot, figures and time. */
  restart(): void {
    this.simulation.reset();
    this.begin();
  }

  /** Begins anew in a given state. */
  restartFrom(qpos: ArrayLike<number>, qvel: ArrayLike<number>): void {
    this.simulation.setState(qpos, qvel);
    this.begin();
  }

  /** Walks one control step; a robot that falls begins anew with the same command. */
  step(listener?: Listener): Outcome {
    const { simulation, policy, seen, feet, command } = this;
    seen.ask(command, policy.action);
    const action = policy.act(seen);
    const { ctrl } = simulation;
    for (let joint = 0; joint < 12; joint++) {
      ctrl[joint] = Math.fround(
        (policy.defaultJointPos[joint] as number) +
          (policy.actionScale[joint] as number) * (action[joint] as number),
      );
    }
    simulation.step(policy.decimation, (now) => {
      feet.record(now);
      listener?.(now);
    });
    this.steps++;
    if (simulation.unstable) return this.again("unstable");
    seen.read(simulation, policy.defaultJointPos);
    feet.update(simulation);
    if (simulation.fallen) return this.again("fallen");
    this.meter.update(command, seen, feet, simulation);
    return "walking";
  }

  /** Returns the figures since the start. */
  gait(): Gait {
    return this.meter.gait();
  }

  /** Begins the figures anew, of a walk that goes on in another way. Falls stay counted. */
  measureAnew(): void {
    this.meter.forget();
  }

  private begin(): void {
    this.steps = 0;
    this.feet = this.newFeet();
    this.meter = this.newMeter();
    this.forget();
  }

  private again(outcome: Outcome): Outcome {
    this.meter.interrupt(outcome === "fallen");
    this.simulation.reset();
    this.forget();
    return outcome;
  }

  private forget(): void {
    this.policy.reset();
    this.feet.reset(this.simulation);
    this.seen.read(this.simulation, this.policy.defaultJointPos);
  }

  private newFeet(): Footfalls {
    return new Footfalls(this.page, this.simulation.timestep, this.policy.decimation);
  }

  private newMeter(): GaitMeter {
    return new GaitMeter(this.stepTime, this.page.settle_time);
  }
}
