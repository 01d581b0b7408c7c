/** The page's simulation is Python's: the same states, figures and levels on the same ground. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { ReadingsBatcher } from "../src/control/hearing.js";
import { Walk } from "../src/control/walk.js";
import { contactFigures } from "../src/physics/page_data.js";
import { OfflineSound } from "../src/sound/offline.js";
import { FIGURES, page, type ReferenceWalk, walks } from "./files.js";
import { policy, simulation } from "./robot.js";
import { readTables } from "./sound/walks.js";

const tables = readTables();

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

  test(`the walk ${name} is where Python's is for 2 s, and has its figures over 20 s`, (context) => {
    const walk = begin(reference);
    const batcher = new ReadingsBatcher(simulation, policy.decimation, contactFigures(page));
    const { surface } = reference;
    const sound = new OfflineSound(tables, { surface, timestep: simulation.timestep });
    let worst = 0;
    for (let step = 0; step < Math.round(reference.seconds / walk.stepTime); step++) {
      assert.equal(walk.step(batcher.listen), "walking");
      sound.feed(batcher.take());
      if (step < reference.positions.length) {
        const kept = reference.positions[step] as number[];
        const off = kept.map((x, i) => Math.abs(x - (walk.simulation.qpos[i] as number)));
        worst = Math.max(worst, ...off);
      }
    }
    const gait = walk.gait() as unknown as Record<string, number>;
    const apart = FIGURES.map((figure) => Math.abs((gait[figure] as number) / (reference.gait[figure] as number) - 1));
    const furthest = apart.indexOf(Math.max(...apart));
    const louder = sound.mnl - reference.mnl;
    context.diagnostic(
      `${name}: positions within ${worst.toExponential(1)}, figures within ` +
        `${(100 * (apart[furthest] as number)).toFixed(2)} % (${FIGURES[furthest]}), MNL off by ${louder.toFixed(2)} dB`,
    );
    // Rounding of other processors may grow a hundredfold in this time.
    assert.ok(worst < 1e-3, `positions are off by ${worst}`);
    // On stairs it decides over what follows whether a foot just meets an edge or misses it.
    const tolerance = reference.terrain === "stairs" ? 0.1 : 0.03;
    FIGURES.forEach((figure, i) => {
      const both = `${figure} is ${gait[figure]}, in Python ${reference.gait[figure]}`;
      assert.ok((apart[i] as number) < tolerance, both);
    });
    assert.ok(Math.abs(louder) < 0.5, `MNL is ${sound.mnl} dBA, in Python ${reference.mnl}`);
  });
}
