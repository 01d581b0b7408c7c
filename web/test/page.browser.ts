/** The page as a visitor has it: every control, bad input, small screens, what a browser lacks. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";

import type { Page } from "playwright-core";

import { LONG, type Opened, Site } from "./browser.js";

let site: Site;
before(async () => (site = await Site.open()));
after(async () => site.close());

const stateOf = (page: Page) => page.evaluate(() => globalThis.mute!.app.state);

async function until(page: Page, what: (mute: typeof globalThis.mute) => boolean): Promise<void> {
  await page.waitForFunction(`(${what})(globalThis.mute)`, null, LONG);
}

/** Leaves the page, which must have had no fault, and whose robot must still walk or stand. */
async function leave({ page, errors, strangers }: Opened, lives = true): Promise<void> {
  if (lives) {
    const { steps } = await page.evaluate(() => globalThis.mute!.app.rates);
    await page.waitForFunction((old) => globalThis.mute!.app.rates.steps > old, steps, LONG);
  }
  assert.deepEqual(errors, []);
  assert.deepEqual(strangers, []);
  await page.context().close();
}

test("the robot walks at once, as fast as it is asked to", async () => {
  const opened = await site.visit();
  const { page } = opened;
  await until(page, (mute) => mute!.app.rates.seconds > 6);
  const { gait, position } = await stateOf(page);
  assert.ok(Math.abs(gait.speed - 0.5) < 0.05, `it walks at ${gait.speed} m/s`);
  assert.ok(position[0] > 2, `it got ${position[0]} m far`);
  assert.equal(gait.falls, 0);
  await opened.picture("walks");
  await leave(opened);
});

test("every slider, list and button does what it says", async () => {
  const opened = await site.visit();
  const { page } = opened;
  for (const [id, value] of [
    ["beta", "1"],
    ["vx", "0.3"],
    ["vy", "0.2"],
    ["wz", "-0.4"],
  ]) {
    await page.fill(`#${id}`, value);
    const { command } = await stateOf(page);
    assert.equal(command[id as "vx"], Number(value));
    assert.match(
      (await page.textContent(`#${id}-value`)) ?? "",
      new RegExp(Number(value).toFixed(2)),
    );
  }
  await page.click("#stop");
  assert.deepEqual((await stateOf(page)).command, { vx: 0, vy: 0, wz: 0, beta: 1 });
  assert.equal(await page.textContent("#stop"), "Go");
  await page.click("#stop");
  assert.equal((await stateOf(page)).command.vx, 0.3);
  for (const floor of await page.$$eval("#floor option", (all) =>
    all.map((one) => one.textContent),
  )) {
    await page.selectOption("#floor", floor);
    assert.equal((await stateOf(page)).settings.floor, floor);
    assert.match(await opened.note(), new RegExp(`${floor}`));
  }
  for (const level of [0, 1, 2, 3, 4]) {
    await page.selectOption("#ground", `stairs ${level}`);
    const { settings } = await stateOf(page);
    assert.deepEqual([settings.ground, settings.level], ["stairs", level]);
  }
  await opened.picture("stairs");
  await page.selectOption("#ground", "flat");
  await page.selectOption("#controller", "go1_mute");
  await page.waitForFunction(() => /drives from now on/.test(document.body.textContent ?? ""));
  await page.click("#push");
  assert.match(await opened.note(), /Pushed to the left/);
  await until(page, (mute) => mute!.app.rates.seconds > 5);
  await page.click("#restart");
  assert.match(await opened.note(), /starts again/);
  assert.ok((await page.evaluate(() => globalThis.mute!.app.rates.seconds)) < 5);
  await page.click("summary");
  await page.click("#share");
  await page.waitForFunction(() => /address/i.test(document.getElementById("note")!.textContent!));
  await leave(opened);
});

test("a push is felt", async () => {
  const opened = await site.visit({ hash: "#vx=0" });
  const sideways = () => opened.page.evaluate(() => globalThis.mute!.app.state.position[1]);
  await until(opened.page, (mute) => mute!.app.rates.seconds > 1);
  const start = await sideways();
  await opened.page.click("#push");
  await until(opened.page, (mute) => mute!.app.rates.seconds > 2);
  assert.ok((await sideways()) - start > 0.03, `it got from ${start} to ${await sideways()} m`);
  await leave(opened);
});

test("keys steer, and leave a focused control alone", async () => {
  const opened = await site.visit({ hash: "#vx=0" });
  const { page } = opened;
  const keys = [
    "ArrowUp",
    "KeyW",
    "KeyW",
    "KeyS",
    "ArrowLeft",
    "KeyA",
    "KeyD",
    "KeyQ",
    "KeyB",
    "KeyV",
  ];
  for (const key of keys) await page.keyboard.press(key);
  assert.deepEqual((await stateOf(page)).command, { vx: 0.2, vy: 0.1, wz: 0.1, beta: 0.5 });
  await page.keyboard.press("Space");
  assert.deepEqual((await stateOf(page)).command, { vx: 0, vy: 0, wz: 0, beta: 0.5 });
  await page.keyboard.press("Space");
  await page.keyboard.press("KeyP");
  assert.match(await opened.note(), /Pushed/);
  await page.keyboard.press("KeyR");
  assert.match(await opened.note(), /starts again/);
  await page.focus("#floor");
  await page.keyboard.press("ArrowUp");
  assert.equal((await stateOf(page)).command.vx, 0.2);
  await page.focus("#beta");
  await page.keyboard.press("ArrowRight");
  const { command } = await stateOf(page);
  assert.deepEqual([command.wz, command.beta], [0.1, 0.55]);
  await leave(opened);
});

test("every control can be reached by the tabulator, and has a name", async () => {
  const opened = await site.visit();
  const { page } = opened;
  const wanted = await page.$$eval("button:not(:disabled), select, input, summary", (all) =>
    all.map((one) => one.id || one.tagName),
  );
  const reached = new Set<string>();
  for (let i = 0; i < 2 * wanted.length; i++) {
    await page.keyboard.press("Tab");
    reached.add(
      await page.evaluate(
        () => document.activeElement?.id || document.activeElement?.tagName || "",
      ),
    );
  }
  assert.deepEqual(
    wanted.filter((id) => !reached.has(id)),
    [],
  );
  const nameless = await page.$$eval("button, select, input, canvas, output", (all) =>
    all
      .filter((one) => {
        const labels = "labels" in one ? (one.labels as NodeList | null) : null;
        const name = one.getAttribute("aria-label") ?? labels?.[0]?.textContent ?? one.textContent;
        return !name?.trim();
      })
      .map((one) => one.id),
  );
  assert.deepEqual(nameless, []);
  await leave(opened);
});

test("an address keeps what was set", async () => {
  const first = await site.visit();
  await first.page.fill("#beta", "0.9");
  await first.page.selectOption("#floor", "tile");
  await first.page.selectOption("#ground", "stairs 1");
  await first.page.waitForFunction(() => window.location.hash.includes("level=1"));
  const hash = await first.page.evaluate(() => window.location.hash);
  await leave(first);
  const second = await site.visit({ hash });
  const { settings, command } = await stateOf(second.page);
  assert.deepEqual(
    [settings.floor, settings.ground, settings.level, command.beta],
    ["tile", "stairs", 1, 0.9],
  );
  assert.equal(await second.page.inputValue("#ground"), "stairs 1");
  await leave(second);
});

test("a damaged address is told of in one line, and the rest of it holds", async () => {
  const opened = await site.visit({ hash: "#vx=fast&beta=1&floor=lava&colour=%E0%A4%A" });
  assert.match(
    await opened.note(),
    /^Left out: the address has the unknown setting colour \(and 2 more\)\.$/,
  );
  const { command, settings } = await stateOf(opened.page);
  assert.deepEqual([command.vx, command.beta, settings.floor], [0.5, 1, "wood"]);
  await opened.page.evaluate(() => (window.location.hash = "#floor=tile&vx=1e9"));
  await opened.page.waitForFunction(() =>
    /vx=1e9/.test(document.getElementById("note")!.textContent!),
  );
  assert.equal((await stateOf(opened.page)).settings.floor, "tile");
  await leave(opened);
});

/** Drops a file on the page, as a hand would. */
async function drop(page: Page, name: string, content: Uint8Array): Promise<void> {
  const base64 = Buffer.from(content).toString("base64");
  await page.evaluate(
    ([fileName, data]) => {
      const bytes = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
      const dataTransfer = new DataTransfer();
      dataTransfer.items.add(new File([bytes], fileName));
      document.body.dispatchEvent(new DragEvent("dragover", { bubbles: true, dataTransfer }));
      document.body.dispatchEvent(new DragEvent("drop", { bubbles: true, dataTransfer }));
    },
    [name, base64],
  );
}

test("a foreign file that is dropped is refused in one line, an export of ours drives", async () => {
  const opened = await site.visit();
  const { page } = opened;
  const shipped = new Uint8Array(readFileSync("assets/go1_mute.onnx"));
  const told = (words: string) =>
    page.waitForFunction(
      (text) => document.getElementById("note")!.textContent!.includes(text),
      words,
    );
  await drop(page, "cat.onnx", new TextEncoder().encode("meow ".repeat(1000)));
  await told("cat.onnx is not taken: it is no policy that MUTE exported");
  await drop(page, "half.onnx", shipped.subarray(0, shipped.length >> 1));
  await told("half.onnx is not taken: it is no policy that MUTE exported");
  assert.equal((await stateOf(page)).settings.controller, "go1_mute");
  await drop(page, "mine.onnx", shipped);
  await told("mine.onnx drives from now on");
  assert.equal(await page.inputValue("#controller"), "mine.onnx");
  await page.setInputFiles("#file", {
    name: "other.onnx",
    mimeType: "",
    buffer: Buffer.from(shipped),
  });
  await told("other.onnx drives from now on");
  await leave(opened);
});

test("a gamepad drives, and one that is lost leaves the robot standing, and a line", async () => {
  const opened = await site.visit({
    before: () => {
      const pad = { id: "Test pad", connected: true, axes: [0, 0, 0, 0], buttons: [] as object[] };
      Object.assign(globalThis, { pad });
      navigator.getGamepads = () => [pad as unknown as Gamepad];
    },
  });
  const { page } = opened;
  const tell = (kind: string) =>
    page.evaluate((type) => {
      const { pad } = globalThis as unknown as { pad: Gamepad };
      window.dispatchEvent(Object.assign(new Event(type), { gamepad: pad }));
    }, kind);
  await tell("gamepadconnected");
  assert.match(await opened.note(), /The gamepad Test pad drives/);
  await page.evaluate(() => {
    (globalThis as unknown as { pad: { axes: number[] } }).pad.axes = [0, -1, 0, 0];
  });
  await until(page, (mute) => mute!.app.command.vx === 1);
  await tell("gamepaddisconnected");
  assert.match(await opened.note(), /The gamepad Test pad is gone: the robot stands/);
  await leave(opened);
});

test("a joystick drives a touch screen that is 360 px wide, where nothing overflows", async () => {
  const opened = await site.visit({
    viewport: { width: 360, height: 740 },
    hasTouch: true,
    isMobile: true,
    hash: "#vx=0",
  });
  const { page } = opened;
  const box = await page.locator("#pad").boundingBox();
  assert.ok(box);
  const [x, y] = [box.x + 0.5 * box.width, box.y + 0.5 * box.height];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x, y - 0.5 * box.height);
  await until(page, (mute) => mute!.app.command.vx === 1);
  await opened.picture("small");
  await page.mouse.up();
  assert.equal((await stateOf(page)).command.vx, 0);
  const width = await page.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(width <= 360, `it is ${width} px wide`);
  await page.locator("#share").scrollIntoViewIfNeeded();
  await opened.picture("small_below");
  await leave(opened);
});

/** Waits until the meter shows a mean level, and returns all. */
async function levelsOf(page: Page) {
  await page.waitForFunction(() => globalThis.mute!.app.state.levels.mnl > 0, null, LONG);
  return page.evaluate(() => globalThis.mute!.app.state.levels);
}

test("a tap switches sound on, the meter shows its levels, and they begin anew with the walk", async () => {
  const opened = await site.visit({ hash: "#beta=0" });
  const { page } = opened;
  assert.equal(await page.textContent("#mnl"), "–");
  await page.click("#sound");
  await page.waitForSelector("#sound[aria-pressed=true]");
  const { level, mnl, pnl } = await levelsOf(page);
  for (const value of [level, mnl, pnl])
    assert.ok(value > 55 && value < 85, `it shows ${value} dBA`);
  await page.waitForFunction(() => /^\d\d\.\d$/.test(document.getElementById("mnl")!.textContent!));
  await until(page, (mute) => mute!.app.state.levels.seconds > 3);
  await opened.picture("sound");
  await page.selectOption("#floor", "carpet");
  await page.click("#restart");
  assert.ok(Number.isNaN(await page.evaluate(() => globalThis.mute!.app.state.levels.mnl)));
  const onCarpet = await levelsOf(page);
  assert.ok(onCarpet.mnl < mnl - 1, `carpet has ${onCarpet.mnl} dBA, wood ${mnl}`);
  await page.click("#sound");
  await page.waitForSelector("#sound[aria-pressed=false]");
  await leave(opened);
});

test("a button compares ten seconds at beta 0 and at beta 1, and puts beta back", async () => {
  const opened = await site.visit({ hash: "#beta=0.3" });
  const { page } = opened;
  await page.click("#compare");
  await page.waitForFunction(
    () => /dB quieter at β 1/.test(document.getElementById("comparison")!.textContent!),
    null,
    LONG,
  );
  const told = (await page.textContent("#comparison")) ?? "";
  const [loud, quiet] = [...told.matchAll(/: ([\d.]+) dBA/g)].map(([, value]) => Number(value));
  assert.ok(Math.abs(loud - 67.4) < 1.5 && Math.abs(quiet - 63.3) < 1.5, told);
  assert.equal((await stateOf(page)).command.beta, 0.3);
  await opened.picture("compared");
  await page.click("#compare");
  await page.waitForFunction(() =>
    /to go/.test(document.getElementById("comparison")!.textContent!),
  );
  await page.fill("#vx", "0.2");
  assert.match((await page.textContent("#comparison")) ?? "", /was stopped/);
  await leave(opened);
});

test("sound pauses with a hidden tab, and goes on", async () => {
  const opened = await site.visit();
  const { page } = opened;
  await page.click("#sound");
  await levelsOf(page);
  const hide = (hidden: boolean) =>
    page.evaluate((value) => {
      Object.defineProperty(document, "hidden", { configurable: true, get: () => value });
      document.dispatchEvent(new Event("visibilitychange"));
    }, hidden);
  await hide(true);
  await page.waitForTimeout(300);
  const before = await page.evaluate(() => globalThis.mute!.app.state.levels.seconds);
  await page.waitForTimeout(1500);
  await hide(false);
  const after = await page.evaluate(() => globalThis.mute!.app.state.levels.seconds);
  assert.ok(after - before < 0.2, `it heard ${after - before} s while it was hidden`);
  await until(page, (mute) => mute!.app.state.levels.seconds > 2);
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

test("a hidden tab pauses, and goes on without a jump", async () => {
  const opened = await site.visit();
  const { page } = opened;
  const hide = (hidden: boolean) =>
    page.evaluate((value) => {
      Object.defineProperty(document, "hidden", { configurable: true, get: () => value });
      document.dispatchEvent(new Event("visibilitychange"));
    }, hidden);
  await until(page, (mute) => mute!.app.rates.seconds > 1);
  await hide(true);
  const before = await page.evaluate(() => globalThis.mute!.app.rates.steps);
  await page.waitForTimeout(3000);
  assert.equal(await page.evaluate(() => globalThis.mute!.app.rates.steps), before);
  await hide(false);
  const after = await page.evaluate(() => globalThis.mute!.app.rates.steps);
  assert.ok(after - before <= 6, `it made up for ${after - before} steps`);
  await leave(opened);
});

test("nothing on the page moves by itself", async () => {
  const opened = await site.visit();
  await until(opened.page, (mute) => mute!.app.rates.seconds > 3);
  const moved = await opened.page.evaluate(
    () =>
      new Promise<number>((resolve) => {
        let sum = 0;
        new PerformanceObserver((list) => {
          for (const entry of list.getEntries())
            sum += (entry as unknown as { value: number }).value;
        }).observe({ type: "layout-shift", buffered: true });
        setTimeout(() => resolve(sum), 500);
      }),
  );
  assert.ok(moved < 0.02, `the layout shifted by ${moved}`);
  await leave(opened);
});

test("a browser without WebAssembly is told so", async () => {
  const opened = await site.visit({
    before: () => Reflect.deleteProperty(globalThis, "WebAssembly"),
    begins: false,
  });
  await opened.page.waitForFunction(() =>
    /WebAssembly/.test(document.getElementById("note")!.textContent!),
  );
  assert.match(await opened.note(), /^The page cannot begin: this browser has no WebAssembly/);
  await leave(opened, false);
});

test("a file of the page that is missing is told of", async () => {
  const opened = await site.visit({ begins: false });
  await opened.page.route("**/page.json", (route) => route.fulfill({ status: 404, body: "" }));
  await opened.page.reload();
  await opened.page.waitForFunction(() =>
    /page\.json/.test(document.getElementById("note")!.textContent!),
  );
  assert.match(await opened.note(), /The page cannot begin: page\.json cannot be loaded \(404\)/);
  await opened.page.context().close();
});

test("a browser without WebGL is told so, and the robot walks on", async () => {
  const blind = await Site.open(["--disable-3d-apis"]);
  try {
    const opened = await blind.visit();
    assert.match((await opened.page.textContent("#loading")) ?? "", /WebGL is missing/);
    await until(opened.page, (mute) => mute!.app.rates.seconds > 1);
    await opened.picture("blind");
    await opened.page.context().close();
  } finally {
    await blind.close();
  }
});
