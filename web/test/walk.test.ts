/** The page's simulation is Python's: the same states, the same figures, the same ground. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { Walk } from "../src/control/walk.js";
import { loadPhysics } from "../src/physics/mujoco.js";
import { Simulation } from "../src/physics/simulation.js";
import { Policy } from "../src/policy/policy.js";
import { asset, page, type ReferenceWalk, textOf, walks } from "./files.js";

const mujoco = await loadPhysics();
const scenes = { flat: textOf(asset("flat.xml")), stairs: textOf(asset("stairs.xml")) };
const simulation = new Simulation(mujoco, scenes, page);
const policy = new Policy(asset("go1_mute.onnx"), {
  jointNames: page.joint_names,
  timestep: simulation.timestep,
});

function begin(reference: ReferenceWalk): Walk {
  simulation.setFloor(reference.surface);
  simulation.setGround(reference.terrain, reference.level);
  const walk = new Walk(simulation, policy, page, reference.command);
  walk.restartFrom(reference.first_state.qpos, reference.first_state.qvel);
  return walk;
}

for (const [name, reference] of Object.entries(walks)) {
  test(`the walk ${name} begins in Python's state`, () => {
    const walk = begin(reference);
    walk.restart();
    walk.simulation.qpos.forEach((value, i) => {
      assert.ok(Math.abs(value - (reference.first_state.qpos[i] as number)) < 1e-6, `qpos ${i} is ${value}`);
    });
  });

  test(`the walk ${name} is where Python's is for 2 s, and has its figures over 20 s`, () => {
    const walk = begin(reference);
    let worst = 0;
    for (let step = 0; step < Math.round(reference.seconds / walk.stepTime); step++) {
      assert.equal(walk.step(), "walking");
      if (step < reference.positions.length) {
        const kept = reference.positions[step] as number[];
        const off = kept.map((x, i) => Math.abs(x - (walk.simulation.qpos[i] as number)));
        worst = Math.max(worst, ...off);
      }
    }
    // On stairs it decides over what follows whether a foot just meets an edge or misses it.
    const tolerance = reference.terrain === "stairs" ? 0.1 : 0.03;
    const gait = walk.gait() as unknown as Record<string, number>;
    // Rounding of other processors may grow a hundredfold in this time.
    assert.ok(worst < 1e-3, `positions are off by ${worst}`);
    for (const figure of [
      "speed",
      "landing_speed_mean",
      "landing_speed_rms",
      "apex_mean",
      "duty_factor",
      "stride_frequency",
      "power",
    ]) {
      const off = Math.abs((gait[figure] as number) / (reference.gait[figure] as number) - 1);
      assert.ok(off < tolerance, `${figure} is ${gait[figure]}, in Python ${reference.gait[figure]}`);
    }
  });
}
