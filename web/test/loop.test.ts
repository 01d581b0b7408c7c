/** Real time on the page: steps by the clock, pictures by the screen, nothing while hidden. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { Loop } from "../src/control/loop.js";

/** A browser whose time passes as it is told, ms. */
class Browser {
  hidden = false;
  now = 1000;
  private tick: () => void = () => undefined;
  private frame: (now: number) => void = () => undefined;
  private seen: () => void = () => undefined;

  constructor() {
    Object.assign(globalThis, {
      document: this,
      setInterval: (tick: () => void) => {
        this.tick = tick;
      },
      requestAnimationFrame: (frame: (now: number) => void) => {
        this.frame = frame;
      },
    });
    performance.now = () => this.now;
  }

  get document(): this {
    return this;
  }

  addEventListener(_: string, seen: () => void): void {
    this.seen = seen;
  }

  /** Lets time pass, in looks at the clock each 8 ms and pictures each 16. */
  pass(ms: number): void {
    for (const end = this.now + ms; this.now < end; ) {
      this.now += 8;
      this.tick();
      // Browsers draw nothing where nobody looks.
      if (this.now % 16 === 0 && !this.hidden) this.frame(this.now);
    }
  }

  hide(hidden: boolean): void {
    this.hidden = hidden;
    this.seen();
  }
}

/** A loop that runs, and what it did. */
function running(browser: Browser) {
  const done = { drawn: [] as number[], shares: [] as number[], paused: [] as boolean[], shown: 0 };
  const loop = new Loop({
    stepTime: () => 0.02,
    poll: () => undefined,
    step: () => undefined,
    draw: (share, seconds) => {
      done.shares.push(share);
      done.drawn.push(seconds);
    },
    showFigures: () => done.shown++,
    pauseOrGoOn: (hidden) => done.paused.push(hidden),
  });
  loop.run();
  browser.pass(16);
  return { loop, done };
}

test("a second has fifty steps, a picture for each of the screen's, and four looks at the figures", () => {
  const browser = new Browser();
  const { loop, done } = running(browser);
  const [steps, shown] = [loop.steps, done.shown];
  browser.pass(1000);
  assert.ok(Math.abs(loop.steps - steps - 50) <= 1, `${loop.steps - steps} steps`);
  assert.ok(done.shown - shown <= 4 && done.shown - shown >= 3);
  assert.ok(Math.abs(loop.pictureRate.perSecond - 62.5) < 1);
  assert.ok(done.shares.every((share) => share >= 0 && share <= 1));
});

test("nothing happens while the page is hidden, and nothing of that is made up for", () => {
  const browser = new Browser();
  const { loop, done } = running(browser);
  browser.pass(400);
  browser.hide(true);
  const [steps, pictures] = [loop.steps, done.drawn.length];
  browser.pass(704);
  assert.deepEqual([loop.steps, done.drawn.length], [steps, pictures]);
  browser.hide(false);
  for (let passed = 8; passed <= 400; passed += 8) {
    browser.pass(8);
    assert.ok(20 * (loop.steps - steps) <= passed, `${loop.steps - steps} steps in ${passed} ms`);
  }
  assert.ok(loop.steps - steps >= 18);
  browser.pass(160);
  assert.ok(Math.max(...done.drawn) < 0.1, `a picture was ${Math.max(...done.drawn)} s after the last`);
  assert.deepEqual(done.paused, [true, false]);
});
