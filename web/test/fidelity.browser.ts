/** The page in a real browser walks as Python does, keeps its rates, and begins soon. */

import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { LONG, Site } from "./browser.js";
import { walks } from "./files.js";

let site: Site;
before(async () => (site = await Site.open()));
after(async () => site.close());

const FIGURES = [
  "speed",
  "landing_speed_mean",
  "landing_speed_rms",
  "apex_mean",
  "duty_factor",
  "stride_frequency",
  "power",
] as const;

// What a walk on stairs becomes hangs on whether a foot just meets an edge: it is tried in node.
const flat = Object.entries(walks).filter(([, { terrain }]) => terrain === "flat");

for (const [name, reference] of flat) {
  test(`the walk ${name} has Python's figures over 20 s`, async () => {
    const { page, errors } = await site.visit();
    const { command, seconds, surface, terrain, level, first_state } = reference;
    page.setDefaultTimeout(LONG.timeout);
    const measured = await page.evaluate((walk) => globalThis.mute!.measure(walk), {
      command,
      seconds,
      surface,
      terrain,
      level,
      first_state,
    });
    for (const figure of FIGURES) {
      const off = Math.abs(measured.gait[figure] / reference.gait[figure] - 1);
      assert.ok(
        off < 0.03,
        `${figure} is ${measured.gait[figure]}, in Python ${reference.gait[figure]}`,
      );
    }
    console.log(`${name}: MNL ${measured.mnl} dBA, in Python ${reference.mnl}`);
    assert.ok(Math.abs(measured.mnl - reference.mnl) < 0.5, `MNL is ${measured.mnl} dBA`);
    assert.ok(Math.abs(measured.pnl - reference.pnl) < 1, `PNL is ${measured.pnl} dBA`);
    assert.deepEqual(errors, []);
    await page.context().close();
  });
}

test("the worklet's own samples have Python's level", async () => {
  const { page, errors } = await site.visit();
  const { command, surface, terrain, level, first_state, mnl, pnl } = walks.loud;
  page.setDefaultTimeout(LONG.timeout);
  const measured = await page.evaluate((walk) => globalThis.mute!.measureWorklet(walk), {
    command,
    seconds: 20,
    surface,
    terrain,
    level,
    first_state,
  });
  console.log(`worklet: MNL ${measured.mnl} dBA, PNL ${measured.pnl}, in Python ${mnl} and ${pnl}`);
  assert.ok(Math.abs(measured.mnl - mnl) < 0.5, `MNL is ${measured.mnl} dBA`);
  assert.ok(Math.abs(measured.pnl - pnl) < 1, `PNL is ${measured.pnl} dBA`);
  assert.deepEqual(errors, []);
  await page.context().close();
});

test("control keeps 50 Hz, and pictures come", async () => {
  const { page } = await site.visit();
  const begun = await page.evaluate(() => performance.getEntriesByName("interactive")[0].startTime);
  await page.waitForFunction(() => globalThis.mute!.app.rates.seconds > 8, null, LONG);
  const { control, pictures } = await page.evaluate(() => globalThis.mute!.app.rates);
  console.log(
    `interactive after ${(begun / 1000).toFixed(2)} s, control ${control.toFixed(1)} Hz, ` +
      `pictures ${pictures.toFixed(1)}/s`,
  );
  // Of 50 and 30, on a machine that has nothing else to do; others may be busy.
  assert.ok(control > 40, `control is at ${control} Hz`);
  assert.ok(pictures > 5, `there are ${pictures} pictures a second`);
  await page.context().close();
});
