/**
 * Films the page for the front of the documentation: node build/film.mjs OUT.webp, once it is built.
 *
 * The browser's clock is held, so that every picture is drawn in full, however slow the machine is.
 */

import { spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { createServer } from "node:http";
import { readFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { chromium } from "playwright-core";
import { WEB } from "./places.mjs";

const [out] = process.argv.slice(2);
if (!out) {
  console.error("name the film: node build/film.mjs OUT.webp");
  process.exit(2);
}
const dist = join(WEB, "dist");
const types = {
  html: "text/html",
  js: "text/javascript",
  css: "text/css",
  wasm: "application/wasm",
};

/** Time between pictures, ms, and how many there are. */
const PERIOD = 80;
const PICTURES = 110;

/** What happens at which picture. */
const SCRIPT = {
  0: (page) => page.fill("#beta", "0"),
  40: (page) => page.fill("#beta", "1"),
  60: (page) => page.fill("#wz", "0.6"),
  80: (page) => page.selectOption("#floor", "tile"),
};

const server = createServer(async (request, response) => {
  const name = request.url === "/" ? "index.html" : request.url.slice(1);
  if (!existsSync(join(dist, name))) return response.writeHead(404).end();
  const type = types[name.split(".").pop()] ?? "application/octet-stream";
  response.writeHead(200, { "content-type": type }).end(await readFile(join(dist, name)));
});
await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
const args = ["--no-sandbox", "--enable-unsafe-swiftshader"];
const browser = await chromium.launch({ executablePath, args });
const page = await browser.newPage({
  viewport: { width: 960, height: 540 },
  deviceScaleFactor: 2,
});
await page.clock.install();
await page.goto(`http://127.0.0.1:${server.address().port}/`);
await page.waitForFunction(() => globalThis.mute !== undefined, null, { timeout: 120_000 });
// Of a held clock there are no rates.
await page.addStyleTag({
  content: "#rates { visibility: hidden } :focus-visible { outline: none }",
});
const frames = mkdtempSync(join(tmpdir(), "film-"));
for (let picture = 0; picture < PICTURES; picture++) {
  await SCRIPT[picture]?.(page);
  await page.clock.runFor(PERIOD);
  await page.screenshot({ path: join(frames, `${String(picture).padStart(4, "0")}.png`) });
}
await browser.close();
server.close();
const encode = join(WEB, "build", "encode_film.py");
const python = process.env.PYTHON ?? "python";
const run = spawnSync(python, [encode, frames, out, String(PERIOD)], { stdio: "inherit" });
rmSync(frames, { recursive: true });
process.exit(run.status ?? 1);
