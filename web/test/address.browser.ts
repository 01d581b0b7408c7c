/** The address of the page: what it keeps, and what is damaged in it. */

import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { Site } from "./browser.js";
import { leave, stateOf } from "./page.js";

let site: Site;
before(async () => {
  site = await Site.open();
});
after(async () => site.close());

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

test("what is damaged stays told of, also where another policy drives from then on", async () => {
  const opened = await site.visit();
  const { page } = opened;
  await page.setInputFiles("#file", "assets/go1_mute.onnx");
  await page.waitForFunction(() => /onnx drives/.test(document.getElementById("note")!.textContent!));
  const told = await page.evaluate(async () => {
    const lines: string[] = [];
    const note = document.getElementById("note")!;
    const watch = new MutationObserver(() => lines.push(note.textContent!));
    watch.observe(note, { childList: true });
    window.location.hash = "#vx=1e9&controller=go1_mute";
    while (globalThis.mute!.app.state.settings.controller !== "go1_mute") {
      await new Promise((resolve) => setTimeout(resolve, 10));
    }
    await new Promise((resolve) => setTimeout(resolve, 100));
    return [...lines, note.textContent!];
  });
  assert.match(told.at(-1) ?? "", /^Left out: the address has vx=1e9/);
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
