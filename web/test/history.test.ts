/** A policy that looks back at the last observations, as DreamWaQ's do, acts as in ONNX Runtime. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { Policy } from "../src/policy/policy.js";
import { page, reference } from "./files.js";

const robot = { jointNames: page.joint_names, timestep: 0.001 };
const kept = new Float32Array(reference("history.bin").slice().buffer);
const steps = kept.length / (46 + 12);
const seen = (step: number) => kept.subarray(46 * step, 46 * (step + 1));
const expected = (step: number) => kept.subarray(46 * steps + 12 * step).subarray(0, 12);

function furthest(action: Float32Array, step: number): number {
  return Math.max(...action.map((value, joint) => Math.abs(value - (expected(step)[joint] as number))));
}

test("a policy with a history acts as ONNX Runtime over 200 control steps", () => {
  const policy = new Policy(reference("history.onnx"), robot);
  assert.equal(steps, 200);
  let worst = 0;
  for (let step = 0; step < steps; step++) {
    worst = Math.max(worst, furthest(policy.actOn(seen(step)), step));
  }
  assert.ok(worst < 1e-5, `it is off by ${worst}`);
});

test("a policy with a history looks back five observations, and no further", () => {
  const policy = new Policy(reference("history.onnx"), robot);
  const off = [...Array(6).keys()].map((step) => furthest(policy.actOn(seen(100 + step)), 100 + step));
  assert.ok(Math.min(...off.slice(0, 4)) > 1e-3, `it differs by ${off} until it has seen five`);
  assert.ok(Math.max(...off.slice(4)) < 1e-5, `it differs by ${off}`);
});
