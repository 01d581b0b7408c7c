/** Bundles the tests, which are TypeScript, and runs them: node build/test.mjs node|browser [file]. */

import { readdirSync, rmSync } from "node:fs";
import { join } from "node:path";
import { build } from "esbuild";
import { WEB } from "./places.mjs";
import { runFiles } from "./run_files.mjs";

/**
 * What ends the names of each kind, whether their files run together (one browser at a time, or each
 * would slow the other down), and the longest time of a file, ms, with much else to do.
 */
const KINDS = {
  node: { suffix: ".test.ts", together: true, limit: 600_000 },
  browser: { suffix: ".browser.ts", together: false, limit: 1_200_000 },
};

const [name = "node", only = ""] = process.argv.slice(2);
const kind = Object.hasOwn(KINDS, name) ? KINDS[name] : fail(`node or browser, not ${name}`);
process.chdir(WEB); // where tests look for assets, dist and references
const files = tests("test").filter((file) => file.endsWith(kind.suffix) && file.includes(only));
if (!files.length) fail(`no file of the ${name} tests has ${only} in its name`);
const out = join(".test", name);
rmSync(out, { recursive: true, force: true });
await build({
  entryPoints: files,
  outdir: out,
  outbase: "test",
  outExtension: { ".js": ".mjs" },
  bundle: true,
  platform: "node",
  format: "esm",
  packages: "external",
  sourcemap: "inline",
  logLevel: "warning",
}).catch(() => process.exit(1)); // esbuild has told what is wrong
const built = files.map((file) => join(out, file.replace(/^test./, "").replace(/\.ts$/, ".mjs")));
const failed = await runFiles(built, kind);
console.log(failed.length ? `failed: ${failed.join(", ")}` : "all files passed");
process.exit(failed.length ? 1 : 0);

function tests(folder) {
  return readdirSync(folder, { withFileTypes: true }).flatMap((entry) => {
    const path = join(folder, entry.name);
    return entry.isDirectory() ? tests(path) : [path];
  });
}

function fail(line) {
  console.error(line);
  process.exit(2);
}
