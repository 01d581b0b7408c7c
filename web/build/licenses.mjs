/**
 * On what terms the page may be passed on: its own licence, and that of everything it is bundled of.
 *
 * What a package does not bring with it, or has compiled in without a word, is in `licenses/`.
 */

import { existsSync, readdirSync, readFileSync } from "node:fs";
import { basename, join, resolve } from "node:path";
import { CHECKOUT, WEB } from "./places.mjs";

/** Up to the folder of a package, of which the last counts: packages may lie in others. */
const PACKAGE = /^.*node_modules\/(?:@[^/]+\/)?[^/]+(?=\/)/;

/**
 * Returns the text.
 *
 * @param inputs Files that were bundled, beside the folder `web`, with slashes.
 * @throws Error If a package has no licence.
 */
export function licensesText(inputs) {
  const folders = new Set(inputs.flatMap((input) => input.match(PACKAGE) ?? []));
  const packages = [...folders].sort().map((folder) => section(resolve(WEB, folder)));
  return [
    headed("MUTE, this page", "Apache-2.0", read(join(CHECKOUT, "LICENSE"))),
    headed("The robot", "BSD-3-Clause", read(join(WEB, "licenses", "go1.txt"))),
    ...packages,
  ].join("\n\n");
}

function section(folder) {
  const { name, version, license } = JSON.parse(read(join(folder, "package.json")));
  const own = readdirSync(folder).filter((file) => /^licen[cs]e(\.|$)/i.test(file));
  const kept = join(WEB, "licenses", `${basename(name)}.txt`);
  const texts = [...own.map((file) => join(folder, file)), kept].filter(existsSync);
  if (!license || !texts.length) {
    throw new Error(`the package ${name} brings no licence: find it, and put it into ${kept}`);
  }
  return headed(`${name} ${version}`, license, texts.map(read).join("\n"));
}

function headed(name, license, text) {
  const line = "=".repeat(80);
  return `${line}\n${name}: ${license}\n${line}\n\n${text.trim()}\n`;
}

function read(file) {
  return readFileSync(file, "utf8");
}
