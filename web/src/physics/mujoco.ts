/** MuJoCo's WebAssembly module, and what its declarations leave open. */

import loadMujoco, { type MainModule, type MjData, type MjModel } from "@mujoco/mujoco";

export type { MainModule, MjData, MjModel };

/**
 * Loads the module.
 *
 * @param place Where `mujoco.wasm` is; by default beside the module.
 */
export function loadPhysics(place?: string): Promise<MainModule> {
  return loadMujoco(place === undefined ? {} : { locateFile: () => place });
}

/**
 * Compiles MJCF.
 *
 * @param pictured Whether to keep shapes that are only to be seen.
 * @throws Error If MuJoCo refuses it.
 */
export function compile(mujoco: MainModule, mjcf: string, pictured: boolean): MjModel {
  const text = pictured ? mjcf : mjcf.replace("<compiler ", '<compiler discardvisual="true" ');
  return mujoco.MjModel.from_xml_string(text);
}

/** Returns the index of something by its name. */
export function idOf(mujoco: MainModule, model: MjModel, kind: Kind, name: string): number {
  const type = {
    geom: mujoco.mjtObj.mjOBJ_GEOM,
    sensor: mujoco.mjtObj.mjOBJ_SENSOR,
    site: mujoco.mjtObj.mjOBJ_SITE,
    actuator: mujoco.mjtObj.mjOBJ_ACTUATOR,
    body: mujoco.mjtObj.mjOBJ_BODY,
  }[kind];
  const id = mujoco.mj_name2id(model, type.value, name);
  if (id < 0) throw new Error(`the scene has no ${kind} ${name}`);
  return id;
}

type Kind = "geom" | "sensor" | "site" | "actuator" | "body";
