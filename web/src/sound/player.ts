/** The page's end of the sound: starts the audio thread, and gives it what the physics tells. */

import { PATIENCE, within } from "../support/patience.js";
import {
  type FromProcessor,
  type Levels,
  PROCESSOR,
  type ProcessorOptions,
  type ToProcessor,
} from "./messages.js";
import type { SoundscapeOptions } from "./options.js";
import type { SoundTables } from "./tables.js";

/**
 * Sound pressure that is as loud as can be, Pa. At the full scale of samples, which nothing exceeds,
 * small loudspeakers would be too quiet for a walk.
 */
const LOUDEST = 2.5;

/** Frequency below which it is not played, Hz: few loudspeakers give it, and boards struck by a foot
 * have so much of it that it would leave the rest no room. Levels know nothing of this. */
const LOWEST = 50;

/** Samples beyond full scale that can still be told apart, in full scales. */
const BEYOND = 8;

/** Time after which a context that does not run has ended, ms: some pause as the tab hides. */
const GRACE = 1000;

/** Plays batches of readings as they come. Made by `startPlayer`. */
export class Player {
  /** Is told the levels, twenty times a second while there is sound. */
  onLevels: ((levels: Levels) => void) | null = null;
  /** Is told why there is no sound any more, once it ended by itself. */
  onEnd: ((why: string) => void) | null = null;
  private walk = 0;
  private plays = true;
  /** Changes of the context that were asked for and are on their way. */
  private asked = 0;

  constructor(
    private readonly context: AudioContext,
    private readonly node: AudioWorkletNode,
    grace = GRACE,
  ) {
    node.port.onmessage = (event: MessageEvent<FromProcessor>) => {
      // What was said before the audio thread heard of a new walk is of the one before.
      if (event.data.walk === this.walk) this.onLevels?.(event.data);
    };
    node.onprocessorerror = () => this.onEnd?.("the audio thread failed");
    context.onstatechange = () => {
      if (this.isOver) setTimeout(() => this.isOver && this.onEnd?.("the browser stopped it"), grace);
    };
  }

  /** Whether it does not run though it should and nobody is about to change that: a device is lost, say. */
  private get isOver(): boolean {
    return this.plays && this.asked === 0 && this.context.state !== "running";
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

  /** The walk goes on, but its figures begin anew: it is another one from now on. */
  measureAnew(): void {
    this.walk++;
    this.node.port.postMessage({ kind: "measure", walk: this.walk } satisfies ToProcessor);
  }

  /** The robot fell, and begins anew: that is in no figure. */
  leaveOut(): void {
    this.node.port.postMessage({ kind: "fall" } satisfies ToProcessor);
  }

  /** Stops, where it is; time stands still for what is heard. */
  suspend(): Promise<void> {
    this.plays = false;
    return this.change(this.context.suspend(), "stopping");
  }

  /** Goes on from there. */
  resume(): Promise<void> {
    this.plays = true;
    return this.change(this.context.resume(), "going on");
  }

  /** Ends for good. */
  close(): void {
    this.plays = false;
    closeContext(this.context);
  }

  private async change(context: Promise<void>, what: string): Promise<void> {
    this.asked++;
    try {
      await within(context, what);
    } finally {
      this.asked--;
    }
  }
}

/** Closes a context, whatever comes of it: why it is closed is told, and nothing else. */
function closeContext(context: AudioContext): void {
  context.close().catch(() => undefined);
}

/**
 * Makes a context and lets it run. To be called in a gesture itself and not after something that takes
 * time, or some browsers keep it silent.
 *
 * @param sampleRate Hz.
 * @throws Error That says in a line what is missing.
 */
export function openContext(sampleRate: number): AudioContext {
  if (typeof AudioContext !== "function") throw new Error("this browser has no Web Audio");
  const context = new AudioContext({ sampleRate, latencyHint: "interactive" });
  // Whoever waits for it again, in `startPlayer`, is told what goes wrong.
  context.resume().catch(() => undefined);
  return context;
}

/**
 * Starts the sound.
 *
 * @param context Where it is heard, from `openContext`. It is closed if anything fails.
 * @param loading What Python worked out, which may still be on its way.
 * @param worklet Address of the bundled `worklet.ts`.
 * @param options Floor and more.
 * @param patience Longest time that any part of it may take, ms.
 * @throws Error That says in a line what is missing, or took too long.
 */
export async function startPlayer(
  context: AudioContext,
  loading: SoundTables | Promise<SoundTables>,
  worklet: string,
  options: SoundscapeOptions,
  patience = PATIENCE,
): Promise<Player> {
  try {
    const tables = await within(Promise.resolve(loading), "loading it", patience);
    if (!("audioWorklet" in context)) {
      throw new Error("this browser has no audio worklets here; they need https or localhost");
    }
    await within(context.audioWorklet.addModule(worklet), `loading ${worklet}`, patience);
    const node = connect(context, tables, options);
    await within(context.resume(), "beginning to play", patience);
    return new Player(context, node);
  } catch (error) {
    closeContext(context);
    throw error;
  }
}

/** Makes the audio thread's part, and returns it once it is to be heard. */
function connect(
  context: AudioContext,
  tables: SoundTables,
  soundscape: SoundscapeOptions,
): AudioWorkletNode {
  const processorOptions: ProcessorOptions = { tables, soundscape };
  const node = new AudioWorkletNode(context, PROCESSOR, {
    numberOfInputs: 0,
    outputChannelCount: [2],
    processorOptions,
  });
  const volume = new GainNode(context, { gain: tables.full_scale / LOUDEST });
  const lowCut = new BiquadFilterNode(context, { type: "highpass", frequency: LOWEST, Q: -3 });
  limit(context, node.connect(lowCut).connect(volume)).connect(context.destination);
  return node;
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
