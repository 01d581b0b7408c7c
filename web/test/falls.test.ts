/** Robots that fall or blow up begin anew, and what they do until they walk again is no figure. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { Walk } from "../src/control/walk.js";
import { loadPhysics } from "../src/physics/mujoco.js";
import { Simulation } from "../src/physics/simulation.js";
import { Policy } from "../src/policy/policy.js";
import { asset, page, textOf } from "./files.js";

const mujoco = await loadPhysics();
const scenes = { flat: textOf(asset("flat.xml")), stairs: textOf(asset("stairs.xml")) };
const simulation = new Simulation(mujoco, scenes, page);
const policy = new Policy(asset("go1_mute.onnx"), {
  jointNames: page.joint_names,
  timestep: simulation.timestep,
});

test("a robot that falls or blows up begins anew, and is in no figure until it walks again", () => {
  // Upwards at a speed that no robot has, or into a roll that no leg holds up.
  const ends = [
    [2, 1000, "unstable", 0],
    [3, -40, "fallen", 1],
  ] as const;
  for (const [axis, speed, outcome, falls] of ends) {
    const walk = new Walk(simulation, policy, page, page.command.start);
    for (let step = 0; step < 80; step++) walk.step();
    const { speed: before, power } = walk.gait();
    assert.ok(before > 0.3);
    walk.simulation.qvel[axis] = speed;
    let ended = walk.step();
    for (let step = 0; ended === "walking" && step < 50; step++) ended = walk.step();
    assert.equal(ended, outcome);
    const kept = walk.gait();
    assert.equal(kept.falls, falls);
    if (outcome === "unstable") assert.deepEqual([kept.speed, kept.power], [before, power]);
    for (let step = 0; step < Math.round(page.settle_time / walk.stepTime); step++) walk.step();
    assert.deepEqual(walk.gait(), kept);
    walk.step();
    assert.notDeepEqual(walk.gait(), kept);
    walk.measureAnew();
    assert.equal(walk.gait().falls, falls);
    assert.ok(Number.isNaN(walk.gait().speed));
  }
});
