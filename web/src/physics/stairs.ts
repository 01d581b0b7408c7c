/** Flights of stairs up and down along x, laid around the robot as `envs.terrain.kinds.Stairs`. */

import type { StairsFigures } from "./page_data.js";

/** An upright box in the world frame, m. */
export interface Box {
  readonly centre: readonly [number, number, number];
  readonly half: readonly [number, number, number];
}

export class Stairs {
  private readonly period: number;

  constructor(
    readonly figures: StairsFigures,
    readonly level: number,
  ) {
    const { top, valley, steps, tread } = figures;
    this.period = top + valley + 2 * (steps - 1) * tread;
  }

  private get riser(): number {
    return this.figures.risers[this.level] ?? 0;
  }

  /** Returns the height of the ground at a place, m. */
  height(x: number): number {
    const { tread, steps } = this.figures;
    const away = Math.abs(x - this.middle(x));
    const step = Math.floor((this.half(1) - away) / tread + 1 + 1e-6);
    return this.riser * Math.min(Math.max(step, 0), steps);
  }

  /** Returns which cell of the ground a place is in; boxes are laid anew in another one. */
  cell(x: number, y: number): string {
    const { tread } = this.figures;
    return `${Math.floor(x / tread)},${Math.floor(y / tread)}`;
  }

  /** Returns the boxes that the physics needs around a place. */
  near(x: number, y: number): Box[] {
    const { tread, boxes, steps, half_width } = this.figures;
    const middle = this.middle(x);
    const here = Math.floor((this.half(1) - Math.abs(x - middle)) / tread + 1);
    const lowest = Math.min(Math.max(here - Math.floor(boxes / 2), 1), steps - boxes + 1);
    return Array.from({ length: boxes }, (_, i) => this.box(middle, y, lowest + i, half_width));
  }

  /** Returns the boxes of the hills that are to be seen from a place. */
  wide(x: number, y: number): Box[] {
    const { steps, drawn_half_width } = this.figures;
    const middle = this.middle(x);
    return [-1, 0, 1].flatMap((hill) =>
      Array.from({ length: steps }, (_, i) =>
        this.box(middle + hill * this.period, y, i + 1, drawn_half_width),
      ),
    );
  }

  /** The first step is the lowest and longest: all that is as high as it, or higher. */
  private box(middle: number, y: number, step: number, halfWidth: number): Box {
    const { depth } = this.figures;
    // In steps: a box that moved under a standing foot all the time would rub it.
    const beside = 0.5 * Math.round(2 * y);
    const top = this.riser * step;
    const [low, high] = [-depth, top];
    return {
      centre: [middle, beside, 0.5 * (high + low)],
      half: [this.half(step), halfWidth, 0.5 * (high - low)],
    };
  }

  /** Returns the middle of the hill that is nearest; robots begin between two. */
  private middle(x: number): number {
    const shift = 0.5 * this.period;
    return shift + this.period * Math.round((x - shift) / this.period);
  }

  private half(step: number): number {
    const { top, tread, steps } = this.figures;
    return 0.5 * top + tread * (steps - step);
  }
}
