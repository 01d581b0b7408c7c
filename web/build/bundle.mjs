/** Bundles the page into dist/, for any server of files: node build/bundle.mjs. */

import { cpSync, existsSync, mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { gzipSync } from "node:zlib";
import { build } from "esbuild";
import { licensesText } from "./licenses.mjs";
import { WEB } from "./places.mjs";

const out = join(WEB, "dist");
const assets = join(WEB, "assets");

/** Most that the page may weigh compressed, bytes. */
const HEAVIEST = 8e6;

/** What the page loads beside its controllers, see `mute/web/assets.py`. */
const ALWAYS = ["page.json", "flat.xml", "stairs.xml", "sound.json", "sound.bin"];

const loaded = assetNames();
rmSync(out, { recursive: true, force: true });
mkdirSync(out);
const { metafile } = await build({
  entryPoints: {
    main: join(WEB, "src/main.ts"),
    "sound-worklet": join(WEB, "src/sound/worklet.ts"),
  },
  absWorkingDir: WEB,
  outdir: out,
  bundle: true,
  minify: true,
  format: "esm",
  target: ["es2022", "chrome110", "firefox113", "safari16.4"],
  external: ["module"], // MuJoCo's loader asks for it in node alone
  legalComments: "none", // in full in licenses.txt
  banner: { js: "/* Licences of all parts: licenses.txt */" },
  metafile: true,
  logLevel: "warning",
}).catch(() => process.exit(1)); // esbuild has told what is wrong
for (const name of ["index.html", "style.css"]) cpSync(join(WEB, "src", name), join(out, name));
cpSync(join(WEB, "node_modules/@mujoco/mujoco/mujoco.wasm"), join(out, "mujoco.wasm"));
for (const name of loaded) cpSync(join(assets, name), join(out, name));
try {
  writeFileSync(join(out, "licenses.txt"), licensesText(Object.keys(metafile.inputs)));
} catch (error) {
  fail(error.message);
}

let sum = 0;
let bytes = 0;
for (const name of readdirSync(out).sort()) {
  const file = readFileSync(join(out, name));
  const packed = gzipSync(file, { level: 9 }).length;
  sum += packed;
  bytes += file.length;
  print(name, file.length, packed);
}
print("in all", bytes, sum);
if (sum > HEAVIEST) fail(`the page weighs more than ${HEAVIEST / 1e6} MB compressed`);

/** Returns the names of the assets that the page asks for; what else lies there stays there. */
function assetNames() {
  let names = ALWAYS;
  if (existsSync(join(assets, "page.json"))) {
    const { controllers } = JSON.parse(readFileSync(join(assets, "page.json"), "utf8"));
    names = [...ALWAYS, ...controllers.map(({ file }) => file)];
  }
  const missing = names.filter((name) => !existsSync(join(assets, name)));
  if (missing.length) fail(`web/assets lacks ${missing.join(", ")}: have it made by npm run assets`);
  return names;
}

function print(name, bytes, packed) {
  console.log(`${name.padEnd(18)} ${kilobytes(bytes)} kB, compressed ${kilobytes(packed)} kB`);
}

function kilobytes(bytes) {
  return (bytes / 1000).toFixed(0).padStart(6);
}

function fail(line) {
  console.error(line);
  process.exit(1);
}
