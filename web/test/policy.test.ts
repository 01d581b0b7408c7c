/** The policy in the page does what ONNX Runtime does, and refuses every other file in one line. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { buildGraph } from "../src/policy/graph.js";
import { readOnnx } from "../src/policy/onnx_file.js";
import { Policy, PolicyError } from "../src/policy/policy.js";
import { fields } from "../src/policy/protobuf.js";
import { PolicyShelf } from "../src/policy/shelf.js";
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
    action.forEach((value, joint) => {
      worst = Math.max(worst, Math.abs(value - (expected[joint] as number)));
    });
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
    (damaged[at] as number) ^= 0xff;
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

/** Returns a field of a message, of bytes. */
function field(number: number, content: Uint8Array): Uint8Array {
  const varint = (value: number): number[] =>
    value < 0x80 ? [value] : [(value & 0x7f) | 0x80, ...varint(Math.floor(value / 0x80))];
  return Uint8Array.from([...varint(8 * number + 2), ...varint(content.length), ...content]);
}

const letters = (word: string) => new TextEncoder().encode(word);

/** Returns the policy that ships with more nodes: operator, inputs and output of each. */
function withNodes(...nodes: (readonly [string, readonly string[], string])[]): Uint8Array {
  const more = nodes.map(([operator, inputs, output]) => {
    const parts = [...inputs.map((name) => field(1, letters(name))), field(2, letters(output))];
    return field(1, Buffer.concat([...parts, field(4, letters(operator))]));
  });
  const parts = [...fields(shipped())].map(({ number, integer, bytes }) => {
    if (number === 7) return field(7, Buffer.concat([bytes, ...more]));
    return bytes.length ? field(number, bytes) : Uint8Array.of(8 * number, integer);
  });
  return new Uint8Array(Buffer.concat(parts));
}

/** Returns a policy with another entry of its metadata. */
function withMetadata(name: string, value: string, file = shipped()): Uint8Array {
  const entry = Buffer.concat([field(1, letters(name)), field(2, letters(value))]);
  const parts = [...fields(file)].map(({ number, integer, bytes }) => {
    if (number === 14 && Buffer.from(bytes).includes(`${name}`)) return field(14, entry);
    return bytes.length ? field(number, bytes) : Uint8Array.of(8 * number, integer);
  });
  return new Uint8Array(Buffer.concat(parts));
}

test("gains, scales and limits that no robot has are refused, each in one line", () => {
  const twelve = (value: number) => Array.from({ length: 12 }, () => value).join(",");
  assert.equal(refusal(withMetadata("joint_stiffness", twelve(35))), "");
  const refused: readonly (readonly [string, string, RegExp])[] = [
    ["joint_stiffness", twelve(-5), /joint_stiffness must be from 0 to 10000 N m\/rad, one is -5$/],
    ["joint_stiffness", twelve(1e7), /one is 10000000$/],
    ["joint_damping", twelve(-0.5), /joint_damping must be from 0 to 1000 N m s\/rad, one is -0.5$/],
    ["default_joint_pos", twelve(40), /default_joint_pos must be from -6.28 to 6.28 rad, one is 40$/],
    ["action_scale", twelve(-0.25), /action_scale must be from 0 to 100 rad, one is -0.25$/],
    ["action_clip", "-1", /action_clip must be from 0 to 1000000, one is -1$/],
  ];
  for (const [name, value, line] of refused) assert.match(refusal(withMetadata(name, value)), line);
  const scales = { base_ang_vel: 1e9, projected_gravity: 1, joint_pos: 1 };
  const all = JSON.stringify({ ...scales, joint_vel: 0.05, last_action: 1, command: 1 });
  assert.match(refusal(withMetadata("observation_scales", all)), /observation_scales must be from/);
});

test("numbers are held between two bounds, and bounds that are none are refused", () => {
  const number = (value: number) => ({ shape: [1], data: Float32Array.of(value) });
  const graph = (...inputs: string[]) =>
    buildGraph(
      {
        nodes: [{ operator: "Clip", inputs, outputs: ["y"], attributes: new Map() }],
        constants: new Map([
          ["low", number(-0.5)],
          ["high", number(2)],
        ]),
        inputs: new Map([["x", [1, 4]]]),
        outputs: ["y"],
        metadata: new Map(),
      },
      0.02,
    );
  const held = graph("x", "low", "high");
  held.inputs.get("x")?.set([-3, -0.5, 1.25, 7]);
  held.run();
  assert.deepEqual([...(held.outputs.get("y") ?? [])], [-0.5, -0.5, 1.25, 2]);
  for (const inputs of [["x", "low"], ["x", "x", "high"], ["x"]]) {
    assert.throws(() => graph(...inputs), /a Clip is of a form that is not known here/);
  }
});

test("a policy that would take too long for a control step is refused, one with some more to do is not", () => {
  const { nodes, constants } = readOnnx(shipped());
  const wide = [...constants].find(([, { data }]) => data.length > 20_000)?.[0] ?? "";
  assert.ok(wide && nodes.length > 5);
  const adding = (count: number) =>
    withNodes(
      ...Array.from({ length: count }, (_, i) => ["Add", [wide, wide], `more ${i}`] as const),
    );
  assert.equal(refusal(adding(3)), "");
  // What comes more often has less time; what comes more rarely would hold up the page as long.
  assert.equal(refusal(withMetadata("control_dt", "0.001")), "");
  assert.match(refusal(withMetadata("control_dt", "0.001", adding(3))), /takes too long/);
  assert.match(refusal(withMetadata("control_dt", "1", adding(200))), /takes too long/);
  assert.match(refusal(adding(200)), /a control step of it takes too long/);
});

test("a file that is too large is refused before it is read", async () => {
  const shelf = new PolicyShelf(page.controllers, robot, async () => shipped());
  let reads = 0;
  const file = {
    size: 40 << 20,
    arrayBuffer: async () => {
      reads++;
      return new ArrayBuffer(0);
    },
  };
  await assert.rejects(shelf.add("large.onnx", file as unknown as Blob), /larger than 32 MB/);
  assert.equal(reads, 0);
});
