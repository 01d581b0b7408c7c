/** The page's soundscape is Python's, on recorded walks; see `mute/web/sound_references.py`. */

import assert from "node:assert/strict";
import { test } from "node:test";
import { SOURCES, type Source } from "../../src/sound/options";
import { READINGS_LENGTH, viewReadings } from "../../src/sound/readings";
import { Soundscape } from "../../src/sound/soundscape";
import { figures, hear } from "./heard";
import { decibels } from "./spectrum";
import { type Figures, readReferences, readTables, readWalk } from "./walks";

const references = readReferences();
const tables = readTables();

/** Draws of the noise: one alone has third octaves that differ by half a decibel from the next. */
const SEEDS = [1, 2, 3, 4, 5, 6, 7, 8];

/**
 * Lowest third octave that is compared, Hz. A floor that floats on a light foam has losses in Python
 * that begin before the blow; here they are a dashpot's, whose lowest octaves are softer, 35 dB below
 * what one hears.
 */
const LOWEST: Record<string, number> = { laminate: 160 };

function middleOf(band: number): number {
  const [low, high] = references.bands[band] as readonly [number, number];
  return Math.sqrt(low * high);
}

function assertBands(heard: Figures, wanted: Figures, lowest: number, most: number, name: string): void {
  wanted.bands.forEach((level, band) => {
    if (middleOf(band) < lowest) return;
    const off = (heard.bands[band] as number) - level;
    const told = `${name}, ${middleOf(band).toFixed(0)} Hz: ${off.toFixed(2)} dB from Python's`;
    assert.ok(Math.abs(off) < most, told);
  });
}

/** Sources whose sound is the same each time, and those that are drawn. */
const STEADY: readonly Source[] = ["impacts", "body", "drive"];
const DRAWN: readonly Source[] = ["scuffing", "fan"];

/** Returns the sum of sounds of one length. */
function sum(...sounds: Float32Array[]): Float32Array {
  const total = Float32Array.from(sounds[0] as Float32Array);
  for (const sound of sounds.slice(1)) {
    for (let i = 0; i < total.length; i++) total[i] = (total[i] as number) + (sound[i] as number);
  }
  return total;
}

for (const [name, wanted] of Object.entries(references.walks)) {
  const surface = name.split("-")[0] as string;

  test(`on ${name} levels are Python's within 0.15 dB and third octaves within 1 dB`, () => {
    const readings = readWalk(name, references);
    const alone = (source: Source, seed: number) =>
      hear(tables, readings, { surface, seed, sources: [source] });
    const steady = STEADY.map((source) => alone(source, 0));
    const drawn = DRAWN.map((source) => SEEDS.map((seed) => alone(source, seed)));
    const whole = SEEDS.map((_, draw) =>
      sum(...steady, ...drawn.map((sounds) => sounds[draw] as Float32Array)),
    );
    const heard = figures(whole, tables, references.bands);
    assertLevels(heard, wanted, 0.15, "in all");
    assert.ok(Math.abs(heard.pnl - wanted.pnl) < 0.5, `pnl ${heard.pnl} for ${wanted.pnl}`);
    assertBands(heard, wanted, LOWEST[surface] ?? 25, 1, name);
    STEADY.forEach((source, index) => {
      const own = wanted.sources[source] as Figures;
      if (own.laeq < 25) return; // nobody hears a slab under a carpet
      const one = figures([steady[index] as Float32Array], tables, references.bands);
      assertLevels(one, own, 0.15, source);
    });
    DRAWN.forEach((source, index) => {
      const own = figures(drawn[index] as Float32Array[], tables, references.bands);
      assertLevels(own, wanted.sources[source] as Figures, 0.3, source);
    });
  });
}

function assertLevels(heard: Figures, wanted: Figures, most: number, name: string): void {
  for (const figure of ["mnl", "laeq"] as const) {
    const off = heard[figure] - wanted[figure];
    assert.ok(Math.abs(off) < most, `${name}, ${figure}: ${off.toFixed(3)} dB from Python's`);
  }
}

test("a listener who walks along hears what Python's hears", () => {
  const microphone = { mount: "beside", offset: references.beside.offset } as const;
  for (const [name, wanted] of Object.entries(references.beside.walks)) {
    const surface = name.split("-")[0] as string;
    const readings = readWalk(name, references);
    const sounds = [1, 2].map((seed) => hear(tables, readings, { surface, seed, microphone }));
    assertLevels(figures(sounds, tables, references.bands), wanted, 0.2, name);
  }
});

test("a source sounds the same alone as among the others", () => {
  const readings = readWalk("wood-0", references).subarray(0, 600 * READINGS_LENGTH);
  const alone = SOURCES.map((source) =>
    hear(tables, readings, { surface: "wood", seed: 5, sources: [source] }),
  );
  const parts = sum(...alone);
  const whole = hear(tables, readings, { surface: "wood", seed: 5 });
  const difference = whole.map((sample, i) => sample - (parts[i] as number));
  // What rings is let go 60 dB down, unless something else keeps it going.
  const [off, own] = [difference, whole].map((sound) =>
    decibels(sound.reduce((squares, sample) => squares + sample ** 2, 0) / sound.length),
  ) as [number, number];
  assert.ok(off < own - 50, `${off.toFixed(1)} dB beside ${own.toFixed(1)} dB`);
});

test("what feet and gears make ring has Python's third octaves up to 1.6 kHz", () => {
  for (const name of ["wood-0", "tile-0", "concrete-1", "parquet-0"]) {
    const surface = name.split("-")[0] as string;
    const readings = readWalk(name, references);
    for (const source of STEADY) {
      const own = references.walks[name]?.sources[source] as Figures;
      const sound = hear(tables, readings, { surface, sources: [source] });
      const heard = figures([sound], tables, references.bands);
      const faintest = Math.max(...own.bands) - 50;
      own.bands.forEach((level, band) => {
        const middle = middleOf(band);
        // Below the shell's first mode there is no more than the edges of what is above.
        if (middle < (source === "impacts" ? 25 : 190) || middle > 1700) return;
        if (level < faintest) return;
        const off = (heard.bands[band] as number) - level;
        const told = `${name} ${source}, ${middle.toFixed(0)} Hz: ${off.toFixed(2)} dB`;
        assert.ok(Math.abs(off) < 1, told);
      });
    }
  }
});

test("equal seeds give equal sound, others other noise of the same level", () => {
  const readings = readWalk("wood-1", references).subarray(0, 500 * READINGS_LENGTH);
  const [first, again, other] = [3, 3, 4].map((seed) =>
    hear(tables, readings, { surface: "wood", seed }),
  ) as [Float32Array, Float32Array, Float32Array];
  assert.deepEqual(first, again);
  assert.notDeepEqual(first, other);
});

test("sound does not depend on the lengths in which it is rendered", () => {
  const readings = readWalk("wood-0", references).subarray(0, 300 * READINGS_LENGTH);
  const whole = hear(tables, readings, { surface: "wood" });
  const soundscape = new Soundscape(tables, { surface: "wood" });
  const parts = new Float32Array(whole.length);
  for (let step = 0; step < 300; step++) soundscape.step(viewReadings(readings, step));
  const lengths = [1, 128, 7, 480, 50];
  for (let at = 0, turn = 0; at < parts.length; turn++) {
    const length = Math.min(lengths[turn % lengths.length] as number, parts.length - at);
    assert.equal(soundscape.render(parts.subarray(at, at + length)), length);
    at += length;
  }
  assert.deepEqual(parts, whole);
});

test("bad options are refused by name", () => {
  const make = (options: object) => () => new Soundscape(tables, { surface: "wood", ...options });
  assert.throws(make({ surface: "lava" }), /lava.*wood, parquet, laminate, carpet, tile, concrete/);
  assert.throws(make({ sampleRate: 44100 }), /sampleRate must be 48000 Hz, got 44100/);
  assert.throws(make({ timestep: 0.0011 }), /timestep must be a multiple/);
  assert.throws(make({ sources: ["choir"] }), /sources must be of impacts.*choir/);
  assert.throws(make({ microphone: { mount: "trunk", offset: [NaN, 0, 0] } }), /three finite/);
});
