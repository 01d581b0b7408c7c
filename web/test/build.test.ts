/** The build makes a whole page wherever the checkout lies, and of nothing but what belongs to it. */

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { randomBytes } from "node:crypto";
import {
  cpSync,
  existsSync,
  mkdirSync,
  mkdtempSync,
  readdirSync,
  readFileSync,
  rmSync,
  symlinkSync,
  writeFileSync,
} from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";

const folder = mkdtempSync(join(tmpdir(), "page-"));
after(() => rmSync(folder, { recursive: true }));

/** Copies what the build is made of into a checkout of its own, and returns its folder `web`. */
function checkout(name: string): string {
  const web = join(folder, name, "web");
  mkdirSync(join(web, "node_modules"), { recursive: true });
  cpSync("../LICENSE", join(folder, name, "LICENSE"));
  for (const part of ["assets", "build", "licenses", "src"]) {
    cpSync(part, join(web, part), { recursive: true });
  }
  for (const entry of readdirSync("node_modules")) {
    symlinkSync(join(process.cwd(), "node_modules", entry), join(web, "node_modules", entry));
  }
  return web;
}

function bundle(web: string): { status: number | null; told: string; printed: string } {
  const words = [join(web, "build", "bundle.mjs")];
  const run = spawnSync(process.execPath, words, { encoding: "utf8", timeout: 60_000 });
  return { status: run.status, told: run.stderr, printed: run.stdout };
}

function builds(web: string): string {
  const { status, told, printed } = bundle(web);
  assert.deepEqual({ status, told }, { status: 0, told: "" });
  return printed;
}

/** Returns the names of the page's packages, as `package.json` pins them. */
function packages(): [name: string, version: string][] {
  return Object.entries(JSON.parse(readFileSync("package.json", "utf8")).dependencies);
}

test("a checkout in a folder with blanks and accents is built, without what earlier builds left", () => {
  const web = checkout("two words, déjà");
  writeFileSync(join(web, "assets", "go1_old.onnx"), "of another build");
  mkdirSync(join(web, "dist"));
  writeFileSync(join(web, "dist", "go1_older.onnx"), "of one before");
  builds(web);
  const built = readdirSync(join(web, "dist"));
  assert.ok(built.includes("main.js") && built.includes("go1_mute.onnx"));
  assert.deepEqual(built.filter((name) => /old/.test(name)), []);
  const html = readFileSync(join(web, "dist", "index.html"), "utf8");
  const links = [...html.matchAll(/(?:href|src)="([^":]+)"/g)].map(([, link = ""]) => link);
  assert.ok(links.includes("licenses.txt"), "the page links to its licences");
  assert.deepEqual(links.filter((link) => !built.includes(link)), []);
});

/** Adds a controller to the list of a checkout's page, and returns the file that is to come. */
function another(web: string): string {
  const list = join(web, "assets", "page.json");
  const content = JSON.parse(readFileSync(list, "utf8"));
  content.controllers.push({ name: "another", label: "Another", file: "another.onnx" });
  writeFileSync(list, JSON.stringify(content));
  return join(web, "assets", "another.onnx");
}

test("what the page weighs with one controller is told in its documentation", () => {
  const web = checkout("weighed");
  cpSync("assets/go1_mute.onnx", another(web));
  const printed = builds(web);
  assert.match(printed, /^another\.onnx +\d+ kB/m);
  let [all, packed] = [0, 0];
  for (const [, name = "", bytes, fewer] of printed.matchAll(/^(.+?) +(\d+) kB, compressed +(\d+) kB$/gm)) {
    if (name === "in all" || (name.endsWith(".onnx") && name !== "go1_mute.onnx")) continue;
    all += Number(bytes) / 1000;
    packed += Number(fewer) / 1000;
  }
  const [, told, toldPacked] =
    readFileSync("../docs/web.md", "utf8").match(/it is ([\d.]+) MB in all, ([\d.]+) MB compressed/) ?? [];
  assert.ok(Math.abs(Number(told) - all) < 0.1, `it is ${all} MB, not ${told}`);
  assert.ok(Math.abs(Number(toldPacked) - packed) < 0.1, `compressed ${packed} MB, not ${toldPacked}`);
});

test("a page that is too heavy is none", () => {
  const web = checkout("heavy");
  writeFileSync(another(web), randomBytes(8e6)); // which nothing can compress
  const { status, told } = bundle(web);
  assert.deepEqual([status, told], [1, "the page weighs more than 8 MB compressed\n"]);
});

test("the versions that are pinned name no registry", () => {
  const pinned = Object.entries(JSON.parse(readFileSync("package-lock.json", "utf8")).packages);
  assert.ok(pinned.length > 20);
  const named = pinned.filter(([, one]) => "resolved" in (one as object)).map(([name]) => name);
  assert.deepEqual(named, []);
  assert.match(readFileSync(".npmrc", "utf8"), /^omit-lockfile-registry-resolved=true$/m);
});

test("licenses.txt has the licence of every package, and of what is compiled into MuJoCo", () => {
  const web = checkout("licences");
  builds(web);
  const text = readFileSync(join(web, "dist", "licenses.txt"), "utf8");
  const heads = [...text.matchAll(/^=+\n(.+): (.+)\n=+$/gm)].map(([, name, license]) => [name, license]);
  const licenses: Record<string, string> = { "@mujoco/mujoco": "Apache-2.0", three: "MIT" };
  assert.deepEqual(heads, [
    ["MUTE, this page", "Apache-2.0"],
    ["The robot", "BSD-3-Clause"],
    ...packages().map(([name, version]) => [`${name} ${version}`, licenses[name]]),
  ]);
  assert.ok(text.includes(readFileSync("../LICENSE", "utf8").trim()));
  assert.ok(text.includes(readFileSync("node_modules/three/LICENSE", "utf8").trim()));
  const copyrights = [
    /Copyright \(c\) 2016-2022 HangZhou YuShu TECHNOLOGY/,
    /Qhull, Copyright \(c\) 1993-2020/,
    /Copyright \(c\) 2005-2018 Lode Vandevenne/,
    /Copyright \(c\) 2012-2019 Syoyo Fujita/,
    /Copyright © 2005-2020 Rich Felker/,
    /Emscripten authors/,
    /under the Apache License v2.0 with LLVM Exceptions/,
  ];
  for (const copyright of copyrights) assert.match(text, copyright);
});

test("a package without a licence is not passed on", () => {
  const web = checkout("foreign");
  const foreign = join(web, "node_modules", "foreign");
  mkdirSync(foreign);
  writeFileSync(join(foreign, "package.json"), '{"name": "foreign", "license": "MIT"}');
  writeFileSync(join(foreign, "index.js"), "globalThis.foreign = 1;");
  writeFileSync(join(web, "src", "main.ts"), 'import "foreign";');
  const { status, told } = bundle(web);
  assert.equal(status, 1);
  assert.match(told, /^the package foreign brings no licence: .*foreign\.txt\n$/);
});

test("an asset that is missing is named in a line, and the last build stays", () => {
  const web = checkout("missing");
  rmSync(join(web, "assets", "sound.bin"));
  mkdirSync(join(web, "dist"));
  writeFileSync(join(web, "dist", "kept"), "");
  const { status, told } = bundle(web);
  assert.equal(status, 1);
  assert.equal(told, "web/assets lacks sound.bin: have it made by npm run assets\n");
  assert.ok(existsSync(join(web, "dist", "kept")));
});
