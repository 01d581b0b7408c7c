/** Has Python write assets/, with the interpreter that PYTHON names, or `python`. */

import { spawnSync } from "node:child_process";

const root = new URL("../..", import.meta.url).pathname;
const python = process.env.PYTHON ?? "python";
const run = spawnSync(python, ["-m", "mute.web", "--out", "web/assets"], {
  cwd: root,
  stdio: "inherit",
});
if (run.error) console.error(`${python} cannot be started: ${run.error.message}`);
process.exit(run.status ?? 1);
