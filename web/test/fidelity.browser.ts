/** The page in a real browser walks as Python does, keeps its rates, and begins soon. */

import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { LONG, Site } from "./browser.js";
import { FIGURES, walkOf, walks } from "./files.js";
import { CORES, coreTime, Machine } from "./machine.js";

let site: Site;
before(async () => {
  site = await Site.open();
});
after(async () => site.close());

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
      const off = Math.abs(measured.gait[figure] / (reference.gait[figure] as number) - 1);
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
  const { command, surface, terrain, level, first_state, mnl, pnl } = walkOf("loud");
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

/** What is asked of a desktop with two cores that has nothing else to do: s, Hz, a second. */
const SOONEST = 3;
const CONTROL = 49;
const PICTURES = 30;

/** Longest time of `coreTime` with which that is asked, s: of cores of 2 GHz or more. */
const SLOWEST_CORE = 0.15;

/** Visits of which the best one counts: whoever else works here does so in bursts. */
const VISITS = 3;

/** What a visit was like: s, Hz, a second, and what the machine was busy with. */
async function visitAndTime() {
  const machine = new Machine();
  const { page } = await site.visit();
  const begun = await page.evaluate(
    () => performance.getEntriesByName("interactive")[0]!.startTime / 1000,
  );
  const beginning = machine.busy();
  await page.waitForFunction(() => globalThis.mute!.app.rates.seconds > 2, null, LONG);
  const walking = new Machine();
  // Rates are of the last two seconds: some of these may be had to itself.
  const wanted = [CONTROL, PICTURES] as const;
  await page
    .waitForFunction(
      ([control, pictures]) => {
        const { rates } = globalThis.mute!.app;
        return rates.seconds > 5 && rates.control >= control && rates.pictures >= pictures;
      },
      wanted,
      { timeout: 12_000, polling: 250 },
    )
    .catch(() => undefined);
  const { control, pictures } = await page.evaluate(() => globalThis.mute!.app.rates);
  const busy = walking.busy();
  await page.context().close();
  console.log(
    `interactive after ${begun.toFixed(2)} s with ${beginning.free.toFixed(2)} of the machine; ` +
      `control ${control.toFixed(1)} Hz, ${pictures.toFixed(1)} pictures/s by ` +
      `${busy.own.toFixed(2)} cores with ${busy.free.toFixed(2)} of it`,
  );
  return { begun, beginning, control, pictures, busy };
}

/** Returns the cores that a page takes whose pictures nobody asks for: its physics, and the browser. */
async function unseen(): Promise<number> {
  const { page } = await site.visit();
  await page.evaluate(() => {
    globalThis.requestAnimationFrame = () => 0;
  });
  const walked = (seconds: number) =>
    page.waitForFunction((until) => globalThis.mute!.app.rates.seconds > until, seconds, {
      ...LONG,
      polling: 250,
    });
  await walked(2);
  const machine = new Machine();
  const { steps } = await page.evaluate(() => globalThis.mute!.app.rates);
  await walked(6);
  const after = await page.evaluate(() => globalThis.mute!.app.rates);
  const { own, seconds } = machine.busy();
  await page.context().close();
  // Of all steps of a second, also where the machine did not come to them.
  return (own * seconds * 50) / (after.steps - steps);
}

/*
 * Of a machine that others use, too, as much is asked as they leave of it: with half of the processor
 * time the page may take twice as long to begin, and draw half of the pictures. Of slow cores nothing
 * is asked, and what they do is printed alone.
 */
test("the page is interactive within 3 s, holds 50 Hz and draws 30 pictures a second", async () => {
  const core = coreTime();
  const isHeld = core <= SLOWEST_CORE;
  console.log(`a core takes ${core.toFixed(3)} s for the loop; what follows is ${isHeld ? "held" : "printed"}`);
  const visits: Awaited<ReturnType<typeof visitAndTime>>[] = [];
  const meets = {
    begun: () => visits.some(({ begun, beginning }) => begun * beginning.free <= SOONEST),
    control: () => visits.some(({ control, busy }) => control >= CONTROL * busy.free),
    pictures: () => visits.some(({ pictures, busy }) => pictures >= PICTURES * busy.free),
  };
  const missed = () => Object.entries(meets).flatMap(([name, met]) => (met() ? [] : [name]));
  do {
    visits.push(await visitAndTime());
  } while (missed().length && visits.length < VISITS);
  if (isHeld) assert.deepEqual(missed(), [], "of these too little was had in all visits, see above");
  // What that takes is told in processor time, which hangs little on what others do meanwhile.
  const without = await unseen();
  const costs = visits.map(({ pictures, busy }) => (busy.own - without) / pictures);
  const cores = without + PICTURES * Math.max(Math.min(...costs), 0);
  console.log(`30 pictures a second take ${cores.toFixed(2)} cores, none ${without.toFixed(2)}`);
  assert.ok(!isHeld || cores <= CORES, `30 pictures a second take ${cores} cores`);
});
