/** Who drives: what was asked for last, whatever comes first. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { Drivers } from "../src/policy/drivers.js";
import { PolicyShelf } from "../src/policy/shelf.js";
import { asset, page } from "./files.js";

const robot = { jointNames: page.joint_names, timestep: 0.001 };
const shipped = new Uint8Array(asset("go1_mute.onnx"));

/** Two policies of the page, whose files come when they are let. */
function choosing() {
  const coming = new Map<string, (file: Uint8Array) => void>();
  const load = (file: string) =>
    new Promise<Uint8Array>((resolve) => coming.set(file, resolve));
  const entries = ["slow", "quick"].map((name) => ({ name, label: name, file: `${name}.onnx` }));
  const shelf = new PolicyShelf(entries, robot, load);
  const used: string[] = [];
  const told: string[] = [];
  const listed: string[] = [];
  let kept = 0;
  const drivers = new Drivers(
    shelf,
    { addController: (name) => listed.push(name), tell: (line) => told.push(line) },
    (name) => used.push(name),
    () => kept++,
  );
  const come = (name: string, file = shipped) => coming.get(`${name}.onnx`)?.(file);
  return { drivers, shelf, used, told, listed, come, kept: () => kept };
}

test("of two policies that are asked for, the last one drives, though it comes first", async () => {
  const { drivers, used, told, come } = choosing();
  const slow = drivers.choose("slow");
  const quick = drivers.choose("quick");
  come("quick");
  await quick;
  come("slow");
  assert.deepEqual([await quick, await slow], [true, false]);
  assert.deepEqual(used, ["quick"]);
  assert.deepEqual(told, ["quick drives from now on."]);
});

test("a file that was dropped gives way to what was chosen after it, and is in the list", async () => {
  const { drivers, used, listed, come } = choosing();
  const dropped = drivers.open(new File([shipped], "mine.onnx"));
  const chosen = drivers.choose("quick");
  await dropped;
  come("quick");
  await chosen;
  assert.deepEqual([used, listed], [["quick"], ["mine.onnx"]]);
});

test("what cannot drive leaves what drives, unless something else was asked for", async () => {
  const { drivers, used, told, come, kept } = choosing();
  const broken = drivers.choose("slow");
  come("slow", new Uint8Array(4));
  await broken;
  assert.deepEqual([used, kept(), told.length], [[], 1, 1]);
  assert.match(told[0] ?? "", /^slow: it is no policy that MUTE exported/);
  const late = drivers.choose("slow");
  const wanted = drivers.choose("quick");
  come("quick");
  await wanted;
  come("slow", new Uint8Array(4));
  await late;
  assert.deepEqual([used, kept(), told.length], [["quick"], 1, 2]);
});

test("a file by the name of a policy of the page takes nothing from it", async () => {
  const { drivers, shelf, used } = choosing();
  await drivers.open(new File([shipped], "quick"));
  assert.deepEqual(used, ["quick (file)"]);
  assert.equal(shelf.shared("quick (file)"), "slow");
});
