/** What a visitor can set, and the address that keeps it: `#vx=0.5&beta=1&floor=tile`. */

import type { Axis, Command, PageData } from "../physics/page_data.js";
import type { Ground } from "../physics/simulation.js";

export interface Settings {
  readonly command: Command;
  readonly floor: string;
  readonly ground: Ground;
  /** How high stairs are, from 0. */
  readonly level: number;
  /** Name of the controller. */
  readonly controller: string;
}

const AXES: readonly Axis[] = ["vx", "vy", "wz", "beta"];

/** Returns what the page begins with. */
export function initialSettings(page: PageData): Settings {
  return {
    command: page.command.start,
    floor: page.surface,
    ground: "flat",
    level: 0,
    controller: page.controllers[0]?.name ?? "",
  };
}

/** Returns the part of an address that keeps settings, with the `#`. */
export function toAddress(settings: Settings): string {
  const { command, floor, ground, level, controller } = settings;
  const fields = new URLSearchParams();
  for (const axis of AXES) fields.set(axis, String(rounded(command[axis])));
  fields.set("floor", floor);
  fields.set("ground", ground);
  if (ground === "stairs") fields.set("level", String(level));
  fields.set("controller", controller);
  return `#${fields}`;
}

/**
 * Reads an address. What is damaged in it is left out, and told of.
 *
 * @returns The settings, and a line for each fault.
 */
export function fromAddress(
  hash: string,
  page: PageData,
): { settings: Settings; faults: string[] } {
  const start = initialSettings(page);
  const faults: string[] = [];
  const fields = new URLSearchParams(hash.replace(/^#/, ""));
  for (const name of new Set(fields.keys())) {
    if (!KNOWN.has(name)) faults.push(`the address has the unknown setting ${shown(name)}`);
  }
  const reader = new Reader(fields, faults);
  const command: Record<Axis, number> = { ...start.command };
  for (const axis of AXES) {
    command[axis] = reader.number(axis, command[axis], page.command.limits[axis], false);
  }
  const levels: readonly [number, number] = [0, page.stairs.risers.length - 1];
  const settings: Settings = {
    command,
    floor: reader.word(
      "floor",
      start.floor,
      page.floors.map(({ name }) => name),
    ),
    ground: reader.word("ground", start.ground, ["flat", "stairs"] as const),
    level: reader.number("level", start.level, levels, true),
    controller: reader.word(
      "controller",
      start.controller,
      page.controllers.map(({ name }) => name),
    ),
  };
  return { settings, faults };
}

const KNOWN = new Set<string>([...AXES, "floor", "ground", "level", "controller"]);

class Reader {
  constructor(
    private readonly fields: URLSearchParams,
    private readonly faults: string[],
  ) {}

  number(
    name: string,
    otherwise: number,
    [low, high]: readonly [number, number],
    whole: boolean,
  ): number {
    const given = this.fields.get(name);
    if (given === null) return otherwise;
    const value = given.trim() === "" ? Number.NaN : Number(given);
    if (value >= low && value <= high && (!whole || Number.isInteger(value))) return value;
    const kind = whole ? "a whole number" : "a number";
    this.faults.push(
      `the address has ${name}=${shown(given)}: it must be ${kind} from ${low} to ${high}`,
    );
    return otherwise;
  }

  word<Word extends string>(name: string, otherwise: Word, allowed: readonly Word[]): Word {
    const given = this.fields.get(name);
    if (given === null) return otherwise;
    const found = allowed.find((word) => word === given);
    if (found !== undefined) return found;
    this.faults.push(
      `the address has ${name}=${shown(given)}: it must be one of ${allowed.join(", ")}`,
    );
    return otherwise;
  }
}

/** Returns somebody's words so that they stay short and in one line. */
function shown(words: string): string {
  const line = words.replace(/\s+/g, " ");
  return line.length > 24 ? `${line.slice(0, 24)}...` : line;
}

function rounded(value: number): number {
  return Math.round(1e3 * value) / 1e3;
}
