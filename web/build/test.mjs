/** Bundles the tests, which are TypeScript, and runs them: node build/test.mjs node|browser [file]. */

import { spawnSync } from "node:child_process";
import { readdirSync, rmSync } from "node:fs";
import { join } from "node:path";
import { build } from "esbuild";

const [kind = "node", only = ""] = process.argv.slice(2);
const root = new URL("..", import.meta.url).pathname;
const out = join(root, ".test", kind);

function tests(folder) {
  return readdirSync(join(root, folder), { withFileTypes: true, recursive: false }).flatMap(
    (entry) => (entry.isDirectory() ? tests(join(folder, entry.name)) : [join(folder, entry.name)]),
  );
}

const suffix = kind === "browser" ? ".browser.ts" : ".test.ts";
const files = tests("test").filter((file) => file.endsWith(suffix) && file.includes(only));
rmSync(out, { recursive: true, force: true });
await build({
  entryPoints: files.map((file) => join(root, file)),
  outdir: out,
  outbase: join(root, "test"),
  outExtension: { ".js": ".mjs" },
  bundle: true,
  platform: "node",
  format: "esm",
  packages: "external",
  sourcemap: "inline",
  logLevel: "warning",
});
const built = files.map((file) => join(out, file.replace(/^test\//, "").replace(/\.ts$/, ".mjs")));
// One browser at a time, or each would slow the other down.
const runs = kind === "browser" ? built.map((file) => [file]) : [built];
const failed = runs.filter((part) => {
  const words = ["--enable-source-maps", "--test", ...part];
  return spawnSync(process.execPath, words, { cwd: root, stdio: "inherit" }).status !== 0;
});
process.exit(failed.length ? 1 : 0);
