/** What tests read: the page's assets, and the walks of Python that it is held to. */

import { readFileSync } from "node:fs";
import { join } from "node:path";

import { readPageData } from "../src/physics/page_data.js";

/** Returns a file of `web/assets`. */
export function asset(name: string): Uint8Array {
  return new Uint8Array(readFileSync(join("assets", name)));
}

/** Returns a file of `web/test/reference`. */
export function reference(name: string): Uint8Array {
  return new Uint8Array(readFileSync(join("test", "reference", name)));
}

export function textOf(file: Uint8Array): string {
  return new TextDecoder().decode(file);
}

export const page = readPageData(JSON.parse(textOf(asset("page.json"))));

/** One walk of `walks.json`, see `mute.web.reference_walks`. */
export interface ReferenceWalk {
  readonly command: { vx: number; vy: number; wz: number; beta: number };
  readonly terrain: "flat" | "stairs";
  readonly level: number;
  readonly surface: string;
  readonly seconds: number;
  readonly settle_time: number;
  readonly first_state: { qpos: number[]; qvel: number[] };
  readonly positions: number[][];
  readonly gait: Record<string, number>;
  readonly mnl: number;
  readonly pnl: number;
}

export const walks = JSON.parse(textOf(reference("walks.json"))).walks as Record<
  string,
  ReferenceWalk
>;

/** Returns one of them. */
export function walkOf(name: string): ReferenceWalk {
  const found = walks[name];
  if (!found) throw new Error(`there is no walk ${name} in walks.json`);
  return found;
}

/** Figures of a walk that the page is held to. */
export const FIGURES = [
  "speed",
  "landing_speed_mean",
  "landing_speed_rms",
  "apex_mean",
  "duty_factor",
  "stride_frequency",
  "power",
] as const;
