/** The policy in the page does what ONNX Runtime does, and refuses every other file in one line. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { Policy, PolicyError } from "../src/policy/policy.js";
import { asset, page, reference } from "./files.js";

const robot = { jointNames: page.joint_names, timestep: 0.001 };
const shipped = () => asset("go1_mute.onnx");

test("the policy acts as ONNX Runtime over 500 control steps of a walk", () => {
  const policy = new Policy(shipped(), robot);
  const kept = new Float32Array(reference("acted.bin").slice().buffer);
  const steps = kept.length / (46 + 12);
  assert.equal(steps, 500);
  let worst = 0;
  for (let step = 0; step < steps; step++) {
    const action = policy.actOn(kept.subarray(46 * step, 46 * (step + 1)));
    const expected = kept.subarray(46 * steps + 12 * step, 46 * steps + 12 * (step + 1));
    action.forEach((value, joint) => (worst = Math.max(worst, Math.abs(value - expected[joint]))));
  }
  assert.ok(worst < 1e-5, `it is off by ${worst}`);
  assert.ok(worst > 0, "two ways to sum up must differ somewhere");
});

test("a policy that was reset acts as a new one", () => {
  const policy = new Policy(shipped(), robot);
  const seen = Float32Array.from({ length: 46 }, (_, i) => Math.sin(i));
  const first = policy.actOn(seen).slice();
  assert.notDeepEqual(policy.actOn(seen), first);
  policy.reset();
  assert.deepEqual(policy.actOn(seen), first);
});

function refusal(file: Uint8Array, fits = robot): string {
  try {
    new Policy(file, fits);
  } catch (error) {
    assert.ok(error instanceof PolicyError, String(error));
    assert.ok(!error.message.includes("\n"));
    return error.message;
  }
  return "";
}

test("a file cut short anywhere, or with bytes changed, is refused or still a policy", () => {
  const file = shipped();
  for (const length of [0, 1, 7, 100, 2000, file.length >> 1, file.length - 1]) {
    assert.match(refusal(file.subarray(0, length)), /no policy that MUTE exported/);
  }
  for (let at = 0; at < 6000; at += 13) {
    const damaged = file.slice();
    damaged[at] ^= 0xff;
    refusal(damaged); // throws unless it is refused in the right way, or taken
  }
});

test("foreign files are refused, each in one line", () => {
  assert.match(refusal(new TextEncoder().encode("# no policy")), /no policy that MUTE exported/);
  assert.match(refusal(asset("flat.xml")), /no policy that MUTE exported/);
  assert.match(refusal(new Uint8Array(33 << 20)), /larger than 32 MB/);
  const other = { ...robot, jointNames: ["knee"] };
  assert.match(refusal(shipped(), other), /other joint_names/);
  assert.match(refusal(shipped(), { ...robot, timestep: 0.003 }), /control_dt is no multiple/);
});
