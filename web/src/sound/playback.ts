/**
 * What the audio thread does with batches of readings: keeps a short supply of them, plays it, and
 * measures what it plays. It needs nothing of an audio thread itself, so that tests can run it.
 */

import { LevelMeter } from "./level_meter.js";
import type { SoundscapeOptions } from "./options.js";
import { type ContactReadings, READINGS_LENGTH, viewReadings } from "./readings.js";
import { Soundscape } from "./soundscape.js";
import type { SoundTables } from "./tables.js";

/** Supply with which playing begins, s: batches come with the pictures, 30 or 60 times a second. */
const FIRST_SUPPLY = 0.08;
/** By how much more is kept after each time that it ran out, and what is kept at most, s. */
const MORE = 0.02;
const MOST_KEPT = 0.2;
/** Supply from which on the oldest is left out, as after a while in a hidden tab, s. */
const TOO_MUCH = 0.3;

export class Playback {
  readonly meter: LevelMeter;
  private readonly soundscape: Soundscape;
  private readonly readings: ContactReadings = viewReadings();
  private readonly timestep: number;
  private supply = FIRST_SUPPLY;
  private plays = false;

  constructor(tables: SoundTables, options: SoundscapeOptions) {
    this.soundscape = new Soundscape(tables, options);
    this.meter = new LevelMeter(tables);
    this.meter.measureAnew();
    this.timestep = options.timestep ?? 0.001;
  }

  /** Whether there is sound now, and not silence for want of readings. */
  get isPlaying(): boolean {
    return this.plays;
  }

  /** Time that waits to be heard, s. */
  get waiting(): number {
    return this.soundscape.queued * this.timestep;
  }

  /** Takes physics steps, one after the other. */
  feed(batch: Float32Array): void {
    const steps = Math.floor(batch.length / READINGS_LENGTH);
    const { packed } = this.readings;
    // What could not wait would only push out what does.
    for (let step = Math.max(0, steps - this.soundscape.room); step < steps; step++) {
      const at = step * READINGS_LENGTH;
      for (let i = 0; i < READINGS_LENGTH; i++) packed[i] = batch[at + i] as number;
      this.soundscape.step(this.readings);
    }
  }

  setSurface(name: string): void {
    this.soundscape.setSurface(name);
  }

  /** The walk begins anew: what waits is left out, and the figures are of what comes. */
  reset(): void {
    this.soundscape.reset();
    this.meter.reset();
    this.meter.measureAnew();
    this.plays = false;
  }

  /** The walk goes on in another way, and the figures are of what comes. */
  measureAnew(): void {
    this.meter.measureAnew();
  }

  /** The robot begins anew after a fall, of which nothing is in the figures. */
  leaveOut(): void {
    this.meter.leaveOut();
  }

  /** Gives the next samples, Pa. */
  play(out: Float32Array): void {
    if (!this.plays && this.waiting < this.supply) {
      this.soundscape.pause(out);
      return;
    }
    this.plays = true;
    if (this.waiting > TOO_MUCH) {
      this.soundscape.skip(Math.round((this.waiting - this.supply) / this.timestep));
    }
    const made = this.soundscape.render(out);
    this.meter.update(out, made);
    if (made < out.length) {
      this.plays = false;
      this.supply = Math.min(this.supply + MORE, MOST_KEPT);
    }
  }
}
