/** The switch of the sound: quick fingers, slow loading, floors that change, tabs that hide. */

import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import type { Hearing, Levels } from "../src/control/hearing.js";
import { SoundSwitch } from "../src/control/sound_switch.js";
import type { Simulation } from "../src/physics/simulation.js";
import { page } from "./files.js";

const tab = { hidden: false };
Object.assign(globalThis, { document: tab });
beforeEach(() => (tab.hidden = false));

/** A hearing that notes what is asked of it. */
class Noted implements Hearing {
  readonly asked: string[] = [];
  onLevels: ((levels: Levels) => void) | null = null;
  onEnd: ((why: string) => void) | null = null;
  feed = () => void this.asked.push("feed");
  setSurface = (name: string) => void this.asked.push(name);
  reset = () => void this.asked.push("reset");
  measureAnew = () => void this.asked.push("measure");
  leaveOut = () => void this.asked.push("fall");
  suspend = async () => void this.asked.push("suspend");
  resume = async () => void this.asked.push("resume");
  close = () => void this.asked.push("close");
}

/** A switch whose sound begins when it is let. */
function made() {
  const robot = { timestep: 0.001, floor: { name: "wood", friction: 0.8 } };
  const started: { surface: string; begin: (hearing: Noted) => void; fail: (why: Error) => void }[] = [];
  const start = (surface: string) =>
    new Promise<Hearing>((begin, fail) => started.push({ surface, begin, fail }));
  const shown: [isOn: boolean, isBusy: boolean][] = [];
  const told: string[] = [];
  const sound = new SoundSwitch(robot as unknown as Simulation, 20, page, start, {
    showSound: (isOn, isBusy) => shown.push([isOn, isBusy]),
    showLevels: () => undefined,
    tell: (line) => told.push(line),
  });
  return { sound, robot, started, shown, told };
}

test("two clicks while the sound loads begin it once", async () => {
  const { sound, started, shown } = made();
  const first = sound.turn(true);
  const second = sound.turn(true);
  assert.deepEqual(shown, [[false, true], [false, true]]);
  assert.equal(started.length, 1);
  started[0]?.begin(new Noted());
  await Promise.all([first, second]);
  assert.ok(sound.isOn);
  assert.deepEqual(shown.at(-1), [true, false]);
});

test("a floor that changes while the sound loads is the one that is heard", async () => {
  const { sound, robot, started } = made();
  const done = sound.turn(true);
  assert.equal(started[0]?.surface, "wood");
  robot.floor = { name: "carpet", friction: 0.9 };
  sound.changeFloor();
  const hearing = new Noted();
  started[0]?.begin(hearing);
  await done;
  assert.deepEqual(hearing.asked, ["carpet", "reset"]);
});

test("sound that cannot begin is told of, and can be asked for again", async () => {
  const { sound, started, told, shown } = made();
  const done = sound.turn(true);
  started[0]?.fail(new Error("sound.bin cannot be loaded (404)"));
  await done;
  assert.deepEqual(told, ["There is no sound: sound.bin cannot be loaded (404)"]);
  assert.deepEqual(shown.at(-1), [false, false]);
  const again = sound.turn(true);
  started[1]?.begin(new Noted());
  await again;
  assert.ok(sound.isOn);
});

test("sound that begins in a hidden tab waits until it is seen", async () => {
  const { sound, started } = made();
  const done = sound.turn(true);
  tab.hidden = true;
  const hearing = new Noted();
  started[0]?.begin(hearing);
  await done;
  assert.equal(hearing.asked.at(-1), "suspend");
  await sound.follow(false);
  assert.equal(hearing.asked.at(-1), "resume");
  await sound.turn(false);
  await sound.follow(false);
  assert.equal(hearing.asked.at(-1), "suspend", "it was switched off, and stays so");
});

test("what was heard is of what the robot does now", async () => {
  const { sound, started } = made();
  const done = sound.turn(true);
  const hearing = new Noted();
  started[0]?.begin(hearing);
  await done;
  const levels = { level: 60, mnl: 61, pnl: 65, seconds: 3 };
  for (const change of [() => sound.measureAnew(), () => sound.restart(20)]) {
    hearing.onLevels?.(levels);
    assert.equal(sound.levels.mnl, 61);
    change();
    assert.ok(Number.isNaN(sound.levels.mnl));
    assert.equal(sound.levels.seconds, 0);
  }
  assert.deepEqual(hearing.asked.slice(-2), ["measure", "reset"]);
});

test("sound that ends by itself is told of, is off, and begins anew when it is asked for", async () => {
  const { sound, started, told, shown } = made();
  const done = sound.turn(true);
  const hearing = new Noted();
  started[0]?.begin(hearing);
  await done;
  hearing.onLevels?.({ level: 60, mnl: 61, pnl: 65, seconds: 3 });
  hearing.onEnd?.("the audio thread failed");
  assert.deepEqual(told, ["The sound ended: the audio thread failed. It can be switched on again."]);
  assert.deepEqual([sound.isOn, sound.listener, shown.at(-1)], [false, undefined, [false, false]]);
  assert.ok(Number.isNaN(sound.levels.mnl));
  assert.equal(hearing.asked.at(-1), "close");
  const again = sound.turn(true);
  started[1]?.begin(new Noted());
  await again;
  hearing.onEnd?.("it is gone already"); // which says nothing of the next one
  assert.ok(sound.isOn);
  assert.equal(told.length, 1);
});

test("sound that does not go on is closed, told of, and begun anew when it is asked for", async () => {
  const { sound, started, told, shown } = made();
  const done = sound.turn(true);
  const hearing = new Noted();
  started[0]?.begin(hearing);
  await done;
  hearing.resume = () => Promise.reject(new Error("going on took longer than 15 s"));
  await sound.turn(false);
  await sound.turn(true);
  assert.deepEqual(told, ["There is no sound: going on took longer than 15 s"]);
  assert.deepEqual([sound.isOn, shown.at(-1)], [false, [false, false]]);
  assert.equal(hearing.asked.at(-1), "close");
  const again = sound.turn(true);
  const next = new Noted();
  started[1]?.begin(next);
  await again;
  next.resume = hearing.resume;
  await sound.follow(true);
  await sound.follow(false);
  assert.match(told.at(-1) ?? "", /^The sound ended: going on took longer than 15 s/);
  assert.ok(!sound.isOn);
});
