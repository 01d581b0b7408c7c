/**
 * A plate that forces press on, as it is heard: what it radiates at once, and what rings on. The
 * running form of Python's `mute.acoustics.sources.response`.
 */

import type { Press } from "./press.js";
import type { Band } from "./resonators.js";
import { Sections } from "./sections.js";
import type { PlateTable, SoundTables } from "./tables.js";
import { Tier } from "./tier.js";

/** Time in which the filters answer, s. */
const SETTLING = 0.1;

export class PlateSound {
  private readonly table: PlateTable;
  private readonly tiers: Tier[];
  private readonly direct: Sections;
  private readonly after: Sections;
  private readonly heard: Float64Array;
  private readonly octaves: number;
  /** Samples after the last force in which all is over, and how many of them are left. */
  private readonly lasting: number;
  private left = 0;

  /**
   * @param table The plate.
   * @param tables Where the tiers are told.
   * @param samples Samples of a block.
   */
  constructor(table: PlateTable, tables: SoundTables, samples: number) {
    this.table = table;
    this.tiers = tables.tiers.map(
      (_, index) => new Tier(bandsOf(table, index), tables, index, samples),
    );
    this.direct = new Sections(table.direct);
    this.after = new Sections(table.after);
    this.heard = new Float64Array(samples);
    this.octaves = table.spread.length / table.distances.length;
    this.lasting = Math.ceil((Math.max(...table.decays) + SETTLING) * tables.sample_rate);
  }

  /** Silence. */
  reset(): void {
    this.left = 0;
    for (const tier of this.tiers) tier.reset();
    this.direct.reset();
    this.after.reset();
  }

  /** Sets how a press is heard that is a distance away, m, times a factor. */
  hear(press: Press, apart: number, size: number): void {
    const { distances, spread } = this.table;
    const { octaves } = this;
    const first = distances[0] as number;
    const ratio = Math.log((distances[1] as number) / first);
    const last = distances.length - 1;
    const position = Math.min(Math.max(Math.log(apart / first) / ratio, 0), last);
    const index = Math.min(Math.floor(position), last - 1);
    press.near = (size * this.table.direct_gain) / apart;
    for (let octave = 0; octave < octaves; octave++) {
      const near = spread[index * octaves + octave] as number;
      const far = spread[(index + 1) * octaves + octave] as number;
      press.gains[octave] = (size / apart) * (near + (position - index) * (far - near));
    }
  }

  /**
   * Adds a block, Pa.
   *
   * @param presses Forces, of which the first `count` press.
   * @param out Where to.
   */
  sound(presses: readonly Press[], count: number, out: Float64Array): void {
    const { heard } = this;
    if (count > 0) {
      this.left = this.lasting;
    } else {
      if (this.left <= 0) return;
      this.left -= heard.length;
      if (this.left <= 0) {
        this.reset();
        return;
      }
    }
    this.radiate(presses, count);
    for (let tier = 0; tier < this.tiers.length; tier++) {
      (this.tiers[tier] as Tier).ring(presses, count, heard);
    }
    this.after.filter(heard, heard.length);
    for (let i = 0; i < heard.length; i++) out[i] = (out[i] as number) + (heard[i] as number);
  }

  /** Fills `heard` with what is radiated at once. */
  private radiate(presses: readonly Press[], count: number): void {
    const { heard } = this;
    heard.fill(0);
    for (let each = 0; each < count; each++) {
      const { near, force } = presses[each] as Press;
      for (let i = 0; i < heard.length; i++) {
        heard[i] = (heard[i] as number) + near * (force[i] as number);
      }
    }
    this.direct.filter(heard, heard.length);
  }
}

/** Returns the third octaves that ring in a tier. */
function bandsOf(table: PlateTable, tier: number): Band[] {
  const tones = table.frequencies.length;
  const places = table.strengths.length / tones;
  const bands: Band[] = [];
  let first = 0;
  table.counts.forEach((count, band) => {
    const stop = first + count;
    if (table.tiers[band] === tier) {
      bands.push({
        octave: table.octaves[band] as number,
        decay: table.decays[band] as number,
        frequencies: table.frequencies.subarray(first, stop),
        strengths: Array.from({ length: places }, (_, place) =>
          table.strengths.subarray(place * tones + first, place * tones + stop),
        ),
      });
    }
    first = stop;
  });
  return bands;
}
