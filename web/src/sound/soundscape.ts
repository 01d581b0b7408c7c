/**
 * Everything that the robot sounds of, at one microphone: physics in, pressure out. The running form
 * of Python's `mute.acoustics.soundscape`, for one robot, physics step by physics step.
 *
 * It needs neither a page nor a clock, and allocates nothing once it is made.
 */

import { Drive } from "./drive.js";
import { DriveOnShell } from "./drive_on_shell.js";
import { Landings } from "./landings.js";
import { Microphone } from "./microphone.js";
import { BandNoise } from "./noise.js";
import { type Settings, type SoundscapeOptions, checkOptions } from "./options.js";
import { PlateSound } from "./plate.js";
import { FEET, READINGS_LENGTH, type ContactReadings, viewReadings } from "./readings.js";
import { Seam } from "./seam.js";
import type { SoundTables } from "./tables.js";

/** Time of steps that can wait to be heard, s. */
const LONGEST_WAIT = 1;

export class Soundscape {
  private readonly tables: SoundTables;
  private readonly settings: Settings;
  private readonly microphone: Microphone;
  private readonly landings: Landings;
  private readonly shell: PlateSound | null;
  private readonly drive: Drive | null;
  private readonly driveSound: DriveOnShell;
  private readonly scuffing: BandNoise | null;
  private readonly fan: BandNoise | null;
  private readonly seam = new Seam();
  /** Steps that wait, in a ring. */
  private readonly waiting: Float32Array;
  private readonly capacity: number;
  private first = 0;
  private count = 0;
  private readonly readings = viewReadings();
  /** The sound of the last step, of which `played` samples have been given, Pa. */
  private readonly block: Float64Array;
  private played: number;

  constructor(tables: SoundTables, options: SoundscapeOptions) {
    const settings = checkOptions(tables, options);
    const { samples, sources, seed } = settings;
    this.tables = tables;
    this.settings = settings;
    const { mount, offset } = settings.microphone;
    this.microphone = new Microphone(mount, offset, tables.microphone.min_distance);
    const body = sources.includes("body");
    const drives = sources.includes("drive");
    this.shell = body || drives ? new PlateSound(tables.shell.plate, tables, samples) : null;
    this.landings = new Landings(
      tables,
      settings.surface,
      samples,
      sources.includes("impacts"),
      body ? this.shell : null,
    );
    this.drive = drives ? new Drive(tables, settings.timestep, samples) : null;
    this.driveSound = new DriveOnShell(tables, samples);
    // A source keeps its noise whatever else is heard.
    this.scuffing = sources.includes("scuffing")
      ? new BandNoise(tables.scuffing.filter, 2 * seed, samples)
      : null;
    this.fan = sources.includes("fan")
      ? new BandNoise(tables.fan.filter, 2 * seed + 1, samples)
      : null;
    this.capacity = Math.ceil(LONGEST_WAIT / settings.timestep);
    this.waiting = new Float32Array(this.capacity * READINGS_LENGTH);
    this.block = new Float64Array(samples);
    this.played = samples;
  }

  /** Steps that wait to be heard. */
  get queued(): number {
    return this.count;
  }

  /** Most steps that can wait. */
  get room(): number {
    return this.capacity;
  }

  /**
   * Takes the next physics step, to be heard after those before; of too many the oldest goes. One that
   * holds no numbers, of a simulation that blew up, is left out: it would never stop to be heard.
   */
  step(readings: ContactReadings): void {
    for (let i = 0; i < READINGS_LENGTH; i++) {
      if (!Number.isFinite(readings.packed[i])) return;
    }
    if (this.count === this.capacity) this.skip(1);
    const place = (this.first + this.count) % this.capacity;
    this.waiting.set(readings.packed, place * READINGS_LENGTH);
    this.count++;
  }

  /** Leaves out the oldest of the steps that wait, without a jump in the sound. */
  skip(steps: number): void {
    const gone = Math.min(steps, this.count);
    if (gone <= 0) return;
    this.first = (this.first + gone) % this.capacity;
    this.count -= gone;
    this.drive?.reset(); // or joints would race through what was left out
    this.seam.open();
  }

  /**
   * Gives the next samples, Pa. Where no step is left it fades to silence, and time stands still.
   *
   * @param out Where to.
   * @returns How many of them the physics has made, from the first on.
   */
  render(out: Float32Array): number {
    let made = 0;
    while (made < out.length) {
      if (this.played === this.settings.samples && !this.work()) break;
      const samples = Math.min(out.length - made, this.settings.samples - this.played);
      this.seam.join(this.block, this.played, out, made, samples);
      this.played += samples;
      made += samples;
    }
    if (made < out.length) this.seam.fade(out, made);
    return made;
  }

  /** Gives silence while steps wait, to which what was heard fades. */
  pause(out: Float32Array): void {
    this.seam.fade(out, 0);
  }

  /** Sets the floor, from the next step on; what was struck rings out. */
  setSurface(name: string): void {
    this.landings.setSurface(name);
  }

  /** Forgets all steps and all that rings, without a jump in the sound. */
  reset(): void {
    this.count = 0;
    this.played = this.settings.samples;
    this.landings.reset();
    this.shell?.reset();
    this.drive?.reset();
    this.driveSound.reset();
    this.scuffing?.reset();
    this.fan?.reset();
    this.seam.open();
  }

  /** Works out the sound of the next step; false if there is none. */
  private work(): boolean {
    if (this.count === 0) return false;
    const { readings, block, microphone } = this;
    const at = this.first * READINGS_LENGTH;
    // Element by element: a view would be allocated.
    for (let i = 0; i < READINGS_LENGTH; i++) {
      readings.packed[i] = this.waiting[at + i] as number;
    }
    this.first = (this.first + 1) % this.capacity;
    this.count--;
    this.played = 0;
    block.fill(0);
    microphone.follow(readings);
    this.landings.step(readings, microphone);
    this.landings.sound(block);
    this.soundShell();
    this.soundNoise();
    return true;
  }

  /** Adds what the shell makes of landings and drive. */
  private soundShell(): void {
    if (this.shell === null) return;
    const { landings, readings, block } = this;
    if (this.drive !== null) {
      const { trunkPosition } = readings;
      const apart = this.microphone.distance(
        trunkPosition[0] as number,
        trunkPosition[1] as number,
        trunkPosition[2] as number,
      );
      const press = this.driveSound.press(this.drive, readings);
      this.shell.hear(press, apart, this.tables.shell.transmissibility);
      landings.shellPresses[landings.shellCount++] = press;
    }
    this.shell.sound(landings.shellPresses, landings.shellCount, block);
  }

  /** Adds scuffing and the fan. */
  private soundNoise(): void {
    const { readings, microphone, block } = this;
    const { samples } = this.settings;
    if (this.scuffing !== null) {
      let near = 0;
      for (let foot = 0; foot < FEET; foot++) {
        const power = readings.frictionPower[foot] as number;
        if (power === 0) continue;
        const x = readings.footPosition[3 * foot] as number;
        const y = readings.footPosition[3 * foot + 1] as number;
        const z = readings.footPosition[3 * foot + 2] as number;
        near += power / microphone.distance(x, y, z) ** 2;
      }
      const share = (this.tables.air.impedance * this.tables.scuffing.efficiency) / (2 * Math.PI);
      this.scuffing.sound(share * near, block, samples);
    }
    if (this.fan !== null) {
      const { trunkPosition } = readings;
      const x = trunkPosition[0] as number;
      const y = trunkPosition[1] as number;
      const z = trunkPosition[2] as number;
      this.fan.sound(this.tables.fan.mean_square / microphone.distance(x, y, z) ** 2, block, samples);
    }
  }
}
