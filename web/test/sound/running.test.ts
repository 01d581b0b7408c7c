/** What happens while it runs: other floors, beginning anew, standing, running out of readings. */

import assert from "node:assert/strict";
import { test } from "node:test";
import { LevelMeter } from "../../src/sound/level_meter";
import { Playback } from "../../src/sound/playback";
import { READINGS_LENGTH, viewReadings } from "../../src/sound/readings";
import { Soundscape } from "../../src/sound/soundscape";
import { readReferences, readTables, readWalk } from "./walks";

const references = readReferences();
const tables = readTables();
const walk = readWalk("wood-0", references);
const walked = walk.length / READINGS_LENGTH;

/** Samples of a physics step. */
const STEP = 48;

/** Returns some steps of the walk, as a batch of their own. */
function steps(first: number, count: number): Float32Array {
  return walk.slice(first * READINGS_LENGTH, (first + count) * READINGS_LENGTH);
}

/** Renders steps of the walk. */
function render(soundscape: Soundscape, first: number, count: number): Float32Array {
  const out = new Float32Array(count * STEP);
  for (let step = 0; step < count; step++) {
    soundscape.step(viewReadings(walk, (first + step) % walked));
    soundscape.render(out.subarray(step * STEP, (step + 1) * STEP));
  }
  return out;
}

/** Returns the largest step between neighbouring samples. */
function steepest(...sounds: Float32Array[]): number {
  let largest = 0;
  let last = NaN;
  for (const sound of sounds) {
    for (const sample of sound) {
      const step = Math.abs(sample - last);
      if (step > largest) largest = step;
      last = sample;
    }
  }
  return largest;
}

function level(sound: Float32Array): number {
  const meter = new LevelMeter(tables);
  meter.update(sound);
  return meter.mnl;
}

/** Returns readings of a robot that stands still, its torques as they hold it. */
function standing(count: number): Float32Array {
  const readings = new Float32Array(count * READINGS_LENGTH);
  for (let step = 0; step < count; step++) {
    const into = viewReadings(readings, step);
    into.packed.set(viewReadings(walk, 0).packed);
    for (const zero of [into.landingSpeed, into.frictionPower, into.jointVelocity]) zero.fill(0);
    into.trunkPosition.set([0, 0, 0.3]);
    into.trunkQuaternion.set([1, 0, 0, 0]);
  }
  return readings;
}

test("a stand is the fan's 55 dBA at the trunk, and its 1/r elsewhere", () => {
  const still = standing(2000);
  const heard = (options: object) => {
    const soundscape = new Soundscape(tables, { surface: "wood", seed: 2, ...options });
    const out = new Float32Array(2000 * STEP);
    for (let step = 0; step < 2000; step++) {
      soundscape.step(viewReadings(still, step));
      soundscape.render(out.subarray(step * STEP, (step + 1) * STEP));
    }
    return level(out);
  };
  assert.ok(Math.abs(heard({}) - 55) < 0.3, `${heard({})} dBA`);
  const beside = heard({ microphone: { mount: "beside", offset: [0, 0.6, 0.3] } });
  assert.ok(Math.abs(beside - (55 - 6.02)) < 0.3, `${beside} dBA at twice the distance`);
});

test("a landing sounds the same at other physics steps", () => {
  const landing = standing(1);
  viewReadings(landing).landingSpeed[2] = 0.4;
  viewReadings(landing).landingMass[2] = 0.6;
  const still = standing(1);
  const [fine, coarse] = [0.001, 0.002].map((timestep) => {
    const soundscape = new Soundscape(tables, { surface: "tile", timestep, sources: ["impacts", "body"] });
    soundscape.step(viewReadings(landing));
    for (let time = timestep; time < 0.3; time += timestep) soundscape.step(viewReadings(still));
    const out = new Float32Array(0.3 * 48000);
    soundscape.render(out);
    return out;
  }) as [Float32Array, Float32Array];
  const peak = fine.reduce((most, own) => Math.max(most, Math.abs(own)), 0);
  assert.ok(peak > 0.1, `${peak} Pa`);
  fine.forEach((sample, i) => {
    assert.ok(Math.abs(sample - (coarse[i] as number)) < 1e-3 * peak, `sample ${i}`);
  });
});

test("another floor is heard from the next landing on, and the old one rings out", () => {
  const soundscape = new Soundscape(tables, { surface: "wood", sources: ["impacts"] });
  const before = render(soundscape, 0, 1200);
  soundscape.setSurface("carpet");
  const ringing = render(soundscape, 1200, 800);
  const after = render(soundscape, 0, 1200);
  assert.ok(level(before) > 60, `${level(before)} dBA on wood`);
  assert.ok(level(after) < 30, `${level(after)} dBA on carpet`);
  assert.ok(steepest(before, ringing) <= 1.01 * steepest(before), "it clicks");
  soundscape.setSurface("wood");
  assert.ok(Math.abs(level(render(soundscape, 0, 1200)) - level(before)) < 0.2);
  assert.throws(() => soundscape.setSurface("lava"), /lava.*is not known/);
});

test("beginning anew is silent but for the fan, and does not click", () => {
  const soundscape = new Soundscape(tables, { surface: "wood", sources: ["impacts", "body", "drive"] });
  const before = render(soundscape, 0, 700);
  soundscape.reset();
  assert.equal(soundscape.queued, 0);
  const still = standing(1000);
  const after = new Float32Array(1000 * STEP);
  for (let step = 0; step < 1000; step++) {
    soundscape.step(viewReadings(still, step));
    soundscape.render(after.subarray(step * STEP, (step + 1) * STEP));
  }
  assert.ok(steepest(before, after) <= 1.01 * steepest(before), "it clicks");
  assert.ok(level(after) < 20, `${level(after)} dBA`);
  const anew = render(soundscape, 0, 700);
  assert.ok(Math.abs(level(anew) - level(before)) < 0.5, `${level(anew)} for ${level(before)} dBA`);
});

test("where readings run out it fades within milliseconds, and goes on without a click", () => {
  const soundscape = new Soundscape(tables, { surface: "wood" });
  const before = render(soundscape, 0, 500);
  const gap = new Float32Array(4800);
  assert.equal(soundscape.render(gap), 0);
  assert.ok(Math.max(...gap.subarray(1440).map(Math.abs)) < 1e-4);
  const after = render(soundscape, 500, 500);
  assert.ok(steepest(before, gap, after) <= 1.01 * steepest(before, after), "it clicks");
});

test("a simulation that blew up is not heard, and what comes after it is", () => {
  const soundscape = new Soundscape(tables, { surface: "wood" });
  const before = level(render(soundscape, 0, 1000));
  const broken = viewReadings();
  for (const value of [NaN, Infinity]) {
    broken.packed.fill(value);
    soundscape.step(broken);
  }
  assert.equal(soundscape.queued, 0);
  assert.ok(Math.abs(level(render(soundscape, 0, 1000)) - before) < 0.5);
});

test("of too many steps the oldest go", () => {
  const soundscape = new Soundscape(tables, { surface: "wood" });
  for (let step = 0; step < 1700; step++) soundscape.step(viewReadings(walk, step));
  assert.equal(soundscape.queued, soundscape.room);
});

/** Plays for a time, in the blocks that audio threads ask for. */
function play(playback: Playback, seconds: number, feed: (time: number) => void): Float32Array {
  const out = new Float32Array(Math.round((seconds * 48000) / 128) * 128);
  for (let at = 0; at < out.length; at += 128) {
    feed(at / 48000);
    playback.play(out.subarray(at, at + 128));
  }
  return out;
}

/** Returns what feeds a playback a control step of 20 ms at a time, as the page does. */
function feeder(playback: Playback): (time: number) => void {
  let fed = 0;
  return (time) => {
    while (fed < Math.floor(time / 0.02)) {
      playback.feed(steps((20 * fed) % (walked - 20), 20));
      fed++;
    }
  };
}

test("playing keeps a short supply and does not run out of it", () => {
  const playback = new Playback(tables, { surface: "wood" });
  const sound = play(playback, 3, feeder(playback));
  assert.ok(playback.isPlaying);
  assert.ok(playback.waiting > 0.03 && playback.waiting < 0.15, `${playback.waiting} s`);
  const first = sound.findIndex((sample) => sample !== 0);
  assert.ok(first / 48000 < 0.12, `begins after ${first / 48000} s`);
  assert.ok(playback.meter.mnl > 66 && playback.meter.mnl < 71, `${playback.meter.mnl} dBA`);
});

test("after a hidden tab, whose steps come all at once, there is no burst and no delay", () => {
  const playback = new Playback(tables, { surface: "wood" });
  const before = play(playback, 2.4, feeder(playback));
  const loudest = playback.meter.pnl;
  const drained = play(playback, 0.5, () => undefined);
  assert.ok(!playback.isPlaying);
  for (let round = 0; round < 10; round++) playback.feed(steps(0, 1000));
  const after = play(playback, 2.4, feeder(playback));
  assert.ok(playback.waiting < 0.3, `${playback.waiting} s behind`);
  const peak = (sound: Float32Array) => sound.reduce((most, own) => Math.max(most, Math.abs(own)), 0);
  assert.ok(peak(after) < 1.2 * peak(before), `${peak(after)} Pa after ${peak(before)} Pa`);
  assert.ok(playback.meter.pnl < loudest + 1, `${playback.meter.pnl} dBA after ${loudest} dBA`);
  assert.ok(steepest(before, drained, after) < 1.3 * steepest(before), "it clicks");
});

test("a walk that begins anew has figures of its own, and what waits is left out", () => {
  const playback = new Playback(tables, { surface: "wood" });
  play(playback, 2.4, feeder(playback));
  playback.reset();
  assert.equal(playback.waiting, 0);
  assert.ok(Number.isNaN(playback.meter.mnl));
  playback.setSurface("carpet");
  play(playback, 2.4, feeder(playback));
  assert.ok(playback.meter.mnl < 67, `${playback.meter.mnl} dBA on carpet`);
});

test("the audio thread makes no arrays as it plays", () => {
  const playback = new Playback(tables, { surface: "wood" });
  const batches = Array.from({ length: 100 }, (_, index) => steps(20 * index, 20));
  const out = new Float32Array(128);
  const arrays = [Float32Array, Float64Array, Int32Array] as const;
  const made: string[] = [];
  const forbidden = (name: string, own: new (...given: never[]) => object) =>
    new Proxy(own, {
      construct(target, given) {
        made.push(name);
        return Reflect.construct(target, given) as object;
      },
    });
  const subarrays = arrays.map((own) => own.prototype.subarray);
  try {
    arrays.forEach((own) => {
      Object.assign(globalThis, { [own.name]: forbidden(own.name, own) });
      own.prototype.subarray = () => {
        throw new Error("a view is an allocation, too");
      };
    });
    for (const [index, batch] of batches.entries()) {
      playback.feed(batch);
      if (index === 50) playback.setSurface("tile");
      for (let block = 0; block < 7; block++) playback.play(out);
    }
  } finally {
    arrays.forEach((own, index) => {
      Object.assign(globalThis, { [own.name]: own });
      own.prototype.subarray = subarrays[index] as never;
    });
  }
  assert.deepEqual(made, []);
  assert.ok(playback.meter.level > 50, "nothing was played");
});

test("what a robot does after a fall is in no figure until it walks again, and what was before stays", () => {
  const playback = new Playback(tables, { surface: "wood" });
  const out = new Float32Array(STEP);
  /** Plays seconds of the walk, or of one that is ten times as loud. */
  const play = (seconds: number, loud = false) => {
    for (let step = 0; step < 1000 * seconds; step++) {
      const batch = steps(step % walked, 1);
      if (loud) {
        const { jointTorque } = viewReadings(batch);
        jointTorque.set(jointTorque.map((own) => 10 * own));
      }
      playback.feed(batch);
      playback.play(out);
    }
  };
  play(4);
  const { mnl, pnl, readings } = playback.meter;
  assert.ok(readings > 30, `${readings} readings`);
  playback.leaveOut();
  play(1.4, true);
  assert.deepEqual(
    [playback.meter.mnl, playback.meter.pnl, playback.meter.readings],
    [mnl, pnl, readings],
  );
  play(1);
  assert.ok(playback.meter.readings > readings + 5);
  playback.measureAnew();
  assert.ok(Number.isNaN(playback.meter.mnl));
  play(1.4);
  assert.equal(playback.meter.readings, 0);
  play(0.5);
  assert.ok(playback.meter.mnl > 55);
});
