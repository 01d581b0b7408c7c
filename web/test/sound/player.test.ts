/** The page's end of the sound and the audio thread's, wired together without a browser. */

import assert from "node:assert/strict";
import { test } from "node:test";
import { setTimeout as sleep } from "node:timers/promises";
import { type FromProcessor, PROCESSOR, type ToProcessor } from "../../src/sound/messages";
import { openContext, Player, startPlayer } from "../../src/sound/player";
import { Playback } from "../../src/sound/playback";
import { READINGS_LENGTH } from "../../src/sound/readings";
import type { SoundTables } from "../../src/sound/tables";
import { readReferences, readTables, readWalk } from "./walks";

const references = readReferences();
const tables = readTables();
const walk = readWalk("wood-0", references);

/** One end of a channel, which delivers when it is told to. */
class Port<Out> {
  onmessage: ((event: { data: unknown }) => void) | null = null;
  readonly sent: Out[] = [];
  postMessage(message: Out): void {
    this.sent.push(message);
  }
}

interface Processor {
  readonly port: Port<FromProcessor>;
  process(inputs: Float32Array[][], outputs: Float32Array[][]): boolean;
}

/** Returns the audio thread's end, as its scope would make it. */
async function makeProcessor(): Promise<Processor> {
  let made: (new (options: object) => Processor) | undefined;
  Object.assign(globalThis, {
    sampleRate: 48000,
    AudioWorkletProcessor: class {
      readonly port = new Port<FromProcessor>();
    },
    registerProcessor(name: string, own: typeof made) {
      assert.equal(name, PROCESSOR);
      made = own;
    },
  });
  await import("../../src/sound/worklet");
  assert.ok(made, "nothing was registered");
  return new made({ processorOptions: { tables, soundscape: { surface: "wood" } } });
}

function steps(first: number, count: number): Float32Array {
  return walk.slice(first * READINGS_LENGTH, (first + count) * READINGS_LENGTH);
}

test("what the player is fed is played in shares of the full scale, and its levels are told", async () => {
  const processor = await makeProcessor();
  const port = new Port<ToProcessor>();
  const told: FromProcessor[] = [];
  const player = new Player({} as AudioContext, { port } as unknown as AudioWorkletNode);
  player.onLevels = (levels) => told.push(levels as FromProcessor);
  /** Delivers what either end has sent. */
  const deliver = () => {
    for (const data of port.sent.splice(0)) processor.port.onmessage?.({ data });
    for (const data of processor.port.sent.splice(0)) port.onmessage?.({ data });
  };
  const playback = new Playback(tables, { surface: "wood", sampleRate: 48000 });
  const stereo = [new Float32Array(128), new Float32Array(128)] as const;
  const wanted = new Float32Array(128);
  const play = (first: number) => {
    for (let step = first; step < first + 2000; step += 20) {
      player.feed(steps(step, 20));
      playback.feed(steps(step, 20));
      deliver();
      for (let block = 0; block < 7; block++) {
        assert.ok(processor.process([], [[...stereo]]));
        playback.play(wanted);
        assert.deepEqual(stereo[1], wanted.map((own) => own / tables.full_scale));
        assert.deepEqual(stereo[0], stereo[1]);
      }
    }
  };
  play(0);
  assert.ok(told.length > 20, `told ${told.length} times`);
  const last = told.at(-1) as FromProcessor;
  assert.ok(last.level > 55 && last.mnl > 55 && last.pnl >= last.mnl && last.seconds > 0.1);

  // Levels on their way while the walk begins anew are of the walk before, and are not told.
  processor.port.postMessage(last);
  const before = told.length;
  player.reset();
  deliver();
  assert.equal(told.length, before);
  playback.reset();
  player.setSurface("carpet");
  playback.setSurface("carpet");
  play(0);
  const anew = told.slice(before);
  assert.ok(anew.length > 20 && anew.every((levels) => levels.walk === 1));
  assert.ok(Number.isNaN(anew[0]?.mnl));
});

test("a part of an array is copied, and a whole one given away", () => {
  const given: ArrayBuffer[] = [];
  const port = {
    postMessage: (_: ToProcessor, transfer: ArrayBuffer[]) => given.push(...transfer),
  };
  const player = new Player({} as AudioContext, { port } as unknown as AudioWorkletNode);
  const whole = steps(0, 2);
  player.feed(whole);
  player.feed(whole.subarray(0, READINGS_LENGTH));
  assert.equal(given[0], whole.buffer);
  assert.notEqual(given[1], whole.buffer);
  assert.equal(given[1]?.byteLength, 4 * READINGS_LENGTH);
});

/** A context as a browser has it where worklets are not allowed. */
class Bare {
  closed = 0;
  resumed = 0;
  async resume(): Promise<void> {
    this.resumed++;
  }
  async close(): Promise<void> {
    this.closed++;
  }
}

test("a browser without Web Audio is told of in a line", () => {
  assert.throws(() => openContext(tables.sample_rate), /no Web Audio/);
});

test("a context runs from the gesture on, and is closed where anything is missing", async () => {
  Object.assign(globalThis, { AudioContext: Bare });
  const context = openContext(tables.sample_rate);
  const bare = context as unknown as Bare;
  assert.equal(bare.resumed, 1);
  await assert.rejects(startPlayer(context, tables, "worklet.js", { surface: "wood" }), /https or localhost/);
  assert.equal(bare.closed, 1);
  const missing = Promise.reject(new Error("sound.bin cannot be loaded (404)"));
  await assert.rejects(startPlayer(context, missing, "worklet.js", { surface: "wood" }), /sound\.bin/);
  assert.equal(bare.closed, 2);
});

test("that a context cannot be closed does not hide why it should be", async () => {
  const bare = new Bare();
  bare.close = () => Promise.reject(new Error("it is closed already"));
  const context = bare as unknown as AudioContext;
  await assert.rejects(startPlayer(context, tables, "worklet.js", { surface: "wood" }), /https or localhost/);
});

/** Something that others are connected to. */
class Wired {
  readonly port = new Port<ToProcessor>();
  onprocessorerror: (() => void) | null = null;
  connect(next: unknown): unknown {
    return next;
  }
}

/** A context that has all there is, and whose state is set by hand. */
class Whole extends Bare {
  state = "running";
  onstatechange: (() => void) | null = null;
  readonly audioWorklet = { addModule: async () => undefined };
  become(state: string): void {
    this.state = state;
    this.onstatechange?.();
  }
  async suspend(): Promise<void> {
    this.become("suspended");
  }
  override async resume(): Promise<void> {
    this.become("running");
  }
}

const never = () => new Promise<never>(() => undefined);
const parts = ["AudioWorkletNode", "GainNode", "BiquadFilterNode", "WaveShaperNode"];
Object.assign(globalThis, Object.fromEntries(parts.map((part) => [part, Wired])));
const begin = (context: Whole, loading: SoundTables | Promise<SoundTables> = tables) =>
  startPlayer(context as unknown as AudioContext, loading, "worklet.js", { surface: "wood" }, 20);

test("what never comes is not waited for, is told of, and its context is closed", async () => {
  const [one, two, three] = [new Whole(), new Whole(), new Whole()];
  await assert.rejects(begin(one, never()), /^Error: loading it took longer than 0\.02 s$/);
  two.audioWorklet.addModule = never;
  await assert.rejects(begin(two), /loading worklet\.js took longer/);
  three.resume = never;
  await assert.rejects(begin(three), /beginning to play took longer/);
  assert.deepEqual([one.closed, two.closed, three.closed], [1, 1, 1]);
});

test("sound that ends by itself says so, and what was asked for is no end", async () => {
  const context = new Whole();
  const node = new Wired() as unknown as AudioWorkletNode;
  const player = new Player(context as unknown as AudioContext, node, 20);
  const ends: string[] = [];
  player.onEnd = (why) => ends.push(why);
  for (const asked of [player.suspend(), player.resume()]) await asked;
  context.become("interrupted");
  await player.suspend(); // the tab was about to be hidden
  await sleep(60);
  await player.resume();
  await sleep(60);
  assert.deepEqual(ends, []);
  context.become("interrupted");
  await sleep(60);
  assert.deepEqual(ends, ["the browser stopped it"]);
  player.close();
  context.become("closed");
  await sleep(60);
  assert.equal(ends.length, 1);
});

test("an audio thread that fails says so", () => {
  const node = new Wired();
  const player = new Player(new Whole() as unknown as AudioContext, node as unknown as AudioWorkletNode);
  const ends: string[] = [];
  player.onEnd = (why) => ends.push(why);
  node.onprocessorerror?.();
  assert.deepEqual(ends, ["the audio thread failed"]);
});
