/** Gamepads, which come and go, and fingers on a small screen. */

import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import type { Page } from "playwright-core";

import { LONG, Site } from "./browser.js";
import { leave, stateOf, until } from "./page.js";

let site: Site;
before(async () => {
  site = await Site.open();
});
after(async () => site.close());

/** A gamepad as a browser has it: it is in the list until it is unplugged. */
function plugPad(): void {
  const buttons = Array.from({ length: 17 }, () => ({ pressed: false }));
  const pad = { id: "Test pad", index: 0, connected: true, axes: [0, 0, 0, 0], buttons };
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

test("a gamepad's sticks drive and turn, its buttons stop, push, hush and begin anew", async () => {
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
  const { beta } = (await stateOf(page)).command;
  await pressPad(page, 4);
  assert.ok(Math.abs((await stateOf(page)).command.beta - (beta - 0.1)) < 1e-9);
  await pressPad(page, 5);
  assert.ok(Math.abs((await stateOf(page)).command.beta - beta) < 1e-9);
  await pressPad(page, 9);
  assert.match(await opened.note(), /starts again/);
  await leave(opened);
});

test("a stop holds while a stick is held, until it has rested", async () => {
  const opened = await site.visit({ before: plugPad });
  const { page } = opened;
  await plug(page, true);
  const pull = (axes: number[]) =>
    page.evaluate((all) => {
      (globalThis as unknown as { pad: TestPad }).pad.axes = all;
    }, axes);
  const looks = async () => {
    const { steps } = await page.evaluate(() => globalThis.mute!.app.rates);
    await page.waitForFunction((old) => globalThis.mute!.app.rates.steps > old + 10, steps, LONG);
    return (await stateOf(page)).command;
  };
  for (const stop of [() => pressPad(page, 0), () => page.keyboard.press("Space")]) {
    await pull([0, -1, 0, 0]);
    await until(page, (mute) => mute!.app.state.command.vx === 1);
    await stop();
    await pull([0, -0.9, 0, 0]);
    const { vx, vy, wz } = await looks();
    assert.deepEqual([vx, vy, wz], [0, 0, 0]);
    // What was stopped goes on, and not only for as long as the stick is held.
    await stop();
    await pull([0, 0, 0, 0]);
    assert.equal((await looks()).vx, 1);
    await page.fill("#vx", "0");
  }
  await pull([0, -1, 0, 0]);
  await until(page, (mute) => mute!.app.state.command.vx === 1);
  await leave(opened);
});

test("another gamepad that goes takes nothing along", async () => {
  const opened = await site.visit({ before: plugPad, hash: "#vx=0.4" });
  const { page } = opened;
  await plug(page, true);
  const { steps } = await page.evaluate(() => globalThis.mute!.app.rates);
  await page.waitForFunction((old) => globalThis.mute!.app.rates.steps > old + 2, steps, LONG);
  await page.evaluate(() => {
    const gamepad = { id: "Another", index: 1 };
    window.dispatchEvent(Object.assign(new Event("gamepaddisconnected"), { gamepad }));
  });
  assert.equal((await stateOf(page)).command.vx, 0.4);
  await plug(page, false);
  assert.equal((await stateOf(page)).command.vx, 0);
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
