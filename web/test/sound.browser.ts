/** Sound: taps and clicks, levels of what the robot does now, comparisons, hidden tabs. */

import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import type { Page } from "playwright-core";

import { LONG, Site } from "./browser.js";
import { hide, leave, stateOf } from "./page.js";

let site: Site;
before(async () => {
  site = await Site.open();
});
after(async () => site.close());

/** Waits until the meter shows a mean level, and returns all. */
async function levelsOf(page: Page) {
  await page.waitForFunction(() => globalThis.mute!.app.state.levels.mnl > 0, null, LONG);
  return page.evaluate(() => globalThis.mute!.app.state.levels);
}

/** The same once the mean is one over some strides, and not of the first reading. */
async function meanOf(page: Page) {
  await page.waitForFunction(() => globalThis.mute!.app.state.levels.seconds > 2, null, LONG);
  return levelsOf(page);
}

/** Sets a control, or clicks it, and returns the state at once: a moment later levels come again. */
const work = (page: Page, id: string, value?: string) =>
  page.evaluate(
    ([own, wanted]) => {
      const control = document.getElementById(own)!;
      if (wanted === undefined) control.click();
      else {
        Object.assign(control, { value: wanted });
        const type = control instanceof HTMLSelectElement ? "change" : "input";
        control.dispatchEvent(new Event(type, { bubbles: true }));
      }
      return globalThis.mute!.app.state;
    },
    [id, value] as const,
  );

/** Keeps an eye on what the page does with audio: contexts, and in which event they are made. */
function watchAudio(): void {
  const watched = { contexts: [] as AudioContext[], asked: [] as string[] };
  Object.assign(globalThis, { watched });
  const note = (what: string) => watched.asked.push(`${what} in ${window.event?.type ?? "nothing"}`);
  const Context = globalThis.AudioContext;
  globalThis.AudioContext = class extends Context {
    constructor(options?: AudioContextOptions) {
      super(options);
      watched.contexts.push(this);
      note("made");
    }
    override resume(): Promise<void> {
      note("resumed");
      return super.resume();
    }
  };
}

const audioOf = (page: Page) =>
  page.evaluate(() => {
    const { watched } = globalThis as unknown as {
      watched: { contexts: AudioContext[]; asked: string[] };
    };
    return { states: watched.contexts.map(({ state }) => state), asked: watched.asked };
  });

test("a tap switches sound on, the meter shows its levels, and they are of what the robot does now", async () => {
  const opened = await site.visit({ hash: "#beta=0", before: watchAudio });
  const { page } = opened;
  assert.equal(await page.textContent("#mnl"), "–");
  await page.click("#sound");
  await page.waitForSelector("#sound[aria-pressed=true]");
  // In the click itself: some browsers keep silent what is made after it.
  const { asked, states } = await audioOf(page);
  assert.deepEqual(asked.slice(0, 2), ["made in click", "resumed in click"]);
  assert.deepEqual(states, ["running"]);
  const { level, mnl, pnl } = await meanOf(page);
  for (const value of [level, mnl, pnl])
    assert.ok(value > 55 && value < 85, `it shows ${value} dBA`);
  await page.waitForFunction(() => /^\d\d\.\d$/.test(document.getElementById("mnl")!.textContent!));
  await opened.picture("sound");
  const walked = await page.evaluate(() => globalThis.mute!.app.rates.seconds);
  const anew = async (id: string, value?: string) => {
    const { levels, gait } = await work(page, id, value);
    assert.ok(Number.isNaN(levels.mnl) && levels.seconds === 0, `it still shows ${levels.mnl}`);
    assert.ok(Number.isNaN(gait.speed), `it still shows ${gait.speed} m/s`);
  };
  await anew("floor", "carpet");
  const onCarpet = await meanOf(page);
  assert.ok(onCarpet.mnl < mnl - 1, `carpet has ${onCarpet.mnl} dBA, wood ${mnl}`);
  await anew("beta", "1");
  await levelsOf(page);
  await anew("vx", "0.2");
  await levelsOf(page);
  // All of it without beginning again.
  assert.ok((await page.evaluate(() => globalThis.mute!.app.rates.seconds)) > walked);
  await anew("restart");
  await page.click("#sound");
  await page.waitForSelector("#sound[aria-pressed=false]");
  assert.deepEqual((await audioOf(page)).states, ["suspended"]);
  await leave(opened);
});

/** Holds the tables of the sound back until they are let. */
async function holdSound(page: Page): Promise<() => void> {
  let letGo: () => void = () => undefined;
  const held = new Promise<void>((resolve) => (letGo = resolve));
  await page.route("**/sound.bin", async (route) => {
    await held;
    await route.continue();
  });
  return letGo;
}

test("clicks while the sound loads begin one sound and one comparison, on the floor of now", async () => {
  const opened = await site.visit({ before: watchAudio, hash: "#vx=0&beta=0.3" });
  const { page } = opened;
  const letGo = await holdSound(page);
  await page.click("#compare");
  for (const id of ["#compare", "#sound"]) {
    assert.equal(await page.getAttribute(id, "aria-disabled"), "true");
    await page.click(id, { force: true });
  }
  await page.selectOption("#floor", "carpet"); // which gives up comparing
  await page.selectOption("#floor", "tile");
  letGo();
  await page.waitForSelector("#sound[aria-pressed=true]", LONG);
  assert.equal((await audioOf(page)).states.length, 1);
  assert.equal(await page.textContent("#comparison"), "");
  assert.equal((await stateOf(page)).command.vx, 0);
  await page.click("#compare");
  await page.waitForFunction(() => /β 0 walks/.test(document.getElementById("comparison")!.textContent!));
  assert.equal((await stateOf(page)).command.beta, 0);
  // A robot that stood is not left walking.
  await page.click("#compare");
  assert.match((await page.textContent("#comparison")) ?? "", /was stopped/);
  const { command } = await stateOf(page);
  assert.deepEqual([command.vx, command.beta], [0, 0.3]);
  await leave(opened);
});

test("a button compares ten seconds at beta 0 and at beta 1, and puts all back", async () => {
  const opened = await site.visit({ hash: "#beta=0.3" });
  const { page } = opened;
  await page.evaluate(() => {
    const told: string[] = [];
    Object.assign(globalThis, { told });
    const live = document.getElementById("comparison")!;
    new MutationObserver(() => told.push(live.textContent!)).observe(live, {
      childList: true,
      characterData: true,
      subtree: true,
    });
  });
  await page.click("#compare");
  await page.waitForFunction(
    () => /dB quieter at β 1/.test(document.getElementById("comparison")!.textContent!),
    null,
    { timeout: 600_000 }, // 20 s that are heard in full, with much else to do
  );
  const told = (await page.textContent("#comparison")) ?? "";
  const [loud = NaN, quiet = NaN] = [...told.matchAll(/: ([\d.]+) dBA/g)].map(([, value]) => Number(value));
  assert.ok(Math.abs(loud - 69.8) < 1.5 && Math.abs(quiet - 63.2) < 1.5, told);
  assert.equal((await stateOf(page)).command.beta, 0.3);
  // What is read out by a screen reader changes where there is something to tell.
  const all = await page.evaluate(() => (globalThis as unknown as { told: string[] }).told);
  assert.deepEqual(
    all.map((line) => line.replace(/[\d.]+ dB/g, "N dB")),
    ["β 0 walks.", "β 1 walks. β 0: N dBA.", "β 0: N dBA. β 1: N dBA. N dB quieter at β 1."],
  );
  await opened.picture("compared");
  await page.click("#compare");
  await page.waitForFunction(() =>
    /s to go/.test(document.getElementById("countdown")!.textContent!),
  );
  await page.fill("#vx", "0.2");
  assert.match((await page.textContent("#comparison")) ?? "", /was stopped/);
  const { command } = await stateOf(page);
  assert.deepEqual([command.vx, command.beta], [0.2, 0.3]);
  await page.click("#compare");
  await page.waitForFunction(() => /walks/.test(document.getElementById("comparison")!.textContent!));
  await page.click("#push");
  assert.match((await page.textContent("#comparison")) ?? "", /was stopped/);
  assert.match(await opened.note(), /Pushed/);
  await leave(opened);
});

test("sound pauses with a hidden tab, and goes on", async () => {
  const opened = await site.visit({ before: watchAudio });
  const { page } = opened;
  await page.click("#sound");
  await levelsOf(page);
  assert.deepEqual((await audioOf(page)).states, ["running"]);
  await hide(page, true);
  const isIn = (state: string) =>
    page.waitForFunction((wanted) => {
      const { watched } = globalThis as unknown as { watched: { contexts: AudioContext[] } };
      return watched.contexts[0]!.state === wanted;
    }, state);
  await isIn("suspended");
  const { seconds } = (await stateOf(page)).levels;
  await page.waitForTimeout(1000);
  assert.deepEqual((await audioOf(page)).states, ["suspended"]);
  await hide(page, false);
  await isIn("running");
  await page.waitForFunction((old) => globalThis.mute!.app.state.levels.seconds > old + 0.5, seconds, LONG);
  await leave(opened);
});

test("a browser without audio worklets is told so, and the robot walks on", async () => {
  const opened = await site.visit({
    before: () => Reflect.deleteProperty(globalThis, "AudioWorkletNode"),
  });
  const { page } = opened;
  assert.equal(await page.textContent("#sound"), "No sound here");
  assert.ok(await page.isDisabled("#sound"));
  assert.ok(await page.isDisabled("#compare"));
  assert.match(await opened.note(), /no sound/i);
  await leave(opened);
});
