/** Begins the page: loads what it needs at once, and says plainly what is missing. */

import { App } from "./app.js";
import { measure, type Measured, type MeasuredWalk } from "./control/measure.js";
import { loadPhysics } from "./physics/mujoco.js";
import { type PageData, readPageData } from "./physics/page_data.js";
import { Simulation } from "./physics/simulation.js";
import { Picture } from "./picture/picture.js";
import { Policy } from "./policy/policy.js";
import { fromAddress } from "./settings/settings.js";
import { hearingStarter, MeasuredSound, soundFiles } from "./sound_files.js";
import { anyElement, canvas } from "./ui/elements.js";
import { Panel } from "./ui/panel.js";

declare global {
  /** For the console of the browser, and for tests. */
  var mute: { app: App; measure(walk: MeasuredWalk): Promise<Measured> } | undefined;
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
  let shown: Panel | undefined;
  const app = new App({
    page,
    simulation,
    loadPolicy: loadBytes,
    first: new Policy(file, robot),
    settings,
    picture,
    panel: (actions) => (shown = new Panel(page, actions)),
    startHearing: hearingStarter(sound),
  });
  shown?.ready(why);
  if (faults.length) app.tellFaults(faults);
  else shown?.tell(welcome(page));
  app.run();
  performance.mark("interactive");
  globalThis.mute = {
    app,
    measure: async (walk) => {
      const tables = await sound();
      const own = new Simulation(mujoco, scenes, page);
      const hear = (surface: string) => new MeasuredSound(tables, surface, own.timestep);
      return measure(own, new Policy(file, robot), page, hear, walk);
    },
  };
}

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
