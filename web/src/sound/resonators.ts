/**
 * The tones of a plate, each a resonator that goes on by itself once it was struck.
 *
 * A tone answers a blow with exp(-a t) sin(w t + p), the velocity of an oscillator that is struck.
 * As a recursion that is y[n] = g (x[n] - x[n - 2]) + 2 r cos(w) y[n - 1] - r^2 y[n - 2]: the zero
 * at 0 Hz, where the tone is stiff, is exact, and g is the tone's gain where it is loudest. Tones of
 * a third octave have one decay, and rest together once it is over, at no cost.
 *
 * Here is where nearly all of the sound's time goes. So four tones go side by side in variables of
 * their own, and no function that is called for them takes or returns a fraction, which would be
 * allocated.
 */

import type { Press, TierForce } from "./press.js";

/** Tones that are worked out side by side: their chains of operations do not wait for one another. */
const LANES = 4;

/** A third octave. */
export interface Band {
  /** Index of its octave. */
  readonly octave: number;
  /** Time in which its tones fall by 60 dB, s. */
  readonly decay: number;
  /** Hz. */
  readonly frequencies: ArrayLike<number>;
  /** Strengths of the tones at each place, Pa m / (N s). */
  readonly strengths: readonly ArrayLike<number>[];
}

export class Resonators {
  private readonly tones: number;
  /** By place and tone. */
  private readonly gains: Float64Array;
  /** 2 r cos(w) of each tone. */
  private readonly turn: Float64Array;
  /** The last two samples of each tone. */
  private readonly last: Float64Array;
  private readonly before: Float64Array;
  /** Of each band: its first tone and that of the next, its octave, r^2, samples to its end. */
  private readonly firsts: Int32Array;
  private readonly octaves: Int32Array;
  private readonly fall: Float64Array;
  private readonly lasting: Int32Array;
  /** Samples that each band still rings for. */
  private readonly left: Int32Array;
  /** What presses on four tones where more than one force does: sample by sample, tone by tone. */
  private readonly mixed: Float64Array;

  /**
   * @param bands Third octaves.
   * @param tier Index of the tier that they ring in.
   * @param rate Samples a second, Hz.
   * @param samples Most samples of a block.
   */
  constructor(
    bands: readonly Band[],
    private readonly tier: number,
    rate: number,
    samples: number,
  ) {
    const lanes = bands.map((band) => Math.ceil(band.frequencies.length / LANES) * LANES);
    this.tones = lanes.reduce((sum, own) => sum + own, 0);
    const places = bands[0]?.strengths.length ?? 0;
    this.gains = new Float64Array(places * this.tones);
    this.turn = new Float64Array(this.tones);
    this.last = new Float64Array(this.tones);
    this.before = new Float64Array(this.tones);
    this.firsts = new Int32Array(bands.length + 1);
    this.octaves = Int32Array.from(bands, (band) => band.octave);
    this.fall = new Float64Array(bands.length);
    this.lasting = Int32Array.from(bands, (band) => Math.ceil(band.decay * rate));
    this.left = new Int32Array(bands.length);
    this.mixed = new Float64Array(LANES * samples);
    bands.forEach((band, index) => {
      this.firsts[index + 1] = (this.firsts[index] as number) + (lanes[index] as number);
      this.tune(band, index, rate);
    });
  }

  private tune(band: Band, index: number, rate: number): void {
    const first = this.firsts[index] as number;
    const loss = Math.log(1e3) / (band.decay * rate);
    const r = Math.exp(-loss);
    this.fall[index] = r * r;
    for (let tone = 0; tone < band.frequencies.length; tone++) {
      const angle = (2 * Math.PI * (band.frequencies[tone] as number)) / rate;
      this.turn[first + tone] = 2 * r * Math.cos(angle);
      const gain = struck(angle, loss) / rate;
      band.strengths.forEach((strengths, place) => {
        this.gains[place * this.tones + first + tone] = gain * (strengths[tone] as number);
      });
    }
  }

  /** Silence. */
  reset(): void {
    this.last.fill(0);
    this.before.fill(0);
    this.left.fill(0);
  }

  /**
   * Adds what is heard of the next samples.
   *
   * @param presses Forces, of which the first `count` press.
   * @param out Where to.
   * @param samples How many.
   * @returns Whether anything was.
   */
  ring(presses: readonly Press[], count: number, out: Float64Array, samples: number): boolean {
    let rings = false;
    let moving = 0;
    let only = 0;
    for (let i = 0; i < count; i++) {
      if (!((presses[i] as Press).tiers[this.tier] as TierForce).moves) continue;
      moving++;
      only = i;
    }
    for (let band = 0; band < this.left.length; band++) {
      if (moving > 0) this.left[band] = this.lasting[band] as number;
      else if ((this.left[band] as number) <= 0) continue;
      else this.left[band] = (this.left[band] as number) - samples;
      rings = true;
      if (moving === 0) this.ringOut(band, out, samples);
      else if (moving === 1) this.ringOne(band, presses[only] as Press, out, samples);
      else this.ringMany(band, presses, count, out, samples);
      if ((this.left[band] as number) <= 0) this.rest(band);
    }
    return rings;
  }

  /** Ends what is left of a band. */
  private rest(band: number): void {
    const first = this.firsts[band] as number;
    const stop = this.firsts[band + 1] as number;
    this.last.fill(0, first, stop);
    this.before.fill(0, first, stop);
  }

  /** A band that nothing presses on. */
  private ringOut(band: number, out: Float64Array, samples: number): void {
    const { turn, last, before } = this;
    const fall = this.fall[band] as number;
    const stop = this.firsts[band + 1] as number;
    for (let tone = this.firsts[band] as number; tone < stop; tone += LANES) {
      const t0 = turn[tone] as number;
      const t1 = turn[tone + 1] as number;
      const t2 = turn[tone + 2] as number;
      const t3 = turn[tone + 3] as number;
      let l0 = last[tone] as number;
      let l1 = last[tone + 1] as number;
      let l2 = last[tone + 2] as number;
      let l3 = last[tone + 3] as number;
      let b0 = before[tone] as number;
      let b1 = before[tone + 1] as number;
      let b2 = before[tone + 2] as number;
      let b3 = before[tone + 3] as number;
      for (let i = 0; i < samples; i++) {
        const y0 = t0 * l0 - fall * b0;
        const y1 = t1 * l1 - fall * b1;
        const y2 = t2 * l2 - fall * b2;
        const y3 = t3 * l3 - fall * b3;
        b0 = l0;
        b1 = l1;
        b2 = l2;
        b3 = l3;
        l0 = y0;
        l1 = y1;
        l2 = y2;
        l3 = y3;
        out[i] = (out[i] as number) + (y0 + y1 + (y2 + y3));
      }
      last[tone] = l0;
      last[tone + 1] = l1;
      last[tone + 2] = l2;
      last[tone + 3] = l3;
      before[tone] = b0;
      before[tone + 1] = b1;
      before[tone + 2] = b2;
      before[tone + 3] = b3;
    }
  }

  /** A band that one force presses on. */
  private ringOne(band: number, press: Press, out: Float64Array, samples: number): void {
    const { turn, last, before, gains } = this;
    const { steps } = press.tiers[this.tier] as TierForce;
    const fall = this.fall[band] as number;
    const stop = this.firsts[band + 1] as number;
    const pressAt = press.place * this.tones;
    const pressGain = press.gains[this.octaves[band] as number] as number;
    for (let tone = this.firsts[band] as number; tone < stop; tone += LANES) {
      const g0 = (gains[pressAt + tone] as number) * pressGain;
      const g1 = (gains[pressAt + tone + 1] as number) * pressGain;
      const g2 = (gains[pressAt + tone + 2] as number) * pressGain;
      const g3 = (gains[pressAt + tone + 3] as number) * pressGain;
      const t0 = turn[tone] as number;
      const t1 = turn[tone + 1] as number;
      const t2 = turn[tone + 2] as number;
      const t3 = turn[tone + 3] as number;
      let l0 = last[tone] as number;
      let l1 = last[tone + 1] as number;
      let l2 = last[tone + 2] as number;
      let l3 = last[tone + 3] as number;
      let b0 = before[tone] as number;
      let b1 = before[tone + 1] as number;
      let b2 = before[tone + 2] as number;
      let b3 = before[tone + 3] as number;
      for (let i = 0; i < samples; i++) {
        const x = steps[i] as number;
        const y0 = t0 * l0 + (g0 * x - fall * b0);
        const y1 = t1 * l1 + (g1 * x - fall * b1);
        const y2 = t2 * l2 + (g2 * x - fall * b2);
        const y3 = t3 * l3 + (g3 * x - fall * b3);
        b0 = l0;
        b1 = l1;
        b2 = l2;
        b3 = l3;
        l0 = y0;
        l1 = y1;
        l2 = y2;
        l3 = y3;
        out[i] = (out[i] as number) + (y0 + y1 + (y2 + y3));
      }
      last[tone] = l0;
      last[tone + 1] = l1;
      last[tone + 2] = l2;
      last[tone + 3] = l3;
      before[tone] = b0;
      before[tone + 1] = b1;
      before[tone + 2] = b2;
      before[tone + 3] = b3;
    }
  }

  /** A band that several forces press on. */
  private ringMany(
    band: number,
    presses: readonly Press[],
    count: number,
    out: Float64Array,
    samples: number,
  ): void {
    const { turn, last, before, mixed } = this;
    const fall = this.fall[band] as number;
    const stop = this.firsts[band + 1] as number;
    for (let tone = this.firsts[band] as number; tone < stop; tone += LANES) {
      this.mix(band, tone, presses, count, samples);
      const t0 = turn[tone] as number;
      const t1 = turn[tone + 1] as number;
      const t2 = turn[tone + 2] as number;
      const t3 = turn[tone + 3] as number;
      let l0 = last[tone] as number;
      let l1 = last[tone + 1] as number;
      let l2 = last[tone + 2] as number;
      let l3 = last[tone + 3] as number;
      let b0 = before[tone] as number;
      let b1 = before[tone + 1] as number;
      let b2 = before[tone + 2] as number;
      let b3 = before[tone + 3] as number;
      for (let i = 0; i < samples; i++) {
        const x = LANES * i;
        const y0 = t0 * l0 + ((mixed[x] as number) - fall * b0);
        const y1 = t1 * l1 + ((mixed[x + 1] as number) - fall * b1);
        const y2 = t2 * l2 + ((mixed[x + 2] as number) - fall * b2);
        const y3 = t3 * l3 + ((mixed[x + 3] as number) - fall * b3);
        b0 = l0;
        b1 = l1;
        b2 = l2;
        b3 = l3;
        l0 = y0;
        l1 = y1;
        l2 = y2;
        l3 = y3;
        out[i] = (out[i] as number) + (y0 + y1 + (y2 + y3));
      }
      last[tone] = l0;
      last[tone + 1] = l1;
      last[tone + 2] = l2;
      last[tone + 3] = l3;
      before[tone] = b0;
      before[tone + 1] = b1;
      before[tone + 2] = b2;
      before[tone + 3] = b3;
    }
  }

  /** Fills `mixed` with what presses on four tones, sample by sample. */
  private mix(
    band: number,
    tone: number,
    presses: readonly Press[],
    count: number,
    samples: number,
  ): void {
    const { mixed, gains } = this;
    mixed.fill(0, 0, LANES * samples);
    for (let each = 0; each < count; each++) {
      const press = presses[each] as Press;
      const { steps, moves } = press.tiers[this.tier] as TierForce;
      if (!moves) continue;
      const pressAt = press.place * this.tones;
      const pressGain = press.gains[this.octaves[band] as number] as number;
      const g0 = (gains[pressAt + tone] as number) * pressGain;
      const g1 = (gains[pressAt + tone + 1] as number) * pressGain;
      const g2 = (gains[pressAt + tone + 2] as number) * pressGain;
      const g3 = (gains[pressAt + tone + 3] as number) * pressGain;
      for (let i = 0; i < samples; i++) {
        const x = steps[i] as number;
        const at = LANES * i;
        mixed[at] = (mixed[at] as number) + g0 * x;
        mixed[at + 1] = (mixed[at + 1] as number) + g1 * x;
        mixed[at + 2] = (mixed[at + 2] as number) + g2 * x;
        mixed[at + 3] = (mixed[at + 3] as number) + g3 * x;
      }
    }
  }
}

/**
 * Returns g of the recursion over the strength: that which has, where the tone is loudest, the gain
 * of the sampled tone, whose first sample counts half as it lies on a jump.
 *
 * @param angle w, rad a sample.
 * @param loss a, 1 / sample.
 */
function struck(angle: number, loss: number): number {
  const loudest = Math.min(Math.hypot(angle, loss), 2.5);
  const r = Math.exp(-loss);
  // Of the velocity of an oscillator, whose integral is 0: p = pi - atan(w / a).
  const phase = Math.PI - Math.atan2(angle, loss);
  const first = 0.5 * Math.sin(phase);
  const middle = r * Math.sin(angle) * Math.cos(phase);
  // |first (1 - r^2 / z^2) + middle / z| over |1 - 1 / z^2| at z = exp(i loudest).
  const real = first * (1 - r * r * Math.cos(2 * loudest)) + middle * Math.cos(loudest);
  const imaginary = first * r * r * Math.sin(2 * loudest) - middle * Math.sin(loudest);
  return Math.hypot(real, imaginary) / (2 * Math.abs(Math.sin(loudest)));
}
