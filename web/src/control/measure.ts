/** A walk as fast as the machine can, and its figures: for tests, and for whoever is curious. */

import { type Command, contactFigures, type PageData } from "../physics/page_data.js";
import type { Ground, Simulation } from "../physics/simulation.js";
import type { Policy } from "../policy/policy.js";
import type { Gait } from "./gait_meter.js";
import { ReadingsBatcher } from "./hearing.js";
import { Walk } from "./walk.js";

/** What is walked. */
export interface MeasuredWalk {
  readonly command: Command;
  readonly seconds: number;
  readonly surface: string;
  readonly terrain: Ground;
  readonly level: number;
  /** Where it begins; in the stance unless given. */
  readonly first_state?: { readonly qpos: readonly number[]; readonly qvel: readonly number[] };
}

/** What it was like. */
export interface Measured {
  readonly gait: Gait;
  /** Mean and peak noise level, dBA. */
  readonly mnl: number;
  readonly pnl: number;
  /** Generalised positions at the end. */
  readonly qpos: readonly number[];
}

/** Hears a walk without a loudspeaker. */
export interface OfflineHearing {
  feed(batch: Float32Array): void;
  /** The robot fell, and begins anew. */
  leaveOut(): void;
  readonly mnl: number;
  readonly pnl: number;
}

/** Keeps what there is to be heard of a walk. */
export class KeptReadings implements OfflineHearing {
  readonly mnl = NaN;
  readonly pnl = NaN;
  private readonly batches: Float32Array[] = [];

  feed(batch: Float32Array): void {
    this.batches.push(batch);
  }

  leaveOut(): void {}

  /** All physics steps, one after the other. */
  get all(): Float32Array {
    const all = new Float32Array(this.batches.reduce((sum, { length }) => sum + length, 0));
    let at = 0;
    for (const batch of this.batches) {
      all.set(batch, at);
      at += batch.length;
    }
    return all;
  }
}

/**
 * Walks and measures.
 *
 * @param simulation A robot of the measurement's own, which is deleted afterwards.
 * @param policy What drives it, likewise its own.
 * @param page Limits and times.
 * @param hear Makes what hears it, on a floor.
 * @param walk What is walked.
 */
export function measure(
  simulation: Simulation,
  policy: Policy,
  page: PageData,
  hear: (surface: string) => OfflineHearing,
  walk: MeasuredWalk,
): Measured {
  try {
    return walked(simulation, policy, page, hear, walk);
  } finally {
    simulation.delete();
  }
}

function walked(...[simulation, policy, page, hear, walk]: Parameters<typeof measure>): Measured {
  simulation.setFloor(walk.surface);
  simulation.setGround(walk.terrain, walk.level);
  const robot = new Walk(simulation, policy, page, walk.command);
  if (walk.first_state) robot.restartFrom(walk.first_state.qpos, walk.first_state.qvel);
  const batcher = new ReadingsBatcher(simulation, policy.decimation, contactFigures(page));
  const hearing = hear(walk.surface);
  const steps = Math.round(walk.seconds / robot.stepTime);
  for (let step = 0; step < steps; step++) {
    const outcome = robot.step(batcher.listen);
    if (outcome !== "unstable") hearing.feed(batcher.take());
    if (outcome === "walking") continue;
    batcher.restart(simulation);
    hearing.leaveOut();
  }
  const qpos = Array.from(simulation.qpos);
  return { gait: robot.gait(), mnl: hearing.mnl, pnl: hearing.pnl, qpos };
}
