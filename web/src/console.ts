/** What the page offers to the browser's console, and to tests: `mute`. */

import type { App } from "./app.js";
import {
  KeptReadings,
  measure,
  type Measured,
  type MeasuredWalk,
  type OfflineHearing,
} from "./control/measure.js";
import { levelsOf, renderSound } from "./control/rendered_sound.js";
import type { Loaded } from "./load.js";
import { Simulation } from "./physics/simulation.js";
import { Policy } from "./policy/policy.js";
import { OfflineSound } from "./sound/offline.js";
import { type SoundFiles, WORKLET } from "./sound_files.js";

export interface Console {
  readonly app: App;
  /** Walks as fast as the machine can, and measures walk and sound. */
  measure(walk: MeasuredWalk): Promise<Measured>;
  /** The same, the sound measured in the samples of the worklet. */
  measureWorklet(walk: MeasuredWalk): Promise<Measured>;
}

declare global {
  var mute: Console | undefined;
}

/** Makes it; measurements have a robot and a policy of their own. */
export function makeConsole(app: App, loaded: Loaded, sound: SoundFiles): Console {
  const walkAndHear = (
    walk: MeasuredWalk,
    hear: (surface: string, timestep: number) => OfflineHearing,
  ) => {
    const { mujoco, scenes, page, file } = loaded;
    const simulation = new Simulation(mujoco, scenes, page);
    const { timestep } = simulation;
    const policy = new Policy(file, { jointNames: page.joint_names, timestep });
    return measure(simulation, policy, page, (surface) => hear(surface, timestep), walk);
  };
  return {
    app,
    measure: async (walk) => {
      const tables = await sound();
      return walkAndHear(walk, (surface, timestep) => {
        return new OfflineSound(tables, { surface, timestep });
      });
    },
    measureWorklet: async (walk) => {
      const [tables, kept] = [await sound(), new KeptReadings()];
      let step = NaN;
      const measured = walkAndHear(walk, (_, timestep) => {
        step = timestep;
        return kept;
      });
      const samples = await renderSound(tables, WORKLET, walk.surface, step, kept.all);
      return { ...measured, ...levelsOf(samples, tables) };
    },
  };
}
