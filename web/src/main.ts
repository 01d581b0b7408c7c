/** Begins the page: loads what it needs at once, and says plainly what is missing. */

import { App } from "./app.js";
import {
  KeptReadings,
  measure,
  type Measured,
  type MeasuredWalk,
  type OfflineHearing,
} from "./control/measure.js";
import { levelsOf, renderSound } from "./control/rendered_sound.js";
import { loadPhysics } from "./physics/mujoco.js";
import { type PageData, readPageData } from "./physics/page_data.js";
import { Simulation } from "./physics/simulation.js";
import { Picture } from "./picture/picture.js";
import { Policy } from "./policy/policy.js";
import { fromAddress } from "./settings/settings.js";
import { OfflineSound } from "./sound/offline.js";
import { hearingStarter, soundFiles, WORKLET } from "./sound_files.js";
import { anyElement, canvas } from "./ui/elements.js";
import { Panel } from "./ui/panel.js";

declare global {
  /** For the console of the browser, and for tests. */
  var mute:
    | {
        app: App;
        /** Walks as fast as the machine can, and measures walk and sound. */
        measure(walk: MeasuredWalk): Promise<Measured>;
        /** The same, the sound measured in the samples of the worklet. */
        measureWorklet(walk: MeasuredWalk): Promise<Measured>;
      }
    | undefined;
}

async function begin(): Promise<void> {
  if (typeof WebAssembly !== "object") {
    throw new Error("this browser has no WebAssembly, in which the robot is simulated");
  }
  const physics = loadPhysics("mujoco.wasm");
  const [page, flat, stairs] = await Promise.all([
    fetchFile("page.json").then(async (file) => readPageData(await file.json())),
    fetchFile("flat.xml").then((file) => file.text()),
    fetchFile("stairs.xml").then((file) => file.text()),
  ]);
  const { settings, faults } = fromAddress(window.location.hash, page);
  const sound = soundFiles(fetchFile);
  const entry = page.controllers.find(({ name }) => name === settings.controller);
  const file = await loadBytes((entry ?? page.controllers[0]).file);
  const mujoco = await physics;
  const scenes = { flat, stairs };
  const simulation = new Simulation(mujoco, scenes, page);
  const robot = { jointNames: page.joint_names, timestep: simulation.timestep };
  const [picture, why] = makePicture(() => new Picture(canvas("view"), mujoco, flat));
  const startHearing = hearingStarter(sound, simulation.timestep);
  let shown: Panel | undefined;
  const app = new App({
    page,
    simulation,
    loadPolicy: loadBytes,
    first: new Policy(file, robot),
    settings,
    picture,
    panel: (actions) => (shown = new Panel(page, actions)),
    startHearing,
  });
  shown?.ready(why);
  if (faults.length) app.tellFaults(faults);
  else shown?.tell(startHearing ? welcome(page) : NO_SOUND);
  app.run();
  performance.mark("interactive");
  const walkAndHear = (walk: MeasuredWalk, hear: (surface: string) => OfflineHearing) =>
    measure(new Simulation(mujoco, scenes, page), new Policy(file, robot), page, hear, walk);
  const { timestep } = simulation;
  globalThis.mute = {
    app,
    measure: async (walk) => {
      const tables = await sound();
      return walkAndHear(walk, (surface) => new OfflineSound(tables, { surface, timestep }));
    },
    measureWorklet: async (walk) => {
      const [tables, kept] = [await sound(), new KeptReadings()];
      const measured = walkAndHear(walk, () => kept);
      const samples = await renderSound(tables, WORKLET, walk.surface, timestep, kept.all);
      return { ...measured, ...levelsOf(samples, tables) };
    },
  };
}

const NO_SOUND =
  "There is no sound in this browser, or not here: audio worklets need https or localhost.";

function welcome(page: PageData): string {
  return `It walks on ${page.surface}. Turn β, drive with the keys, and switch the sound on.`;
}

/** Returns the picture, or why there is none: the robot can be steered and heard without. */
function makePicture(make: () => Picture): [Picture | null, string] {
  try {
    return [make(), ""];
  } catch {
    return [null, "This browser shows no 3D pictures (WebGL is missing). The robot walks unseen."];
  }
}

async function loadBytes(name: string): Promise<Uint8Array> {
  return new Uint8Array(await (await fetchFile(name)).arrayBuffer());
}

async function fetchFile(name: string): Promise<Response> {
  const answer = await fetch(name);
  if (!answer.ok) throw new Error(`${name} cannot be loaded (${answer.status})`);
  return answer;
}

begin().catch((error: unknown) => {
  const line = error instanceof Error ? error.message : String(error);
  const loading = anyElement("loading");
  loading.hidden = false;
  loading.textContent = `The page cannot begin: ${line}.`;
  anyElement("note").textContent = loading.textContent;
});
