/** Begins the page, and says plainly what is missing. */

import { App } from "./app.js";
import { makeConsole } from "./console.js";
import { fetchFile, fileOf, load, loadBytes, type Loaded } from "./load.js";
import { Simulation } from "./physics/simulation.js";
import { hasWebgl, Picture } from "./picture/picture.js";
import { PolicyShelf } from "./policy/shelf.js";
import { hearingStarter, soundFiles } from "./sound_files.js";
import { messageOf } from "./support/messages.js";
import { anyElement, canvas } from "./ui/elements.js";
import { Panel } from "./ui/panel.js";

const NO_SOUND =
  "There is no sound in this browser, or not here: audio worklets need https or localhost.";

const LOST =
  "The picture is lost: the browser gave WebGL up. The robot walks unseen; reload the page to see it.";

async function begin(): Promise<void> {
  const loaded = await load();
  const { page, mujoco, scenes, settings, faults } = loaded;
  const simulation = new Simulation(mujoco, scenes, page);
  const shelf = makeShelf(loaded, simulation.timestep);
  const sound = soundFiles(fetchFile);
  const startHearing = hearingStarter(sound, simulation.timestep, page.sample_rate);
  const [picture, why] = makePicture(() => new Picture(canvas("view"), mujoco, scenes.flat));
  const first = await shelf.get(settings.controller);
  const panel = new Panel(page);
  const app = new App({ page, simulation, shelf, first, settings, picture, panel, startHearing });
  panel.ready(why);
  if (picture) tellOfLoss(panel);
  if (!startHearing) panel.showNoSound();
  if (faults.length) panel.tellFaults(faults);
  else panel.tell(startHearing ? welcome(settings.floor) : NO_SOUND);
  app.run();
  performance.mark("interactive");
  globalThis.mute = makeConsole(app, loaded, sound);
}

/** Returns the page's policies, of which the first to drive is loaded already. */
function makeShelf({ page, settings, file }: Loaded, timestep: number): PolicyShelf {
  const robot = { jointNames: page.joint_names, timestep };
  const first = fileOf(page.controllers, settings.controller);
  return new PolicyShelf(page.controllers, robot, async (name) =>
    name === first ? file : loadBytes(name),
  );
}

/** Returns the picture, or why there is none: the robot can be steered and heard without. */
function makePicture(make: () => Picture): [Picture | null, string] {
  try {
    return [make(), ""];
  } catch (error) {
    const why = hasWebgl() ? messageOf(error) : "WebGL is missing";
    return [null, `There is no picture: ${why}. The robot walks unseen.`];
  }
}

/** Tells where the graphics card, or the browser, gives the picture up, and shows it once it is back. */
function tellOfLoss(panel: Panel): void {
  const view = canvas("view");
  view.addEventListener("webglcontextlost", () => panel.ready(LOST));
  view.addEventListener("webglcontextrestored", () => panel.ready());
}

function welcome(floor: string): string {
  return `It walks on ${floor}. Turn β, drive with the keys, and switch the sound on.`;
}

begin().catch((error: unknown) => {
  const loading = anyElement("loading");
  loading.hidden = false;
  loading.textContent = `The page cannot begin: ${messageOf(error)}.`;
  anyElement("note").textContent = loading.textContent;
});
