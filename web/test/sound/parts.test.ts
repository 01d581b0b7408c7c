/** The parts of the sound by themselves: recorder, meter, places, tables. */

import assert from "node:assert/strict";
import { test } from "node:test";
import { contactFigures } from "../../src/physics/page_data";
import { Blow } from "../../src/sound/blow";
import { placeStruck } from "../../src/sound/landings";
import { LevelMeter } from "../../src/sound/level_meter";
import { Microphone } from "../../src/sound/microphone";
import { FEET, READINGS_LENGTH, viewReadings } from "../../src/sound/readings";
import { Recorder } from "../../src/sound/recorder";
import { type FloorTable, type LawTable, loadSoundTables } from "../../src/sound/tables";
import { page } from "../files";
import { readReferences, readSensors, readTables } from "./walks";

const references = readReferences();
const tables = readTables();

test("the recorder finds the landings and the sliding that Python's finds", () => {
  const rows = readSensors();
  const width = FEET + 4 * 3 * FEET;
  const recorder = new Recorder(references.timestep, references.recorded.friction, contactFigures(page));
  const into = viewReadings();
  const sliding: number[][] = [];
  const landings: number[][] = [];
  for (let step = 0; step < rows.length / width; step++) {
    const part = (index: number, length: number) => {
      const from = step * width + index;
      return rows.subarray(from, from + length);
    };
    const feet = {
      contact: part(0, FEET),
      position: part(FEET, 12),
      velocity: part(FEET + 12, 12),
      angularVelocity: part(FEET + 24, 12),
      force: part(FEET + 36, 12),
    };
    recorder.record(feet, () => 0.5, into);
    for (let foot = 0; foot < FEET; foot++) {
      const power = into.frictionPower[foot] as number;
      if (power > 0) sliding.push([step, foot, power]);
      const speed = into.landingSpeed[foot] as number;
      if (speed > 0) landings.push([step, foot, speed]);
      assert.equal(into.landingMass[foot], speed > 0 ? 0.5 : 0);
    }
  }
  assertRows(sliding, references.recorded.sliding);
  assertRows(landings, references.recorded.landings);
  assert.ok(landings.length > 2 && sliding.length > 20, "nothing happened");
});

function assertRows(found: number[][], wanted: readonly (readonly number[])[]): void {
  assert.deepEqual(
    found.map(([step, foot]) => [step, foot]),
    wanted.map(([step, foot]) => [step, foot]),
  );
  found.forEach((row, index) => {
    const value = wanted[index]?.[2] as number;
    assert.ok(Math.abs((row[2] as number) - value) < 1e-4 * value + 1e-6, `${row} for ${value}`);
  });
}

test("a robot that begins anew does not land at once, and a foot that bounces does not either", () => {
  const recorder = new Recorder(0.001, 0.8, contactFigures(page));
  const into = viewReadings();
  const zeros = new Float32Array(12);
  const falling = Float32Array.from({ length: 12 }, (_, i) => (i % 3 === 2 ? -0.4 : 0));
  const record = (touches: boolean) => {
    const contact = new Float32Array(FEET).fill(touches ? 1 : 0);
    const feet = { contact, position: zeros, velocity: falling, angularVelocity: zeros, force: zeros };
    recorder.record(feet, () => 1, into);
    return into.landingSpeed[0] as number;
  };
  assert.equal(record(true), 0);
  for (let step = 0; step < 4; step++) record(false);
  assert.equal(record(true), 0, "4 ms are no flight");
  for (let step = 0; step < 5; step++) record(false);
  assert.ok(Math.abs(record(true) - 0.4) < 1e-6);
  recorder.restart();
  for (let step = 0; step < 50; step++) record(false);
  assert.equal(record(true), 0, "it was put down");
  for (let step = 0; step < 50; step++) record(false);
  assert.ok(record(true) > 0);
});

test("the meter reads what Python's reads of a tone that is swept", () => {
  const rate = tables.sample_rate;
  const sound = new Float32Array(3 * rate);
  const growth = Math.log(10000 / 50) / 3;
  for (let i = 0; i < sound.length; i++) {
    const time = i / rate;
    const swell = 0.5 - 0.5 * Math.cos((2 * Math.PI * time) / 0.75);
    const phase = ((2 * Math.PI * 50) / growth) * (Math.exp(growth * time) - 1);
    sound[i] = swell * Math.sin(phase) + 0.1;
  }
  const meter = new LevelMeter(tables);
  for (let at = 0; at < sound.length; at += 128) meter.update(sound.subarray(at, at + 128));
  assert.equal(meter.readings, references.meter.readings);
  for (const figure of ["mnl", "pnl", "laeq", "lafmax"] as const) {
    const off = meter[figure] - references.meter[figure];
    assert.ok(Math.abs(off) < 0.005, `${figure}: ${off} dB from Python's`);
  }
});

test("a meter that forgets keeps what its detector has heard, and one that is reset does not", () => {
  const tone = Float32Array.from({ length: 48000 }, (_, i) => Math.sin(i * 0.13));
  const meter = new LevelMeter(tables);
  meter.update(tone);
  const { level } = meter;
  meter.forget(0.2);
  assert.equal(meter.level, level);
  assert.ok(Number.isNaN(meter.mnl));
  meter.update(tone.subarray(0, 9599));
  assert.equal(meter.readings, 0);
  meter.update(tone.subarray(9599, 9600));
  assert.equal(meter.readings, 1);
  assert.ok(Math.abs(meter.mnl - level) < 0.05);
  meter.reset();
  assert.equal(meter.level, -Infinity);
});

test("blows strike the places that Python's strike", () => {
  for (const [x, y, place] of references.places) {
    assert.equal(placeStruck(x, y, tables.landing.place_size, 12), place, `${x}, ${y}`);
  }
});

test("microphones are where Python's are, whatever the trunk does", () => {
  const readings = viewReadings();
  for (const { offset, trunk, quaternion, at } of references.microphones) {
    readings.trunkPosition.set(trunk);
    readings.trunkQuaternion.set(quaternion);
    for (const mount of ["trunk", "beside", "world"] as const) {
      const microphone = new Microphone(mount, offset, 0.05);
      microphone.follow(readings);
      at[mount].forEach((wanted, axis) => {
        const off = (microphone.at[axis] as number) - wanted;
        assert.ok(Math.abs(off) < 1e-6, `${mount}: ${off} m`);
      });
    }
  }
  assert.equal(new Microphone("world", [0, 0, 0], 0.05).distance(0, 0.01, 0), 0.05);
});

test("a blow passes its impulse, wherever between samples it begins and at whatever rate", () => {
  for (const [name, floor] of Object.entries(tables.floors) as [string, FloorTable][]) {
    const law = tables.contact_laws[floor.law] as LawTable;
    const blow = new Blow(law.passed.length / law.yields.length);
    for (const [mass, speed] of [[0.5, 0.45], [2, 0.1], [0.3, 1.5]] as const) {
      blow.strike(floor, law, mass, speed);
      assert.ok(blow.duration > 0.004 && blow.duration < 0.15, `${name}: ${blow.duration} s`);
      for (const rate of [48000, 6000]) {
        const force = new Float64Array(Math.ceil(0.2 * rate));
        blow.press(-0.37 / rate, rate, force);
        const impulse = force.reduce((sum, own) => sum + own, 0) / rate;
        assert.ok(Math.abs(impulse / blow.impulse - 1) < 1e-9, `${name}: ${impulse} N s`);
        assert.ok(impulse > mass * speed && impulse < 2 * mass * speed);
        assert.ok(force.every((own) => own > -1e-3));
      }
    }
  }
});

test("tables of another format, and a file that is cut off, are refused in a line", () => {
  const empty = new ArrayBuffer(0);
  assert.throws(() => loadSoundTables({ format: 99 }, empty), /format 99, not 2/);
  assert.throws(() => loadSoundTables(null, empty), /format undefined/);
  const cut = { format: 2, yields: { shape: [4], offset: 0 } };
  assert.throws(() => loadSoundTables(cut, empty), /end before the last array/);
});

test("readings lie one after the other in a batch", () => {
  const batch = new Float32Array(3 * READINGS_LENGTH);
  viewReadings(batch, 1).trunkQuaternion[3] = 7;
  assert.equal(batch[2 * READINGS_LENGTH - 1], 7);
  assert.throws(() => viewReadings(batch, 3), /no step 3/);
});
