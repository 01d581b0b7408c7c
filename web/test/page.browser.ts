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
  assert.ok((position[0] as number) > 2, `it got ${position[0]} m far`);
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
  ] as const) {
    await page.fill(`#${id}`, value);
    const { command } = await stateOf(page);
    assert.equal(command[id], Number(value));
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
  const sideways = () => opened.page.evaluate(() => globalThis.mute!.app.state.position[1]!);
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

test("a robot that comes stopped by its address goes at a click", async () => {
  const opened = await site.visit({ hash: "#vx=0&vy=0&wz=0&beta=0.7" });
  const { page } = opened;
  assert.equal(await page.textContent("#stop"), "Go");
  await page.click("#stop");
  const { command } = await stateOf(page);
  assert.deepEqual([command.vx, command.beta], [0.5, 0.7]);
  assert.equal(await page.textContent("#stop"), "Stop");
  await leave(opened);
});

test("the camera turns by hand, by the wheel and by keys", async () => {
  const opened = await site.visit();
  const { page } = opened;
  const camera = async () => (await stateOf(page)).camera!;
  const first = await camera();
  const box = (await page.locator("#view").boundingBox())!;
  const [x, y] = [box.x + 0.5 * box.width, box.y + 0.5 * box.height];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 100, y + 50);
  await page.mouse.up();
  const dragged = await camera();
  assert.ok(Math.abs(dragged.azimuth - first.azimuth + 0.8) < 1e-6, JSON.stringify(dragged));
  assert.ok(Math.abs(dragged.elevation - first.elevation - 0.3) < 1e-6);
  await page.mouse.move(x - 100, y);
  assert.deepEqual(await camera(), dragged);
  await page.mouse.wheel(0, 300);
  await page.waitForFunction(
    (old) => globalThis.mute!.app.state.camera!.distance > 1.3 * old,
    first.distance,
  );
  const wheeled = await camera();
  for (const key of ["KeyL", "KeyL", "KeyI", "KeyU"]) await page.keyboard.press(key);
  const turned = await camera();
  assert.ok(Math.abs(turned.azimuth - wheeled.azimuth - 0.2) < 1e-9);
  assert.ok(Math.abs(turned.elevation - wheeled.elevation - 0.1) < 1e-9);
  assert.ok(turned.distance < wheeled.distance);
  for (const key of ["KeyJ", "KeyJ", "KeyK", "KeyO"]) await page.keyboard.press(key);
  const back = await camera();
  assert.ok(Math.abs(back.azimuth - wheeled.azimuth) < 1e-9);
  assert.ok(Math.abs(back.distance - wheeled.distance) < 1e-9);
  await page.selectOption("#ground", "stairs 0");
  assert.notEqual((await camera()).azimuth, back.azimuth);
  await leave(opened);
});

test("what gets the focus on a small screen is not behind the picture", async () => {
  const opened = await site.visit({ viewport: { width: 360, height: 740 } });
  const { page } = opened;
  await page.evaluate(() => window.scrollTo(0, document.body.scrollHeight));
  await page.focus("#share");
  for (let i = 0; i < 14; i++) {
    await page.keyboard.press("Shift+Tab");
    const [top, floor, id] = await page.evaluate(() => {
      const own = document.activeElement!;
      const stage = document.getElementById("stage")!.getBoundingClientRect();
      return [own.getBoundingClientRect().top, stage.bottom, own.id] as const;
    });
    if (!id) break; // before the first control
    assert.ok(top >= floor - 1, `#${id} is at ${top} px, the picture ends at ${floor}`);
  }
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
    [name, base64] as const,
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

/** A gamepad as a browser has it: it is in the list until it is unplugged. */
function plugPad(): void {
  const buttons = Array.from({ length: 17 }, () => ({ pressed: false }));
  const pad = { id: "Test pad", connected: true, axes: [0, 0, 0, 0], buttons };
  Object.assign(globalThis, { pad });
  navigator.getGamepads = () => [pad.connected ? (pad as unknown as Gamepad) : null];
}

interface TestPad {
  connected: boolean;
  axes: number[];
  buttons: { pressed: boolean }[];
}

/** Plugs the pad in or out. */
async function plug(page: Page, connected: boolean): Promise<void> {
  await page.evaluate((isIn) => {
    const { pad } = globalThis as unknown as { pad: TestPad };
    pad.connected = isIn;
    const type = isIn ? "gamepadconnected" : "gamepaddisconnected";
    window.dispatchEvent(Object.assign(new Event(type), { gamepad: pad }));
  }, connected);
}

/** Presses a button until the page has seen it. */
async function pressPad(page: Page, index: number): Promise<void> {
  await page.evaluate(async (at) => {
    const button = (globalThis as unknown as { pad: TestPad }).pad.buttons[at]!;
    for (const pressed of [true, false]) {
      button.pressed = pressed;
      // Until the page has looked twice.
      const { steps } = globalThis.mute!.app.rates;
      while (globalThis.mute!.app.rates.steps < steps + 2) await new Promise((r) => setTimeout(r, 5));
    }
  }, index);
}

test("a gamepad's sticks drive and turn, its buttons stop, push and begin anew", async () => {
  const opened = await site.visit({ before: plugPad });
  const { page } = opened;
  await plug(page, true);
  assert.match(await opened.note(), /The gamepad Test pad drives/);
  const pull = (axes: number[]) =>
    page.evaluate((all) => {
      (globalThis as unknown as { pad: TestPad }).pad.axes = all;
    }, axes);
  await pull([-1, -1, 0, 0]);
  await until(page, (mute) => mute!.app.state.command.vx === 1);
  const { command } = await stateOf(page);
  assert.ok(command.vy > 0 && command.wz === 0, JSON.stringify(command));
  await pull([0, 0, 1, 0]);
  await until(page, (mute) => mute!.app.state.command.wz < 0);
  assert.deepEqual((await stateOf(page)).command.vx, 0);
  await pull([0, 0, 0, 0]);
  await until(page, (mute) => mute!.app.state.command.wz === 0);
  await page.fill("#vx", "0.4");
  await pressPad(page, 0);
  assert.equal((await stateOf(page)).command.vx, 0);
  await pressPad(page, 0);
  assert.equal((await stateOf(page)).command.vx, 0.4);
  await pressPad(page, 2);
  assert.match(await opened.note(), /Pushed to the left/);
  await pressPad(page, 9);
  assert.match(await opened.note(), /starts again/);
  await leave(opened);
});

test("a gamepad that is lost as it drives leaves the robot standing, and a line", async () => {
  const opened = await site.visit({ before: plugPad });
  const { page } = opened;
  await plug(page, true);
  await page.evaluate(() => {
    (globalThis as unknown as { pad: TestPad }).pad.axes = [0, -1, 0, 0];
  });
  await until(page, (mute) => mute!.app.state.command.vx === 1);
  await plug(page, false);
  assert.match(await opened.note(), /The gamepad Test pad is gone: the robot stands/);
  // And it stands still after the page has looked for gamepads some more.
  const { steps } = await page.evaluate(() => globalThis.mute!.app.rates);
  await page.waitForFunction((old) => globalThis.mute!.app.rates.steps > old + 10, steps, LONG);
  const { vx, vy, wz } = (await stateOf(page)).command;
  assert.deepEqual([vx, vy, wz], [0, 0, 0]);
  await page.keyboard.press("KeyW");
  assert.equal((await stateOf(page)).command.vx, 0.1);
  await leave(opened);
});

test("one that is lost while it rests stops what keys had asked for", async () => {
  const opened = await site.visit({ before: plugPad, hash: "#vx=0.4" });
  await plug(opened.page, true);
  await plug(opened.page, false);
  const { vx, vy, wz } = (await stateOf(opened.page)).command;
  assert.deepEqual([vx, vy, wz], [0, 0, 0]);
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
  // Fingers, not the mouse: they scroll the page where nothing holds them.
  const fingers = await page.context().newCDPSession(page);
  const touch = (type: "touchStart" | "touchMove" | "touchEnd", ...points: [number, number][]) =>
    fingers.send("Input.dispatchTouchEvent", {
      type,
      touchPoints: points.map(([px, py]) => ({ x: px, y: py })),
    });
  await touch("touchStart", [x, y]);
  for (const share of [0.2, 0.4, 0.6]) await touch("touchMove", [x, y - share * box.height]);
  await until(page, (mute) => mute!.app.state.command.vx === 1);
  await touch("touchMove", [x - 0.5 * box.width, y]);
  await until(page, (mute) => mute!.app.state.command.wz > 0.5);
  assert.equal((await stateOf(page)).command.vx, 0);
  await opened.picture("small");
  assert.equal(await page.evaluate(() => window.scrollY), 0);
  await touch("touchEnd");
  await until(page, (mute) => mute!.app.state.command.wz === 0);
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
  const { level, mnl, pnl } = await levelsOf(page);
  for (const value of [level, mnl, pnl])
    assert.ok(value > 55 && value < 85, `it shows ${value} dBA`);
  await page.waitForFunction(() => /^\d\d\.\d$/.test(document.getElementById("mnl")!.textContent!));
  await until(page, (mute) => mute!.app.state.levels.seconds > 3);
  await opened.picture("sound");
  const walked = await page.evaluate(() => globalThis.mute!.app.rates.seconds);
  const anew = async (change: () => Promise<unknown>) => {
    await change();
    const { levels, gait } = await stateOf(page);
    assert.ok(Number.isNaN(levels.mnl) && levels.seconds === 0, `it still shows ${levels.mnl}`);
    assert.ok(Number.isNaN(gait.speed), `it still shows ${gait.speed} m/s`);
    return levelsOf(page);
  };
  const onCarpet = await anew(() => page.selectOption("#floor", "carpet"));
  assert.ok(onCarpet.mnl < mnl - 1, `carpet has ${onCarpet.mnl} dBA, wood ${mnl}`);
  await anew(() => page.fill("#beta", "1"));
  await anew(() => page.fill("#vx", "0.2"));
  // All of it without beginning again.
  assert.ok((await page.evaluate(() => globalThis.mute!.app.rates.seconds)) > walked);
  await anew(() => page.click("#restart"));
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
    LONG,
  );
  const told = (await page.textContent("#comparison")) ?? "";
  const [loud = NaN, quiet = NaN] = [...told.matchAll(/: ([\d.]+) dBA/g)].map(([, value]) => Number(value));
  assert.ok(Math.abs(loud - 67.4) < 1.5 && Math.abs(quiet - 63.3) < 1.5, told);
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
  await leave(opened);
});

/** Hides the tab, or shows it again. */
const hide = (page: Page, hidden: boolean) =>
  page.evaluate((value) => {
    Object.defineProperty(document, "hidden", { configurable: true, get: () => value });
    document.dispatchEvent(new Event("visibilitychange"));
  }, hidden);

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

test("a hidden tab pauses, and goes on", async () => {
  const opened = await site.visit();
  const { page } = opened;
  await until(page, (mute) => mute!.app.rates.seconds > 1);
  await hide(page, true);
  const before = await page.evaluate(() => globalThis.mute!.app.rates.steps);
  await page.waitForTimeout(1000);
  assert.equal(await page.evaluate(() => globalThis.mute!.app.rates.steps), before);
  // How many come at once is tried in node, where time passes as it is told.
  await hide(page, false);
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

test("a picture that fails for another reason says which, and the robot walks on", async () => {
  const opened = await site.visit({
    before: () => {
      const Observer = globalThis.ResizeObserver;
      globalThis.ResizeObserver = class extends Observer {
        override observe(target: Element): void {
          if (target.id === "view") throw new Error("the canvas cannot be watched");
          super.observe(target);
        }
      };
    },
  });
  assert.equal(
    await opened.page.textContent("#loading"),
    "There is no picture: the canvas cannot be watched. The robot walks unseen.",
  );
  await leave(opened);
});

test("a browser without WebGL is told so, and the robot walks on", async () => {
  const blind = await Site.open(["--disable-3d-apis"]);
  try {
    const opened = await blind.visit();
    assert.equal(
      await opened.page.textContent("#loading"),
      "There is no picture: WebGL is missing. The robot walks unseen.",
    );
    await until(opened.page, (mute) => mute!.app.rates.seconds > 1);
    await opened.picture("blind");
    await opened.page.context().close();
  } finally {
    await blind.close();
  }
});
