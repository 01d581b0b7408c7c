/** Steering, the clock, addresses and stairs: what each does alone. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { Clock } from "../src/control/clock.js";
import { Comparison } from "../src/control/comparison.js";
import { Mishaps } from "../src/control/mishaps.js";
import { Rate } from "../src/control/rates.js";
import { Steering } from "../src/control/steering.js";
import { withoutSlack } from "../src/input/joystick.js";
import { Stairs } from "../src/physics/stairs.js";
import { PixelBudget } from "../src/picture/pixel_budget.js";
import { fromAddress, initialSettings, toAddress } from "../src/settings/settings.js";
import { page } from "./files.js";

const steering = () => new Steering(page.command.start, page.command);

test("ten steps up and ten down come back to exactly nothing, which asks to stand", () => {
  const robot = steering();
  robot.set({ vx: 0 });
  for (let i = 0; i < 10; i++) robot.change("vx", 0.1);
  assert.equal(robot.command.vx, 1);
  for (let i = 0; i < 10; i++) robot.change("vx", -0.1);
  assert.ok(robot.stands);
});

test("commands end at their limits", () => {
  const robot = steering();
  robot.set({ vx: 50, beta: -3 });
  assert.deepEqual([robot.command.vx, robot.command.beta], [2, 0]);
});

test("who was stopped goes on as before, at the beta of now", () => {
  const robot = steering();
  robot.set({ vx: 0.7, wz: 0.2 });
  robot.stopOrGo();
  robot.set({ beta: 1 });
  robot.stopOrGo();
  assert.deepEqual(robot.command, { vx: 0.7, vy: 0, wz: 0.2, beta: 1 });
});

test("who stands by sliders, or as a stick was let go, goes on as before too", () => {
  const robot = steering();
  robot.set({ vx: 0.4 });
  robot.set({ vx: 0 });
  robot.stopOrGo();
  assert.equal(robot.command.vx, 0.4);
  robot.pull(0, 0, 1);
  const { wz } = robot.command;
  assert.ok(wz > 0 && robot.isPulled(0, 0, 1) && !robot.isPulled(0, 0, 0));
  robot.pull(0, 0, 0);
  assert.ok(robot.stands && robot.isPulled(0, 0, 0));
  robot.stopOrGo();
  assert.deepEqual([robot.command.vx, robot.command.wz], [0, wz]);
});

test("who came stopped, by an address say, goes as the page begins", () => {
  const robot = new Steering({ vx: 0, vy: 0, wz: 0, beta: 0.8 }, page.command);
  assert.ok(robot.stands);
  robot.stopOrGo();
  assert.deepEqual(robot.command, { ...page.command.start, beta: 0.8 });
  robot.stopOrGo();
  assert.ok(robot.stands);
});

test("a pull to the end asks for the speeds that are trained, in steps of the sliders", () => {
  const robot = steering();
  const { vx, wz } = page.command.trained;
  robot.pull(1, 0, -1);
  assert.deepEqual([robot.command.vx, robot.command.wz], [vx[1], wz[0]]);
  robot.pull(-1, 0.031, 0);
  assert.deepEqual([robot.command.vx, robot.command.vy, robot.command.wz], [vx[0], 0, 0]);
});

test("the clock has a step due for each period, whatever the rate of looks", () => {
  for (const look of [0.004, 0.016, 0.033]) {
    const clock = new Clock();
    let due = 0;
    const looks = Math.round(10 / look);
    for (let i = 0; i <= looks; i++) due += clock.tick(i * look, 0.02);
    assert.ok(Math.abs(due - (looks * look) / 0.02) <= 1, `${due} steps at looks of ${look} s`);
  }
});

test("a late clock catches up a tenth of a second, and no more", () => {
  const clock = new Clock();
  clock.tick(0, 0.02);
  assert.equal(clock.tick(0.08, 0.02), 4);
  assert.ok(clock.tick(1.5, 0.02) <= 6);
  assert.equal(clock.tick(60, 0.02), 0);
});

test("pictures lie between control steps", () => {
  const clock = new Clock();
  clock.tick(0, 0.02);
  clock.tick(0.03, 0.02);
  assert.ok(Math.abs(clock.share(0.035, 0.02) - 0.75) < 1e-9);
  assert.equal(clock.share(9, 0.02), 1);
});

test("a rate is of the last two seconds", () => {
  const rate = new Rate();
  for (let i = 0; i <= 100; i++) rate.add(0.1 * i, i < 50 ? 1 : 5);
  assert.ok(Math.abs(rate.perSecond - 50) < 1);
});

test("an address comes back as it was written", () => {
  const settings = {
    ...initialSettings(page),
    command: { vx: -0.35, vy: 0.1, wz: 0, beta: 0.9 },
    ground: "stairs" as const,
    level: 3,
    floor: "tile",
  };
  assert.deepEqual(fromAddress(toAddress(settings), page), { settings, faults: [] });
});

test("an empty address is no fault, and every damaged part of another is", () => {
  assert.deepEqual(fromAddress("", page), { settings: initialSettings(page), faults: [] });
  const damaged = "#vx=Infinity&beta=&vy=9&level=1.5&floor=&ground=moon&controller=x&a=1&%";
  const { settings, faults } = fromAddress(damaged, page);
  assert.deepEqual(settings, initialSettings(page));
  assert.equal(faults.length, 9);
  for (const fault of faults) assert.ok(!fault.includes("\n") && fault.length < 160, fault);
});

test("no sort of garbage in an address throws or gets past the limits", () => {
  let seed = 1;
  const random = () => {
    seed = (seed * 48271) % 2147483647;
    return seed / 2147483647;
  };
  for (let i = 0; i < 2000; i++) {
    const letters = Array.from({ length: 30 }, () => String.fromCharCode(32 + 95 * random()));
    const { command } = fromAddress(`#vx=${letters.join("")}&wz=${1e3 * random()}`, page).settings;
    assert.ok(Math.abs(command.vx) <= 2 && Math.abs(command.wz) <= 2);
  }
});

test("a stick has slack in the middle and its full reach at the ends", () => {
  assert.deepEqual([0.05, -0.12, 1, -1, 2].map(withoutSlack), [0, 0, 1, -1, 1]);
  assert.ok(withoutSlack(0.5) > 0.4 && withoutSlack(0.5) < 0.5);
});

test("the boxes of stairs have their tops at the height that is told", () => {
  for (const level of [0, 4]) {
    const stairs = new Stairs(page.stairs, level);
    for (let x = -9; x < 9; x += 0.037) {
      const over = [...stairs.near(x, 0.3)].filter(
        ({ centre, half }) => Math.abs(x - centre[0]) < half[0],
      );
      const top = Math.max(0, ...over.map(({ centre, half }) => centre[2] + half[2]));
      assert.ok(
        Math.abs(top - stairs.height(x)) < 1e-9,
        `at ${x}: ${top}, told ${stairs.height(x)}`,
      );
    }
    assert.equal(stairs.height(0), 0);
  }
});

test("a machine that draws slowly is given less to draw, one that keeps up is not", () => {
  const slow = new PixelBudget(false);
  const shares = [slow.ratio(1)];
  for (let i = 0; i < 200; i++) if (slow.after(0.1)) shares.push(slow.ratio(1));
  assert.deepEqual(
    shares,
    [...shares].sort((a, b) => b - a),
  );
  assert.ok(slow.ratio(1) < 0.5 && !slow.shadows);
  const quick = new PixelBudget(false);
  for (let i = 0; i < 200; i++) assert.equal(quick.after(1 / 60), false);
  assert.ok(quick.shadows);
});

/** Draws for some seconds at a rate that hangs on how finely; returns how often that changed. */
function drawFor(budget: PixelBudget, seconds: number, rate: (share: number) => number): number {
  let changes = 0;
  for (let time = 0; time < seconds; ) {
    const period = 1 / rate(budget.ratio(1));
    time += period;
    if (budget.after(period)) changes++;
  }
  return changes;
}

test("a screen of 30 pictures a second is drawn on as finely as any", () => {
  const budget = new PixelBudget(false);
  assert.equal(drawFor(budget, 60, () => 30), 0);
  assert.deepEqual([budget.ratio(1), budget.shadows], [1, true]);
});

test("a machine that was busy for a while draws finely again after it", () => {
  const budget = new PixelBudget(false);
  drawFor(budget, 20, () => 10);
  assert.ok(budget.ratio(1) < 0.5);
  drawFor(budget, 60, () => 60);
  assert.deepEqual([budget.ratio(1), budget.shadows], [1, true]);
  const software = new PixelBudget(true);
  const first = software.ratio(1);
  drawFor(software, 20, () => 10);
  drawFor(software, 60, () => 60);
  assert.equal(software.ratio(1), first, "more than it began with is not tried without a card");
});

test("a machine that is too slow for more tries it ever more rarely", () => {
  const budget = new PixelBudget(false);
  const rate = (share: number) => (share > 0.6 ? 20 : 60);
  drawFor(budget, 10, rate);
  const early = drawFor(budget, 100, rate);
  const late = drawFor(budget, 400, rate);
  assert.ok(early >= 4 && early <= 8, `${early} changes in the first 100 s`);
  assert.ok(late <= 6, `${late} changes in the next 400 s`);
});

/** A comparison, and all that it tells. */
function comparing() {
  const told: string[] = [];
  const begun: number[] = [];
  const counted: number[] = [];
  let ended = 0;
  const comparison = new Comparison({
    begin: (beta) => begun.push(beta),
    tell: (text) => told.push(text),
    count: (seconds) => counted.push(seconds),
    end: () => ended++,
  });
  /** Walks in control steps, of which all but the first half second is heard. */
  const walk = (seconds: number, mnl: number) => {
    for (let step = 0; step <= 50 * seconds; step++) {
      comparison.follow(step / 50, { mnl, seconds: Math.max(step / 50 - 0.5, 0) });
    }
  };
  return { comparison, told, begun, counted, walk, ended: () => ended };
}

test("a comparison hears both betas for ten seconds, and tells the difference", () => {
  const { comparison, told, begun, counted, walk, ended } = comparing();
  comparison.start();
  comparison.start(); // that it runs already changes nothing
  assert.deepEqual(begun, [0]);
  walk(10.4, 67.4);
  assert.deepEqual(begun, [0]);
  comparison.follow(10.5, { mnl: 67.4, seconds: 10 });
  assert.deepEqual(begun, [0, 1]);
  comparison.follow(12, { mnl: NaN, seconds: 10 }); // nothing is heard of it yet
  assert.ok(comparison.isRunning);
  comparison.follow(12.1, { mnl: 63.1, seconds: 10 });
  assert.equal(told.at(-1), "β 0: 67.4 dBA. β 1: 63.1 dBA. 4.3 dB quieter at β 1.");
  assert.deepEqual([ended(), comparison.isRunning], [1, false]);
  // Each beta and the end are told once, and each second is counted once.
  assert.equal(told.length, 3);
  assert.deepEqual(counted.slice(0, 11), [10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 10]);
});

test("a comparison tells of falls, and anew of the next one's", () => {
  const { comparison, told, walk } = comparing();
  comparison.fell(); // before it begins is nobody's
  comparison.start();
  comparison.fell();
  comparison.fell();
  walk(10.5, 67);
  walk(10.5, 63);
  assert.match(told.at(-1) ?? "", /4\.0 dB quieter at β 1\. Falls, which are left out: 2 at β 0\.$/);
  comparison.start();
  walk(10.5, 67);
  walk(10.5, 67.5);
  assert.match(told.at(-1) ?? "", /0\.5 dB louder at β 1\.$/);
});

test("a comparison of what cannot be heard ends, and says so", () => {
  const { comparison, told, ended } = comparing();
  comparison.start();
  for (let step = 0; step <= 50 * 41; step++) comparison.follow(step / 50, { mnl: NaN, seconds: 0 });
  assert.equal(told.at(-1), "Not compared: in 40 s at β 0 only 0 s could be heard.");
  assert.deepEqual([ended(), comparison.isRunning], [1, false]);
});

test("each fall is told, and a blow-up once until the robot has walked again", () => {
  const mishaps = new Mishaps();
  const told = (...outcomes: ("walking" | "fallen" | "unstable")[]) =>
    outcomes.flatMap((outcome) => mishaps.after(outcome, 0.02)?.split(" ")[2] ?? []);
  assert.deepEqual(told("walking", "fallen", "fallen"), ["fell", "fell"]);
  assert.deepEqual(told("unstable", "unstable", "walking", "unstable"), ["blew"]);
  const second = Array.from({ length: 51 }, () => "walking" as const);
  assert.deepEqual(told(...second, "unstable"), ["blew"]);
});
