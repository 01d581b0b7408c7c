/**
 * A sound level meter for a stream: A-weighting, Fast, and the figures of a walk. The running form of
 * Python's `mute.acoustics.metering`, which says what each figure is.
 */

import { Sections } from "./sections.js";
import type { SoundTables } from "./tables.js";

/** Samples that are worked on at a time. */
const BLOCK = 512;

export class LevelMeter {
  private readonly weighting: Sections;
  private readonly block = new Float64Array(BLOCK);
  private readonly decay: number;
  private readonly reference: number;
  private readonly perReading: number;
  private readonly settling: number;
  /** Time of a walk that is in no figure, s: it has to get going, and then the detector. */
  private readonly walkSettling: number;
  private readonly sampleRate: number;
  private begun = false;
  private detected = 0;
  private samples = 0;
  /** Samples from which on readings, and the mean square, count. */
  private countsFrom: number;
  private sumsFrom = 0;
  private sum = 0;
  private summed = 0;
  private largest = 0;
  private readingSum = 0;
  private readingCount = 0;
  private largestReading = -Infinity;

  constructor(tables: SoundTables) {
    const { meter, sample_rate: rate } = tables;
    this.weighting = new Sections(meter.a_weighting);
    this.sampleRate = rate;
    this.decay = Math.exp(-1 / (rate * meter.time_constant));
    this.reference = meter.reference;
    this.perReading = rate / meter.readings_per_second;
    this.settling = Math.round(meter.settling * rate);
    this.walkSettling = meter.settle_time + meter.settling;
    this.countsFrom = this.settling;
  }

  /** What the meter shows now, dBA. */
  get level(): number {
    return this.decibels(this.detected);
  }

  /** How many readings the figures are made of. */
  get readings(): number {
    return this.readingCount;
  }

  /** Mean of the readings, dBA; NaN before the first. */
  get mnl(): number {
    return this.readingCount > 0 ? this.readingSum / this.readingCount : NaN;
  }

  /** Largest of the readings, dBA; NaN before the first. */
  get pnl(): number {
    return this.readingCount > 0 ? this.largestReading : NaN;
  }

  /** Level of the mean square, dBA; NaN of nothing. */
  get laeq(): number {
    return this.summed > 0 ? this.decibels(this.sum / this.summed) : NaN;
  }

  /** Largest value of the detector, dBA. */
  get lafmax(): number {
    return this.decibels(this.largest);
  }

  /** Takes the next samples, Pa, of which the first `count` count. */
  update(samples: Float32Array, count = samples.length): void {
    for (let begin = 0; begin < count; begin += BLOCK) {
      const length = Math.min(BLOCK, count - begin);
      for (let i = 0; i < length; i++) this.block[i] = samples[begin + i] as number;
      this.take(length);
    }
  }

  /**
   * Leaves what came so far out of the figures. The detector keeps what it has heard.
   *
   * @param settle Time that is to be left out after it as well, s.
   */
  forget(settle = 0): void {
    this.pass(settle);
    this.sum = 0;
    this.summed = 0;
    this.largest = 0;
    this.readingSum = 0;
    this.readingCount = 0;
    this.largestReading = -Infinity;
  }

  /** The same where a walk begins, or goes on in another way. */
  measureAnew(): void {
    this.forget(this.walkSettling);
  }

  /** Keeps the figures, but leaves out what comes until a robot that fell walks again. */
  leaveOut(): void {
    this.pass(this.walkSettling);
  }

  /** Starts from silence, and leaves out of the figures what is as long as the detector settles. */
  reset(): void {
    this.begun = false;
    this.detected = 0;
    this.samples = 0;
    this.countsFrom = 0;
    this.weighting.reset();
    this.forget();
    this.countsFrom = this.settling;
  }

  private pass(settle: number): void {
    this.sumsFrom = this.samples + Math.round(settle * this.sampleRate);
    // What has been read already is not read again.
    this.countsFrom = Math.max(this.countsFrom, this.sumsFrom, this.samples + 1);
  }

  private take(length: number): void {
    const { block, decay } = this;
    if (!this.begun) {
      this.weighting.settle(block[0] as number);
      this.begun = true;
    }
    this.weighting.filter(block, length);
    const gain = 1 - decay;
    for (let i = 0; i < length; i++) {
      const square = (block[i] as number) ** 2;
      this.detected = decay * this.detected + gain * square;
      if (++this.samples > this.sumsFrom) {
        this.sum += square;
        this.summed++;
      }
      if (this.detected > this.largest) this.largest = this.detected;
      if (this.samples % this.perReading === 0 && this.samples >= this.countsFrom) this.read();
    }
  }

  private read(): void {
    const reading = this.decibels(this.detected);
    this.readingSum += reading;
    this.readingCount++;
    if (reading > this.largestReading) this.largestReading = reading;
  }

  private decibels(meanSquare: number): number {
    return 10 * Math.log10(meanSquare / (this.reference * this.reference));
  }
}
