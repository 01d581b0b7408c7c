/** Bundles the benchmark of the sound, which is TypeScript, and runs it: npm run bench:sound. */

import { spawnSync } from "node:child_process";
import { join } from "node:path";
import { build } from "esbuild";
import { WEB } from "../../build/places.mjs";

const outfile = join(WEB, ".test", "bench", "sound.mjs");
await build({
  entryPoints: [join(WEB, "test/sound/benchmark.ts")],
  outfile,
  bundle: true,
  platform: "node",
  format: "esm",
  logLevel: "warning",
});
const run = spawnSync(process.execPath, [outfile], { cwd: WEB, stdio: "inherit" });
process.exit(run.status ?? 1);
