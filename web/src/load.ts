/** What the page needs before it can begin, loaded all at once. */

import { loadPhysics, type MainModule } from "./physics/mujoco.js";
import { type PageData, readPageData } from "./physics/page_data.js";
import type { Ground } from "./physics/simulation.js";
import { fromAddress, type Settings } from "./settings/settings.js";

export interface Loaded {
  readonly page: PageData;
  readonly mujoco: MainModule;
  /** MJCF of each ground. */
  readonly scenes: Readonly<Record<Ground, string>>;
  readonly settings: Settings;
  /** What is wrong with the address. */
  readonly faults: readonly string[];
  /** The controller that drives at first. */
  readonly file: Uint8Array;
}

/**
 * Loads it.
 *
 * @throws Error That says in a line what is missing.
 */
export async function load(): Promise<Loaded> {
  if (typeof WebAssembly !== "object") {
    throw new Error("this browser has no WebAssembly, in which the robot is simulated");
  }
  const data = fetchFile("page.json").then(async (file) => readPageData(await file.json()));
  const asked = data.then((page) => fromAddress(window.location.hash, page));
  const first = Promise.all([data, asked]).then(([{ controllers }, { settings }]) =>
    loadBytes(fileOf(controllers, settings.controller)),
  );
  const [mujoco, page, { settings, faults }, file, flat, stairs] = await Promise.all([
    loadPhysics("mujoco.wasm"),
    data,
    asked,
    first,
    loadText("flat.xml"),
    loadText("stairs.xml"),
  ]);
  return { page, mujoco, scenes: { flat, stairs }, settings, faults, file };
}

/** Returns the file of a controller. */
export function fileOf(controllers: PageData["controllers"], wanted: string): string {
  const found = controllers.find(({ name }) => name === wanted) ?? controllers[0];
  if (!found) throw new Error("page.json names no controller");
  return found.file;
}

/** Loads a file of the page as bytes. */
export async function loadBytes(name: string): Promise<Uint8Array> {
  return new Uint8Array(await (await fetchFile(name)).arrayBuffer());
}

async function loadText(name: string): Promise<string> {
  return (await fetchFile(name)).text();
}

/**
 * Asks for a file of the page.
 *
 * @throws Error If the server has none.
 */
export async function fetchFile(name: string): Promise<Response> {
  const answer = await fetch(name);
  if (!answer.ok) throw new Error(`${name} cannot be loaded (${answer.status})`);
  return answer;
}
