/** Files of the visitor's, dropped on the page or chosen. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";

import type { Page } from "playwright-core";

import { Site } from "./browser.js";
import { leave, stateOf } from "./page.js";

let site: Site;
before(async () => {
  site = await Site.open();
});
after(async () => site.close());

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
