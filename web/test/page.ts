/** What tests of the page ask of it, and how they leave it. */

import assert from "node:assert/strict";

import type { Page } from "playwright-core";

import { LONG, type Opened } from "./browser.js";

/** Returns what the robot is asked to do, and does. */
export const stateOf = (page: Page) => page.evaluate(() => globalThis.mute!.app.state);

/** Waits until something is so. */
export async function until(
  page: Page,
  what: (mute: typeof globalThis.mute) => boolean,
): Promise<void> {
  await page.waitForFunction(`(${what})(globalThis.mute)`, null, LONG);
}

/** Leaves the page, which must have had no fault, and whose robot must still walk or stand. */
export async function leave({ page, errors, strangers }: Opened, lives = true): Promise<void> {
  if (lives) {
    const { steps } = await page.evaluate(() => globalThis.mute!.app.rates);
    await page.waitForFunction((old) => globalThis.mute!.app.rates.steps > old, steps, LONG);
  }
  assert.deepEqual(errors, []);
  assert.deepEqual(strangers, []);
  await page.context().close();
}

/** Hides the tab, or shows it again. */
export const hide = (page: Page, hidden: boolean) =>
  page.evaluate((value) => {
    Object.defineProperty(document, "hidden", { configurable: true, get: () => value });
    document.dispatchEvent(new Event("visibilitychange"));
  }, hidden);
