/**
 * Landings: the force of each blow drives the floor where it is struck and, through the leg, the
 * robot's shell. The running form of Python's `mute.acoustics.sources.landings`.
 */

import { Blow } from "./blow.js";
import type { Microphone } from "./microphone.js";
import { lag } from "./drive_on_shell.js";
import { PlateSound } from "./plate.js";
import { Press, type TierForce } from "./press.js";
import { type ContactReadings, FEET } from "./readings.js";
import type { FloorTable, SoundTables, TierTable } from "./tables.js";

/** Blows that can go on at a time: each takes 10 to 40 ms, and a walk has some ten a second. */
const MOST_BLOWS = 16;

/** A floor, and what presses on it now. */
interface Ground {
  readonly table: FloorTable;
  readonly plate: PlateSound;
  readonly presses: Press[];
  count: number;
}

class Landing {
  readonly blow: Blow;
  readonly onFloor: Press;
  readonly onShell: Press;
  ground: Ground | null = null;
  /** Time from the blow to the beginning of the next step, s. */
  age = 0;
  /** Time after which it is heard of the floor, and of the shell, s. */
  floorDelay = 0;
  shellDelay = 0;

  constructor(tables: SoundTables, samples: number) {
    const points = tables.contact_laws.map((law) => law.passed.length / law.yields.length);
    this.blow = new Blow(points[0] ?? 0);
    this.onFloor = new Press(tables, samples);
    this.onShell = new Press(tables, samples);
  }
}

export class Landings {
  /** What presses on the shell, of which the first `shellCount` do. */
  readonly shellPresses: Press[] = [];
  shellCount = 0;
  private readonly tables: SoundTables;
  private readonly grounds = new Map<string, Ground>();
  private readonly all: Ground[];
  private readonly landings: Landing[];
  private readonly rate: number;
  /** Least time after which a blow is heard: tiers are pressed ahead of theirs, s. */
  private readonly late: number;
  /** By how much everything is later than in Python, as the drive cannot be known ahead, s. */
  private readonly wait: number;
  private here: Ground;

  /**
   * @param tables What Python worked out.
   * @param surface Name of the floor.
   * @param samples Samples of a step.
   * @param floorHeard Whether the floor is heard.
   * @param shell Whether the shell is heard, and how: sets what presses on it.
   */
  constructor(
    tables: SoundTables,
    surface: string,
    private readonly samples: number,
    private readonly floorHeard: boolean,
    private readonly shell: PlateSound | null,
  ) {
    this.tables = tables;
    this.rate = tables.sample_rate;
    this.late = Math.max(...tables.tiers.map((tier) => tier.late)) / tables.sample_rate;
    this.wait = Math.max(...tables.tiers.map(lag)) / tables.sample_rate;
    for (const [name, table] of Object.entries(tables.floors)) {
      const plate = new PlateSound(table.plate, tables, samples);
      this.grounds.set(name, { table, plate, presses: [], count: 0 });
    }
    this.all = [...this.grounds.values()];
    this.landings = Array.from({ length: MOST_BLOWS }, () => new Landing(tables, samples));
    this.here = this.find(surface);
  }

  /** Sets what landings strike from now on; what was struck rings out. */
  setSurface(name: string): void {
    this.here = this.find(name);
  }

  private find(name: string): Ground {
    const ground = this.grounds.get(name);
    if (ground === undefined) {
      const known = [...this.grounds.keys()].join(", ");
      throw new RangeError(`the floor ${JSON.stringify(name)} is not known; use one of ${known}`);
    }
    return ground;
  }

  /** Silence. */
  reset(): void {
    for (const landing of this.landings) landing.ground = null;
    for (const ground of this.all) ground.plate.reset();
  }

  /** Begins the landings of a step, and works out what presses in it. */
  step(readings: ContactReadings, microphone: Microphone): void {
    for (let foot = 0; foot < FEET; foot++) {
      if ((readings.landingSpeed[foot] as number) > this.tables.landing.faintest) {
        this.begin(foot, readings, microphone);
      }
    }
    for (const ground of this.all) ground.count = 0;
    this.shellCount = 0;
    for (const landing of this.landings) {
      if (landing.ground !== null) this.press(landing, landing.ground);
    }
  }

  /** Adds what is heard of the floors in the step, Pa. */
  sound(out: Float64Array): void {
    if (!this.floorHeard) return;
    for (const ground of this.all) {
      ground.plate.sound(ground.presses, ground.count, out);
    }
  }

  private begin(foot: number, readings: ContactReadings, microphone: Microphone): void {
    const landing = this.free();
    const ground = this.here;
    const x = readings.footPosition[3 * foot] as number;
    const y = readings.footPosition[3 * foot + 1] as number;
    const z = (readings.footPosition[3 * foot + 2] as number) - this.tables.landing.foot_radius;
    const trunk = readings.trunkPosition;
    const toFloor = microphone.distance(x, y, z);
    const toTrunk = microphone.distance(trunk[0] as number, trunk[1] as number, trunk[2] as number);
    const law = this.tables.contact_laws[ground.table.law];
    if (law === undefined) throw new RangeError(`no contact law ${ground.table.law} in the tables`);
    landing.blow.strike(
      ground.table,
      law,
      readings.landingMass[foot] as number,
      readings.landingSpeed[foot] as number,
    );
    landing.ground = ground;
    landing.age = 0;
    const { speed_of_sound: speed } = this.tables.air;
    landing.floorDelay = Math.max(toFloor / speed, this.late) + this.wait;
    landing.shellDelay = Math.max(toTrunk / speed, this.late) + this.wait;
    landing.onFloor.begin();
    landing.onFloor.place = placeStruck(x, y, this.tables.landing.place_size, placesOf(ground));
    ground.plate.hear(landing.onFloor, toFloor, 1);
    if (this.shell === null) return;
    landing.onShell.begin();
    landing.onShell.place = foot;
    const { transmissibility, sides } = this.tables.shell;
    this.shell.hear(landing.onShell, toTrunk, transmissibility * (sides[foot] as number));
  }

  /** Returns a landing that is over, or the oldest. */
  private free(): Landing {
    let oldest = this.landings[0] as Landing;
    for (const landing of this.landings) {
      if (landing.ground === null) return landing;
      if (landing.age > oldest.age) oldest = landing;
    }
    return oldest;
  }

  /** Works out a landing's forces in the step, until it is over. */
  private press(landing: Landing, ground: Ground): void {
    const { blow, age, onFloor, onShell } = landing;
    this.fill(onFloor, blow, age - landing.floorDelay);
    ground.presses[ground.count++] = onFloor;
    if (this.shell !== null) {
      this.fill(onShell, blow, age - landing.shellDelay);
      this.shellPresses[this.shellCount++] = onShell;
    }
    landing.age += this.samples / this.rate;
    // And some samples of a tier, as tones are struck by differences over two.
    const longest = Math.max(landing.floorDelay, landing.shellDelay) + blow.duration + this.late;
    if (landing.age > longest) landing.ground = null;
  }

  private fill(press: Press, blow: Blow, elapsed: number): void {
    blow.press(elapsed, this.rate, press.force);
    for (let tier = 0; tier < press.tiers.length; tier++) {
      const { divisor, late } = this.tables.tiers[tier] as TierTable;
      const own = press.tiers[tier] as TierForce;
      blow.press(elapsed + late / this.rate, this.rate / divisor, own.force);
    }
    press.differ();
  }
}

function placesOf(ground: Ground): number {
  const { strengths, frequencies } = ground.table.plate;
  return strengths.length / frequencies.length;
}

/**
 * Returns which of a floor's places a blow hits: (73856093 i xor 19349663 j) mod places, of the
 * square i, j that it lies in, in whole numbers of 64 bits.
 */
export function placeStruck(x: number, y: number, size: number, places: number): number {
  // As Python's, which divides what is known to 24 bits in 64.
  const first = Math.floor(x / size) * 73856093;
  const second = Math.floor(y / size) * 19349663;
  const word = 0x100000000;
  const high = (Math.floor(first / word) ^ Math.floor(second / word)) % places;
  const low = (first ^ second) >>> 0;
  const sum = (high * (word % places) + (low % places)) % places;
  return (sum + places) % places;
}
