/**
 * How many times faster than real time the sound is made: npm run bench:sound.
 *
 * What counts is the time of the processor, as other programs may run beside it; of several turns
 * the fastest and the middle one.
 */

import { Playback } from "../../src/sound/playback";
import { READINGS_LENGTH } from "../../src/sound/readings";
import { readReferences, readTables, readWalk } from "./walks";

/** Samples that an audio thread asks for at a time. */
const QUANTUM = 128;
const TURNS = 12;
const STEPS_FED = 20;

const references = readReferences();
const tables = readTables();

for (const name of Object.keys(references.walks)) {
  const surface = name.split("-")[0] as string;
  const [fastest, middle] = benchmark(surface, readWalk(name, references));
  const share = (100 / middle).toFixed(1);
  console.log(
    `${name.padEnd(12)} ${middle.toFixed(0).padStart(4)} times real time, ${share} % of a core ` +
      `(at best ${fastest.toFixed(0)})`,
  );
}

/** Returns the best and the median of how many seconds of sound take one of the processor. */
function benchmark(surface: string, walk: Float32Array): [number, number] {
  const playback = new Playback(tables, { surface });
  const out = new Float32Array(QUANTUM);
  const batch = STEPS_FED * READINGS_LENGTH;
  const turn = () => {
    const begin = process.cpuUsage();
    let samples = 0;
    for (let at = 0; at + batch <= walk.length; at += batch) {
      playback.feed(walk.subarray(at, at + batch));
      const until = samples + STEPS_FED * references.timestep * tables.sample_rate;
      for (; samples < until; samples += QUANTUM) playback.play(out);
    }
    const { user, system } = process.cpuUsage(begin);
    return samples / tables.sample_rate / ((user + system) / 1e6);
  };
  turn();
  const speeds = Array.from({ length: TURNS }, turn).sort((a, b) => a - b);
  return [speeds[TURNS - 1] as number, speeds[TURNS / 2] as number];
}
