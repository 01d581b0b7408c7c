/** What the page asks of its sound, and the batches of readings that it gives it. */

import { READINGS_LENGTH, viewReadings } from "../sound/readings.js";
import { type ContactFigures, Recorder } from "../sound/recorder.js";
import type { Simulation } from "../physics/simulation.js";

/** Levels in dBA; NaN before there is one. */
export interface Levels {
  /** A-weighted and Fast, now. */
  readonly level: number;
  /** Mean noise level of the walk. */
  readonly mnl: number;
  /** Peak noise level of the walk. */
  readonly pnl: number;
  /** Time that both are over, s. */
  readonly seconds: number;
}

/** Makes sound of batches, and measures it. */
export interface Hearing {
  /** Takes in some physics steps; the array is given away. */
  feed(batch: Float32Array): void;
  setSurface(name: string): void;
  /** The walk begins anew. */
  reset(): void;
  /** The walk goes on in another way: its figures begin anew. */
  measureAnew(): void;
  /** The robot fell, and begins anew. */
  leaveOut(): void;
  suspend(): Promise<void>;
  resume(): Promise<void>;
  /** Ends for good. */
  close(): void;
  onLevels: ((levels: Levels) => void) | null;
  /** Is told why it ended by itself. */
  onEnd: ((why: string) => void) | null;
}

/** Fills batches from a simulation, physics step by physics step. */
export class ReadingsBatcher {
  private readonly recorder: Recorder;
  private batch: Float32Array;
  private at = 0;

  /**
   * @param simulation What is heard.
   * @param steps Physics steps of a batch: those of a control step.
   * @param contacts What contacts are told by.
   */
  constructor(
    simulation: Simulation,
    private readonly steps: number,
    contacts: ContactFigures,
  ) {
    this.recorder = new Recorder(simulation.timestep, simulation.floor.friction, contacts);
    this.batch = new Float32Array(steps * READINGS_LENGTH);
  }

  /** Takes note that the robot begins anew. */
  restart(simulation: Simulation): void {
    this.recorder.restart();
    this.recorder.friction = simulation.floor.friction;
    this.at = 0;
  }

  /** Takes note of another floor. */
  setFriction(friction: number): void {
    this.recorder.friction = friction;
  }

  /** Takes in a physics step that was just made. */
  listen = (simulation: Simulation): void => {
    if (this.at >= this.steps) return;
    const into = viewReadings(this.batch, this.at++);
    this.recorder.record(simulation.feet, simulation.effectiveMass, into);
    const { qpos, qvel, torque } = simulation;
    into.jointPosition.set(qpos.subarray(7, 19));
    into.jointVelocity.set(qvel.subarray(6, 18));
    into.jointTorque.set(torque);
    into.trunkPosition.set(qpos.subarray(0, 3));
    into.trunkQuaternion.set(qpos.subarray(3, 7));
  };

  /** Returns the steps since the last call, to be kept by the caller. */
  take(): Float32Array {
    const taken = this.batch.subarray(0, this.at * READINGS_LENGTH);
    this.batch = new Float32Array(this.batch.length);
    this.at = 0;
    return taken;
  }
}
