/** Has Python write assets/, with the interpreter that PYTHON names, or `python`. */

import { spawnSync } from "node:child_process";
import { CHECKOUT } from "./places.mjs";

const python = process.env.PYTHON ?? "python";
const run = spawnSync(python, ["-m", "mute.web", "--out", "web/assets"], {
  cwd: CHECKOUT,
  stdio: "inherit",
});
if (run.error) {
  console.error(`${python} cannot be started (${run.error.code}): name one that has MUTE by PYTHON=`);
}
process.exit(run.status ?? 1);
