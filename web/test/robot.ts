/** The simulation and the policy that ships, for tests in node. */

import { loadPhysics } from "../src/physics/mujoco.js";
import { Simulation } from "../src/physics/simulation.js";
import { Policy } from "../src/policy/policy.js";
import { asset, page, textOf } from "./files.js";

const scenes = { flat: textOf(asset("flat.xml")), stairs: textOf(asset("stairs.xml")) };

const mujoco = await loadPhysics();

/** Returns a simulation of one's own. */
export function makeSimulation(): Simulation {
  return new Simulation(mujoco, scenes, page);
}

/** One that is shared. */
export const simulation = makeSimulation();
export const policy = new Policy(asset("go1_mute.onnx"), {
  jointNames: page.joint_names,
  timestep: simulation.timestep,
});
