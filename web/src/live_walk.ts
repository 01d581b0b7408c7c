/** The walk that is seen and heard: robot, picture and sound, which change and begin anew together. */

import type { SoundSwitch } from "./control/sound_switch.js";
import { type Outcome, Walk } from "./control/walk.js";
import type { Command, PageData } from "./physics/page_data.js";
import type { Ground, Simulation } from "./physics/simulation.js";
import type { Picture } from "./picture/picture.js";
import type { Policy } from "./policy/policy.js";

/** Speed that a push adds to the trunk, to one side and the other in turn, m/s. */
export const PUSH = 1;

export class LiveWalk {
  private readonly walk: Walk;
  private pushes = 0;

  /**
   * @param simulation The robot, on the ground that it begins on.
   * @param policy What drives it at first.
   * @param page Limits and times.
   * @param picture Where it is seen, if anywhere.
   * @param sound Where it is heard.
   */
  constructor(
    private readonly simulation: Simulation,
    private policy: Policy,
    page: PageData,
    private readonly picture: Picture | null,
    readonly sound: SoundSwitch,
  ) {
    this.walk = new Walk(simulation, policy, page, page.command.start);
    picture?.paint(simulation.floor.colour);
    picture?.lookAhead(simulation);
    picture?.jump(simulation);
  }

  /** Control period, s. */
  get stepTime(): number {
    return this.walk.stepTime;
  }

  /** Time walked since it began, s. */
  get seconds(): number {
    return this.walk.seconds;
  }

  /** Its figures. */
  get gait() {
    return this.walk.gait();
  }

  /** Where the trunk is, m. */
  get position(): number[] {
    return Array.from(this.simulation.qpos.subarray(0, 3));
  }

  /** Walks a control step. */
  step(command: Command): Outcome {
    const { walk, sound, picture, simulation } = this;
    walk.command = command;
    const outcome = walk.step(sound.listener);
    // What is no number would stay in the sound and in its levels.
    if (outcome !== "unstable") sound.feed();
    if (outcome === "walking") {
      picture?.keep(simulation);
    } else {
      sound.leaveOut();
      picture?.jump(simulation);
    }
    return outcome;
  }

  draw(share: number, seconds: number): void {
    this.picture?.draw(share, this.simulation, seconds);
  }

  /** Begins anew: robot, figures and levels. */
  begin(): void {
    this.walk.restart();
    this.sound.restart(this.policy.decimation);
    this.picture?.jump(this.simulation);
  }

  /** Begins figures and levels anew of a robot that walks on, as it is asked for something else. */
  measureAnew(): void {
    this.walk.measureAnew();
    this.sound.measureAnew();
  }

  /** Lets another policy drive. */
  use(policy: Policy): void {
    this.policy = policy;
    this.walk.drive(policy);
    this.begin();
  }

  setFloor(name: string): void {
    const { simulation } = this;
    simulation.setFloor(name);
    this.sound.changeFloor();
    this.measureAnew();
    this.picture?.paint(simulation.floor.colour);
  }

  setGround(ground: Ground, level: number): void {
    this.simulation.setGround(ground, level);
    this.picture?.lookAhead(this.simulation);
    this.begin();
  }

  /** Pushes the robot from beside, whichever way it looks; returns where to. */
  push(): "left" | "right" {
    const [w = 1, , , z = 0] = this.simulation.qpos.subarray(3, 7);
    const heading = 2 * Math.atan2(z, w);
    const isLeft = this.pushes++ % 2 === 0;
    const speed = isLeft ? PUSH : -PUSH;
    this.simulation.push(-speed * Math.sin(heading), speed * Math.cos(heading));
    return isLeft ? "left" : "right";
  }
}
