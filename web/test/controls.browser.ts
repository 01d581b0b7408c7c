/** Every control of the page, by mouse and by keys, and the camera. */

import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { LONG, Site } from "./browser.js";
import { leave, stateOf, until } from "./page.js";

let site: Site;
before(async () => {
  site = await Site.open();
});
after(async () => site.close());

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
  const { page } = opened;
  const sideways = () => page.evaluate(() => globalThis.mute!.app.state.position[1]!);
  await until(page, (mute) => mute!.app.rates.seconds > 1);
  const start = await sideways();
  await page.click("#push");
  // A second from now on: the click itself may have taken longer.
  const pushed = await page.evaluate(() => globalThis.mute!.app.rates.seconds);
  await page.waitForFunction((from) => globalThis.mute!.app.rates.seconds > from + 1, pushed, LONG);
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
    "KeyW",
    "KeyS",
    "ArrowDown",
    "ArrowLeft",
    "KeyA",
    "KeyA",
    "KeyD",
    "ArrowRight",
    "KeyQ",
    "KeyQ",
    "KeyE",
    "KeyB",
    "KeyB",
    "KeyV",
  ];
  for (const key of keys) await page.keyboard.press(key);
  assert.deepEqual((await stateOf(page)).command, { vx: 0.2, vy: 0.1, wz: 0.1, beta: 0.6 });
  await page.keyboard.press("Space");
  assert.deepEqual((await stateOf(page)).command, { vx: 0, vy: 0, wz: 0, beta: 0.6 });
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
  assert.deepEqual([command.wz, command.beta], [0.1, 0.65]);
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
