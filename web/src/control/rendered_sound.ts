/**
 * The sound of a walk as the page's own worklet makes it, without a loudspeaker and without waiting:
 * for tests, which measure these very samples.
 */

import { LevelMeter } from "../sound/level_meter.js";
import { PROCESSOR, type ProcessorOptions, type ToProcessor } from "../sound/messages.js";
import { READINGS_LENGTH } from "../sound/readings.js";
import type { SoundTables } from "../sound/tables.js";

/** Time between two deliveries of readings, s, and what is delivered before the first, s. */
const DELIVERY = 0.1;
const SUPPLY = 0.2;

/** Time that the audio thread takes to notice a delivery, ms. */
const NOTICE = 15;

/** Samples of a quantum of Web Audio, at whose ends alone it can be halted. */
const QUANTUM = 128;

/**
 * Renders.
 *
 * @param tables Tables of the sound.
 * @param worklet Address of the worklet.
 * @param surface Name of the floor.
 * @param timestep Physics step, s.
 * @param readings All physics steps, one after the other.
 * @returns Samples, of which 1 is full scale.
 */
export async function renderSound(
  tables: SoundTables,
  worklet: string,
  surface: string,
  timestep: number,
  readings: Float32Array,
): Promise<Float32Array> {
  const rate = tables.sample_rate;
  const seconds = (readings.length / READINGS_LENGTH) * timestep;
  const context = new OfflineAudioContext(1, Math.floor(seconds * rate), rate);
  await context.audioWorklet.addModule(worklet);
  const processorOptions: ProcessorOptions = { tables, soundscape: { surface, timestep } };
  const node = new AudioWorkletNode(context, PROCESSOR, {
    numberOfInputs: 0,
    outputChannelCount: [1],
    processorOptions,
  });
  node.connect(context.destination);
  let delivered = 0;
  const deliver = async (until: number) => {
    const end = Math.min(Math.round(until / timestep) * READINGS_LENGTH, readings.length);
    const message: ToProcessor = { kind: "readings", batch: readings.slice(delivered, end) };
    node.port.postMessage(message);
    delivered = end;
    await new Promise((resolve) => setTimeout(resolve, NOTICE));
  };
  for (let time = DELIVERY; time < seconds; time += DELIVERY) {
    const halt = (Math.floor((time * rate) / QUANTUM) * QUANTUM) / rate;
    void context.suspend(halt).then(async () => {
      await deliver(halt + SUPPLY);
      await context.resume();
    });
  }
  await deliver(SUPPLY);
  return (await context.startRendering()).getChannelData(0);
}

/** Returns the levels of samples, of which 1 is full scale, dBA. */
export function levelsOf(samples: Float32Array, tables: SoundTables): { mnl: number; pnl: number } {
  const meter = new LevelMeter(tables);
  meter.measureAnew();
  meter.update(samples.map((sample) => tables.full_scale * sample));
  return { mnl: meter.mnl, pnl: meter.pnl };
}
