/** Bundles the benchmark of the sound, which is TypeScript, and runs it: npm run bench:sound. */

import { spawnSync } from "node:child_process";
import { join } from "node:path";
import { build } from "esbuild";

const root = new URL("../..", import.meta.url).pathname;
const outfile = join(root, ".test", "bench", "sound.mjs");
await build({
  entryPoints: [join(root, "test/sound/benchmark.ts")],
  outfile,
  bundle: true,
  platform: "node",
  format: "esm",
  logLevel: "warning",
});
const run = spawnSync(process.execPath, [outfile], { cwd: root, stdio: "inherit" });
process.exit(run.status ?? 1);
