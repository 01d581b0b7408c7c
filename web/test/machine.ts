/**
 * How busy the machine is, with the browser and with others, and how fast: what a page does in a
 * second says little of the page where somebody else has the processor, or where it is a slow one. By
 * /proc and /sys, and so on Linux alone; elsewhere a machine counts as free.
 */

import { readdirSync, readFileSync } from "node:fs";

/** Ticks of a second in /proc, on every Linux there is. */
const TICKS = 100;

/** Cores that the page is made for. */
export const CORES = 2;

/** Processor time so far, s. */
interface Spent {
  readonly time: number;
  /** By all processes. */
  readonly all: number;
  /** By each that this one started, and those that they started. */
  readonly own: ReadonlyMap<number, number>;
}

export interface Busy {
  /** Cores that the browser, and this process, took. */
  readonly own: number;
  /** Share of `CORES` that was left to them, by others and by what a container may take, from 0 to 1. */
  readonly free: number;
  /** Over how long, s. */
  readonly seconds: number;
}

/** Watches from now on. */
export class Machine {
  private readonly begun = spent();
  private readonly cores = coresOf();

  /** Returns how busy it has been since. */
  busy(): Busy {
    const now = spent();
    const seconds = Math.max(now.time - this.begun.time, 1e-3);
    let own = 0;
    for (const [pid, ticks] of now.own) own += ticks - (this.begun.own.get(pid) ?? 0);
    const others = Math.max(now.all - this.begun.all - own, 0);
    const left = Math.min(Math.max(this.cores - others / seconds, 0), quota());
    return { own: own / seconds, free: Math.min(left / CORES, 1), seconds };
  }
}

/** Turns of the loop of `coreTime`, and how often it is tried. */
const TURNS = 5e7;
const TRIES = 3;

/**
 * Returns the processor time that a core takes for a fixed loop at best, s: 50 million turns of a
 * generator of random numbers, each of which waits for the one before.
 */
export function coreTime(): number {
  const tries = Array.from({ length: TRIES }, () => {
    const begun = process.cpuUsage();
    let x = 1;
    for (let i = 0; i < TURNS; i++) {
      x ^= x << 13;
      x ^= x >>> 17;
      x ^= x << 5;
    }
    const { user, system } = process.cpuUsage(begun);
    return x === 0 ? NaN : (user + system) / 1e6; // which it never is, but has to be worked out
  });
  return Math.min(...tries);
}

/** Returns the cores that the container may take, of all there are. */
function quota(): number {
  const [most, period] = read("/sys/fs/cgroup/cpu.max").split(" ").map(Number);
  return most && period ? most / period : Infinity;
}

function spent(): Spent {
  const time = performance.now() / 1000;
  const [user = 0, nice = 0, system = 0, , , irq = 0, softirq = 0, steal = 0] = read("/proc/stat")
    .split("\n", 1)
    .flatMap((line) => line.trim().split(/\s+/).slice(1).map(Number));
  const all = (user + nice + system + irq + softirq + steal) / TICKS;
  return { time, all, own: descendants() };
}

function coresOf(): number {
  return Math.max(read("/proc/stat").match(/^cpu\d/gm)?.length ?? 1, 1);
}

/** Returns the processor time of this process and all that come of it, s. */
function descendants(): Map<number, number> {
  const parents = new Map<number, number>();
  const times = new Map<number, number>();
  for (const pid of processes()) {
    // What follows the name, which is in brackets: state, parent, ..., user and system time.
    const fields = read(`/proc/${pid}/stat`).split(") ").pop()?.split(" ").map(Number) ?? [];
    parents.set(pid, fields[1] ?? 0);
    times.set(pid, ((fields[11] ?? 0) + (fields[12] ?? 0)) / TICKS);
  }
  const isOwn = (pid: number | undefined): boolean =>
    pid !== undefined && (pid === process.pid || isOwn(parents.get(pid)));
  return new Map([...times].filter(([pid]) => isOwn(pid)));
}

function processes(): number[] {
  try {
    return readdirSync("/proc").map(Number).filter(Boolean);
  } catch {
    return [];
  }
}

/** Returns a file, or nothing of a process that has just ended. */
function read(file: string): string {
  try {
    return readFileSync(file, "utf8");
  } catch {
    return "";
  }
}
