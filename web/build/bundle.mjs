/** Bundles the page into dist/, for any server of files: node build/bundle.mjs. */

import { cpSync, existsSync, mkdirSync, readdirSync, readFileSync, rmSync } from "node:fs";
import { basename, join } from "node:path";
import { gzipSync } from "node:zlib";
import { build } from "esbuild";

const root = new URL("..", import.meta.url).pathname;
const out = join(root, "dist");
const assets = join(root, "assets");

/** Most that the page may weigh compressed, bytes. */
const HEAVIEST = 8e6;

if (!existsSync(join(assets, "page.json"))) {
  console.error("there are no assets: npm run assets, or python -m mute.web --out web/assets");
  process.exit(1);
}
rmSync(out, { recursive: true, force: true });
mkdirSync(out);
const worklet = join(root, "src/sound/worklet.ts");
await build({
  entryPoints: {
    main: join(root, "src/main.ts"),
    ...(existsSync(worklet) ? { "sound-worklet": worklet } : {}),
  },
  outdir: out,
  bundle: true,
  minify: true,
  format: "esm",
  target: ["es2022", "chrome110", "firefox113", "safari16.4"],
  external: ["module"], // MuJoCo's loader asks for it in node alone
  legalComments: "eof",
  logLevel: "warning",
});
for (const name of ["index.html", "style.css"]) cpSync(join(root, "src", name), join(out, name));
cpSync(join(root, "node_modules/@mujoco/mujoco/mujoco.wasm"), join(out, "mujoco.wasm"));
for (const name of readdirSync(assets)) cpSync(join(assets, name), join(out, basename(name)));

let sum = 0;
for (const name of readdirSync(out).sort()) {
  const file = readFileSync(join(out, name));
  const packed = gzipSync(file, { level: 9 }).length;
  sum += packed;
  console.log(
    `${name.padEnd(18)} ${kilobytes(file.length)} kB, compressed ${kilobytes(packed)} kB`,
  );
}
console.log(`${"in all".padEnd(18)} compressed ${kilobytes(sum)} kB`);
if (sum > HEAVIEST) {
  console.error(`the page weighs more than ${kilobytes(HEAVIEST)} kB compressed`);
  process.exit(1);
}

function kilobytes(bytes) {
  return (bytes / 1000).toFixed(0).padStart(6);
}
