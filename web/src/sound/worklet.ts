/** The audio thread's end of the sound. Bundled into a file of its own, which `Player` loads. */

import {
  type FromProcessor,
  PROCESSOR,
  type ProcessorOptions,
  type ToProcessor,
} from "./messages.js";
import { Playback } from "./playback.js";

declare class AudioWorkletProcessor {
  readonly port: MessagePort;
}
declare function registerProcessor(
  name: string,
  processor: new (options: { processorOptions: ProcessorOptions }) => AudioWorkletProcessor,
): void;
declare const sampleRate: number;

/** How often levels are told, Hz. */
const TOLD = 20;

class SoundProcessor extends AudioWorkletProcessor {
  private readonly playback: Playback;
  private readonly readingsPerSecond: number;
  private readonly fullScale: number;
  private silent = 0;
  private walk = 0;

  constructor(options: { processorOptions: ProcessorOptions }) {
    super();
    const { tables, soundscape } = options.processorOptions;
    this.playback = new Playback(tables, { ...soundscape, sampleRate });
    this.readingsPerSecond = tables.meter.readings_per_second;
    this.fullScale = tables.full_scale;
    this.port.onmessage = (event: MessageEvent<ToProcessor>) => this.hear(event.data);
  }

  private hear(message: ToProcessor): void {
    if (message.kind === "readings") this.playback.feed(message.batch);
    else if (message.kind === "surface") this.playback.setSurface(message.name);
    else if (message.kind === "fall") this.playback.leaveOut();
    else this.begin(message.walk, message.kind === "reset");
  }

  private begin(walk: number, silent: boolean): void {
    this.walk = walk;
    if (silent) this.playback.reset();
    else this.playback.measureAnew();
  }

  process(_inputs: Float32Array[][], outputs: Float32Array[][]): boolean {
    const channels = outputs[0];
    const out = channels?.[0];
    if (channels === undefined || out === undefined) return true;
    this.playback.play(out);
    for (let i = 0; i < out.length; i++) {
      out[i] = (out[i] as number) / this.fullScale;
    }
    for (let channel = 1; channel < channels.length; channel++) channels[channel]?.set(out);
    this.silent += out.length;
    if (this.silent >= sampleRate / TOLD) {
      this.silent = 0;
      if (this.playback.isPlaying) this.tell();
    }
    return true;
  }

  private tell(): void {
    const { level, mnl, pnl, readings } = this.playback.meter;
    const told: FromProcessor = {
      level,
      mnl,
      pnl,
      seconds: readings / this.readingsPerSecond,
      walk: this.walk,
    };
    this.port.postMessage(told);
  }
}

registerProcessor(PROCESSOR, SoundProcessor);
