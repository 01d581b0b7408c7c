/** Robots that fall or blow up begin anew, and what they do until they walk again is no figure. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { ReadingsBatcher } from "../src/control/hearing.js";
import type { SoundSwitch } from "../src/control/sound_switch.js";
import { KeptReadings, measure } from "../src/control/measure.js";
import { Walk } from "../src/control/walk.js";
import { LiveWalk } from "../src/live_walk.js";
import { contactFigures } from "../src/physics/page_data.js";
import type { Simulation } from "../src/physics/simulation.js";
import { OfflineSound } from "../src/sound/offline.js";
import { Playback } from "../src/sound/playback.js";
import { page } from "./files.js";
import { makeSimulation, policy, simulation } from "./robot.js";
import { readTables } from "./sound/walks.js";

const tables = readTables();

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

/** Robots that blow up, each in its own way: what is written into them. */
const BLOWN: readonly (readonly [what: string, blow: (robot: Simulation) => void])[] = [
  ["a speed that is none", ({ qvel }) => (qvel[0] = NaN)],
  ["a speed of 1e11 m/s", ({ qvel }) => (qvel[0] = 1e11)],
  ["a joint at 1e5 rad/s", ({ qvel }) => (qvel[9] = 1e5)],
  ["a place that is none", ({ qpos }) => (qpos[0] = NaN)],
  ["a place at 1e12 m", ({ qpos }) => (qpos[0] = 1e12)],
];

for (const [what, blow] of BLOWN) {
  test(`${what} is told as a blow-up, is not heard, and the robot walks on`, () => {
    const batcher = new ReadingsBatcher(simulation, policy.decimation, contactFigures(page));
    const playback = new Playback(tables, { surface: page.surface, sampleRate: tables.sample_rate });
    const samples = new Float32Array(Math.round(0.02 * tables.sample_rate));
    const sound = {
      listener: batcher.listen,
      feed: () => playback.feed(batcher.take()),
      leaveOut: () => {
        batcher.restart(simulation);
        playback.leaveOut();
      },
    };
    const live = new LiveWalk(simulation, policy, page, null, sound as unknown as SoundSwitch);
    const go = (steps: number) => {
      for (let step = 0; step < steps; step++) {
        assert.equal(live.step(page.command.start), "walking");
        playback.play(samples);
      }
    };
    go(100);
    const before = playback.meter.pnl;
    assert.ok(before > 50 && before < 90, `it was heard at ${before} dBA`);
    blow(simulation);
    assert.equal(live.step(page.command.start), "unstable");
    playback.play(samples);
    go(100);
    const { pnl } = playback.meter;
    assert.ok(pnl < before + 1, `${pnl} dBA, before ${before}`);
    assert.ok(simulation.qpos.every(Number.isFinite));
  });
}

test("a measurement has nothing of a blow-up in its levels either", () => {
  simulation.reset();
  const spun = Array.from(simulation.qvel, (speed, axis) => (axis === 9 ? 1e5 : speed));
  const { pnl, mnl } = measure(
    makeSimulation(),
    policy,
    page,
    (surface) => new OfflineSound(tables, { surface, timestep: simulation.timestep }),
    {
      command: page.command.start,
      seconds: 3,
      surface: page.surface,
      terrain: "flat",
      level: 0,
      first_state: { qpos: Array.from(simulation.qpos), qvel: spun },
    },
  );
  assert.ok(mnl > 50 && pnl < 90, `MNL ${mnl} dBA, PNL ${pnl}`);
});

test("a measurement that fails leaves no robot behind", () => {
  const robot = makeSimulation();
  let deleted = 0;
  const free = robot.delete.bind(robot);
  robot.delete = () => {
    deleted++;
    free();
  };
  const walk = { command: page.command.start, seconds: 1, terrain: "flat", level: 0 } as const;
  const lava = () =>
    measure(robot, policy, page, () => new KeptReadings(), { ...walk, surface: "lava" });
  assert.throws(lava, /there is no floor lava/);
  assert.equal(deleted, 1);
});
