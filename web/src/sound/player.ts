/** The page's end of the sound: starts the audio thread, and gives it what the physics tells. */

import {
  FULL_SCALE,
  type FromProcessor,
  type Levels,
  PROCESSOR,
  type ProcessorOptions,
  type ToProcessor,
} from "./messages.js";
import type { SoundscapeOptions } from "./options.js";
import type { SoundTables } from "./tables.js";

/** Time in which the volume changes, s: at once would click. */
const VOLUME_TIME = 0.02;

/**
 * Gain of the volume 1: a sound pressure of 2.5 Pa is as loud as can be. At the full scale of 10 Pa,
 * which nothing exceeds, small loudspeakers would be too quiet for a walk.
 */
const LOUDNESS = FULL_SCALE / 2.5;

/** Frequency below which it is not played, Hz: few loudspeakers give it, and boards struck by a foot
 * have so much of it that it would leave the rest no room. Levels know nothing of this. */
const LOWEST = 50;

/** Samples beyond full scale that can still be told apart, in full scales. */
const BEYOND = 8;

/** Plays batches of readings as they come. Made by `startPlayer`. */
export class Player {
  /** Is told the levels, twenty times a second while there is sound. */
  onLevels: ((levels: Levels) => void) | null = null;
  private walk = 0;

  constructor(
    private readonly context: AudioContext,
    private readonly node: AudioWorkletNode,
    private readonly volume: GainNode,
  ) {
    node.port.onmessage = (event: MessageEvent<FromProcessor>) => {
      // What was said before the audio thread heard of a new walk is of the one before.
      if (event.data.walk === this.walk) this.onLevels?.(event.data);
    };
  }

  /** Takes physics steps in the order of time; the array is given away where it can be. */
  feed(batch: Float32Array): void {
    const whole = batch.byteLength === batch.buffer.byteLength;
    // A part of an array would drag all of it along, or take it away from others.
    const own = whole ? batch : batch.slice();
    this.node.port.postMessage({ kind: "readings", batch: own } satisfies ToProcessor, [own.buffer]);
  }

  setSurface(name: string): void {
    this.node.port.postMessage({ kind: "surface", name } satisfies ToProcessor);
  }

  /** The walk begins anew, and so do its figures. */
  reset(): void {
    this.walk++;
    this.node.port.postMessage({ kind: "reset", walk: this.walk } satisfies ToProcessor);
  }

  /** Sets the volume, 1 unless told. Levels do not change with it. */
  setVolume(gain: number): void {
    this.volume.gain.setTargetAtTime(LOUDNESS * gain, this.context.currentTime, VOLUME_TIME);
  }

  /** Stops, where it is; time stands still for what is heard. */
  suspend(): Promise<void> {
    return this.context.suspend();
  }

  /** Goes on from there. */
  resume(): Promise<void> {
    return this.context.resume();
  }

  /** Ends for good. */
  async close(): Promise<void> {
    this.node.port.onmessage = null;
    this.node.disconnect();
    await this.context.close();
  }
}

/**
 * Starts the sound; to be called in a gesture, as browsers demand.
 *
 * @param tables What Python worked out.
 * @param worklet Address of the bundled `worklet.ts`.
 * @param options Floor and more.
 * @throws Error that says in a line what is missing.
 */
export async function startPlayer(
  tables: SoundTables,
  worklet: string,
  options: SoundscapeOptions,
): Promise<Player> {
  if (typeof AudioContext !== "function") {
    throw new Error("this browser has no Web Audio");
  }
  const context = new AudioContext({ sampleRate: tables.sample_rate, latencyHint: "interactive" });
  try {
    if (!("audioWorklet" in context)) {
      throw new Error("this browser has no audio worklets here; they need https or localhost");
    }
    await context.audioWorklet.addModule(worklet);
    const processorOptions: ProcessorOptions = { tables, soundscape: options };
    const node = new AudioWorkletNode(context, PROCESSOR, {
      numberOfInputs: 0,
      outputChannelCount: [2],
      processorOptions,
    });
    const volume = new GainNode(context, { gain: LOUDNESS });
    const lowCut = new BiquadFilterNode(context, { type: "highpass", frequency: LOWEST, Q: -3 });
    limit(context, node.connect(lowCut).connect(volume)).connect(context.destination);
    await context.resume();
    return new Player(context, node, volume);
  } catch (error) {
    await context.close();
    throw error;
  }
}

/**
 * Rounds off samples near and beyond full scale, and returns what comes of it: the blow on a boarded
 * floor is several times what else there is, and low. Up to half of full scale nothing changes.
 */
function limit(context: AudioContext, sound: AudioNode): AudioNode {
  const curve = new Float32Array(4097);
  const middle = (curve.length - 1) / 2;
  for (let i = 0; i < curve.length; i++) {
    const sample = (BEYOND * (i - middle)) / middle;
    const size = Math.abs(sample);
    const heard = size < 0.5 ? size : 0.5 + 0.5 * Math.tanh(2 * size - 1);
    curve[i] = Math.sign(sample) * heard;
  }
  // A curve reaches from -1 to 1: what comes is made smaller before.
  const smaller = new GainNode(context, { gain: 1 / BEYOND });
  return sound.connect(smaller).connect(new WaveShaperNode(context, { curve }));
}
