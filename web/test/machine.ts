/**
 * How busy the machine is, with the browser and with others: what a page does in a second says little
 * of the page where somebody else has the processor. By /proc, and so on Linux alone; elsewhere a
 * machine counts as free.
 */

import { readdirSync, readFileSync } from "node:fs";

/** Ticks of a second in /proc, on every Linux there is. */
const TICKS = 100;

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
  /** Share of the machine that others left to them, from 0 to 1. */
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
    return { own: own / seconds, free: Math.max(1 - others / (seconds * this.cores), 0), seconds };
  }
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
