/** A filter of sections of the second order, for a stream. */

import type { Section } from "./tables.js";

/** State below which a filter rests: far below hearing, far above the slow denormal numbers. */
const REST = 1e-30;

export class Sections {
  private readonly b0: Float64Array;
  private readonly b1: Float64Array;
  private readonly b2: Float64Array;
  private readonly a1: Float64Array;
  private readonly a2: Float64Array;
  private readonly s1: Float64Array;
  private readonly s2: Float64Array;

  constructor(sections: readonly Section[]) {
    const column = (index: number) =>
      Float64Array.from(sections, (section) => (section[index] ?? NaN) / (section[3] ?? NaN));
    this.b0 = column(0);
    this.b1 = column(1);
    this.b2 = column(2);
    this.a1 = column(4);
    this.a2 = column(5);
    this.s1 = new Float64Array(sections.length);
    this.s2 = new Float64Array(sections.length);
  }

  /** Whether anything is left of what came so far. */
  get busy(): boolean {
    for (let k = 0; k < this.s1.length; k++) {
      if (this.s1[k] !== 0 || this.s2[k] !== 0) return true;
    }
    return false;
  }

  /** Forget all that came so far. */
  reset(): void {
    this.s1.fill(0);
    this.s2.fill(0);
  }

  /** Take the first sample to have been there for ever. */
  settle(first: number): void {
    let level = first;
    for (let k = 0; k < this.s1.length; k++) {
      const b1 = this.b1[k] as number;
      const b2 = this.b2[k] as number;
      const a1 = this.a1[k] as number;
      const a2 = this.a2[k] as number;
      const out = (level * ((this.b0[k] as number) + b1 + b2)) / (1 + a1 + a2);
      this.s2[k] = b2 * level - a2 * out;
      this.s1[k] = b1 * level - a1 * out + (this.s2[k] as number);
      level = out;
    }
  }

  /** Filters the first `count` samples in place. */
  filter(samples: Float64Array, count: number): void {
    for (let k = 0; k < this.s1.length; k++) {
      const b0 = this.b0[k] as number;
      const b1 = this.b1[k] as number;
      const b2 = this.b2[k] as number;
      const a1 = this.a1[k] as number;
      const a2 = this.a2[k] as number;
      let s1 = this.s1[k] as number;
      let s2 = this.s2[k] as number;
      for (let i = 0; i < count; i++) {
        const x = samples[i] as number;
        const y = b0 * x + s1;
        s1 = b1 * x - a1 * y + s2;
        s2 = b2 * x - a2 * y;
        samples[i] = y;
      }
      const rests = Math.abs(s1) < REST && Math.abs(s2) < REST;
      this.s1[k] = rests ? 0 : s1;
      this.s2[k] = rests ? 0 : s2;
    }
  }
}
