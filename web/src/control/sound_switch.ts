/** The sound of the walk, on or off: what starts it, feeds it, and keeps its levels. */

import { contactFigures, type PageData } from "../physics/page_data.js";
import type { Listener, Simulation } from "../physics/simulation.js";
import { messageOf } from "../support/messages.js";
import { type Hearing, type Levels, ReadingsBatcher } from "./hearing.js";

/** What is told of it. */
export interface SoundTold {
  /** Whether there is sound; busy while that is about to change. */
  showSound(isOn: boolean, isBusy: boolean): void;
  /** Levels, some time after the last ones, s. */
  showLevels(levels: Levels, seconds: number): void;
  tell(line: string, isFault: boolean): void;
}

const SILENCE: Levels = { level: NaN, mnl: NaN, pnl: NaN, seconds: 0 };

export class SoundSwitch {
  /** What was heard of the walk; NaN while there is none. */
  levels = SILENCE;
  private batcher: ReadingsBatcher;
  private hearing: Hearing | null = null;
  private changing: Promise<void> | null = null;
  private on = false;
  private told = 0;

  /**
   * @param simulation What is heard.
   * @param decimation Physics steps of a control step.
   * @param page Figures of contacts.
   * @param start Begins sound on a floor; null where this browser has none.
   * @param shown What is told.
   */
  constructor(
    private readonly simulation: Simulation,
    decimation: number,
    private readonly page: PageData,
    private readonly start: ((surface: string) => Promise<Hearing>) | null,
    private readonly shown: SoundTold,
  ) {
    this.batcher = this.newBatcher(decimation);
  }

  get isOn(): boolean {
    return this.on;
  }

  /** What has to be told every physics step. */
  get listener(): Listener | undefined {
    return this.on ? this.batcher.listen : undefined;
  }

  /**
   * Switches. In a gesture, as browsers demand; while it is switching already, that goes on.
   *
   * @returns Once it is done, or has failed and the visitor was told.
   */
  turn(on: boolean): Promise<void> {
    this.changing ??= this.change(on).finally(() => {
      this.changing = null;
      this.shown.showSound(this.on, false);
    });
    this.shown.showSound(this.on, true);
    return this.changing;
  }

  /** Hands over what was heard in a control step. */
  feed(): void {
    if (this.on) this.hearing?.feed(this.batcher.take());
  }

  /** The walk begins anew, with a policy of this many physics steps. */
  restart(decimation: number): void {
    this.batcher = this.newBatcher(decimation);
    this.forget();
  }

  /** The robot fell, and begins anew. */
  leaveOut(): void {
    this.batcher.restart(this.simulation);
    if (this.on) this.hearing?.leaveOut();
  }

  /** The walk goes on in another way, of which the levels are from now on. */
  measureAnew(): void {
    this.hearing?.measureAnew();
    this.levels = SILENCE;
  }

  /** Takes note of another floor. */
  changeFloor(): void {
    const { friction, name } = this.simulation.floor;
    this.batcher.setFriction(friction);
    this.hearing?.setSurface(name);
  }

  /** Pauses where the page is hidden, and goes on where it is seen. */
  async follow(hidden: boolean): Promise<void> {
    if (!this.on) return;
    try {
      await (hidden ? this.hearing?.suspend() : this.hearing?.resume());
    } catch (error) {
      this.end(messageOf(error));
    }
  }

  /** What was is neither heard nor measured any more. */
  private forget(): void {
    this.batcher.restart(this.simulation);
    this.hearing?.reset();
    this.levels = SILENCE;
  }

  private async change(on: boolean): Promise<void> {
    try {
      if (!on) await this.hearing?.suspend();
      else if (this.hearing) await this.hearing.resume();
      else this.hearing = await this.begin();
      this.on = on && this.hearing !== null;
      if (this.on) this.forget();
      if (on && document.hidden) await this.follow(true);
    } catch (error) {
      this.drop();
      this.shown.tell(`There is no sound: ${messageOf(error)}`, true);
    }
  }

  private async begin(): Promise<Hearing | null> {
    const hearing = await this.start?.(this.simulation.floor.name);
    if (!hearing) return null;
    // The floor may be another one by now.
    hearing.setSurface(this.simulation.floor.name);
    hearing.onLevels = (levels) => this.take(levels);
    hearing.onEnd = (why) => {
      if (this.hearing === hearing) this.end(why);
    };
    return hearing;
  }

  /** Sound that ended by itself may be begun anew. */
  private end(why: string): void {
    this.drop();
    this.shown.showSound(false, this.changing !== null);
    this.shown.tell(`The sound ended: ${why}. It can be switched on again.`, true);
  }

  private drop(): void {
    this.on = false;
    this.hearing?.close();
    this.hearing = null;
    this.levels = SILENCE;
    this.shown.showLevels(SILENCE, 0);
  }

  private take(levels: Levels): void {
    if (!this.on || document.hidden) return;
    const now = performance.now() / 1000;
    this.levels = levels;
    this.shown.showLevels(levels, Math.min(now - this.told, 1));
    this.told = now;
  }

  private newBatcher(decimation: number): ReadingsBatcher {
    return new ReadingsBatcher(this.simulation, decimation, contactFigures(this.page));
  }
}
