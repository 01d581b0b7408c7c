/** What may go wrong: hidden tabs, layouts that move, browsers that lack something. */

import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { LONG, Site } from "./browser.js";
import { hide, leave, until } from "./page.js";

let site: Site;
before(async () => {
  site = await Site.open();
});
after(async () => site.close());

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

test("a picture that is lost is told of, and the robot walks on, also once it is back", async () => {
  const opened = await site.visit();
  const { page } = opened;
  const loading = page.locator("#loading");
  await page.evaluate(() => {
    const context = (document.getElementById("view") as HTMLCanvasElement).getContext("webgl2")!;
    const loss = context.getExtension("WEBGL_lose_context")!;
    Object.assign(globalThis, { loss });
    loss.loseContext();
  });
  await page.waitForFunction(() => !document.getElementById("loading")!.hidden, null, LONG);
  assert.equal(
    await loading.textContent(),
    "The picture is lost: the browser gave WebGL up. The robot walks unseen; reload the page to see it.",
  );
  const { seconds } = await page.evaluate(() => globalThis.mute!.app.rates);
  await page.waitForFunction((old) => globalThis.mute!.app.rates.seconds > old + 1, seconds, LONG);
  await page.evaluate(() => {
    (globalThis as unknown as { loss: WEBGL_lose_context }).loss.restoreContext();
  });
  await page.waitForFunction(() => document.getElementById("loading")!.hidden, null, LONG);
  await opened.picture("restored");
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
