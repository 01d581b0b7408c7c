/** The page at work: ties the walk to the controls, the picture, the sound and the address. */

import { Clock } from "./control/clock.js";
import { Comparison } from "./control/comparison.js";
import { type Hearing, type Levels, ReadingsBatcher } from "./control/hearing.js";
import { Rate } from "./control/rates.js";
import { Steering } from "./control/steering.js";
import { Walk } from "./control/walk.js";
import { GamepadInput } from "./input/gamepad.js";
import { makeJoystick } from "./input/joystick.js";
import { listenToKeys } from "./input/keyboard.js";
import type { Axis, Command, PageData } from "./physics/page_data.js";
import type { Ground, Simulation } from "./physics/simulation.js";
import type { Picture } from "./picture/picture.js";
import type { Policy } from "./policy/policy.js";
import type { PolicyShelf } from "./policy/shelf.js";
import { fromAddress, type Settings, toAddress } from "./settings/settings.js";
import { listenToDrops } from "./ui/drop.js";
import { anyElement } from "./ui/elements.js";
import type { Panel, PanelActions } from "./ui/panel.js";

/** What the page is made of. */
export interface Parts {
  readonly page: PageData;
  readonly simulation: Simulation;
  readonly shelf: PolicyShelf;
  /** What drives at first, of the shelf. */
  readonly first: Policy;
  readonly settings: Settings;
  readonly picture: Picture | null;
  readonly panel: Panel;
  /** Begins sound, in a gesture; null where this browser has none. */
  readonly startHearing: ((surface: string) => Promise<Hearing>) | null;
}

/** Speed that a push adds to the trunk, to one side and the other in turn, m/s. */
const PUSH = 1;

const SILENCE: Levels = { level: NaN, mnl: NaN, pnl: NaN, seconds: 0, waiting: 0 };

/** Times a second that figures are shown. */
const SHOWN = 4;

/** Time between two looks at the clock, ms. */
const TICK = 8;

export class App implements PanelActions {
  private readonly walk: Walk;
  private readonly steering: Steering;
  private readonly shelf: PolicyShelf;
  private readonly panel: Panel;
  private readonly clock = new Clock();
  private readonly gamepad: GamepadInput;
  private readonly comparison: Comparison;
  private readonly controlRate = new Rate();
  private readonly pictureRate = new Rate();
  private batcher: ReadingsBatcher;
  private hearing: Hearing | null = null;
  private isHearing = false;
  private levels = SILENCE;
  private settings: Settings;
  private pushes = 0;
  private shown = 0;
  private steps = 0;
  private heldBack = 0;
  private addressDue = false;

  constructor(private readonly parts: Parts) {
    const { page, simulation, settings, first } = parts;
    this.settings = settings;
    this.steering = new Steering(settings.command, page.command.limits);
    this.shelf = parts.shelf;
    simulation.setFloor(settings.floor);
    simulation.setGround(settings.ground, settings.level);
    this.walk = new Walk(simulation, first, page, settings.command);
    this.batcher = new ReadingsBatcher(simulation, first.decimation);
    this.panel = parts.panel;
    this.comparison = new Comparison({
      begin: (beta) => this.beginCompared(beta),
      tell: (text, isRunning) => this.panel.showComparison(text, isRunning),
      end: () => this.endCompared(),
    });
    this.gamepad = new GamepadInput({
      drive: (forward, left, turn) => this.drive(forward, turn, left),
      stopOrGo: () => this.stopOrGo(),
      push: () => this.push(),
      restart: () => this.restart(),
      connected: (name) => this.panel.tell(`The gamepad ${name} drives.`),
      lost: (name) => this.lose(name),
    });
    this.listen();
    this.show();
    parts.picture?.paint(simulation.floor.colour);
    parts.picture?.lookAhead(simulation);
    parts.picture?.jump(simulation);
  }

  /** Begins to walk, and goes on until the page is closed. */
  run(): void {
    // Not with the pictures: a machine that draws slowly still walks at the speed of real time.
    setInterval(() => {
      if (!document.hidden) this.advance(performance.now() / 1000);
    }, TICK);
    let before = performance.now();
    const frame = (now: number) => {
      requestAnimationFrame(frame);
      if (document.hidden) return;
      this.draw(now / 1000, (now - before) / 1000);
      before = now;
    };
    requestAnimationFrame(frame);
  }

  /** Control steps and pictures a second, and what a picture takes. */
  get rates() {
    return {
      control: this.controlRate.perSecond,
      pictures: this.pictureRate.perSecond,
      picture: this.parts.picture?.effort ?? null,
      seconds: this.walk.seconds,
      steps: this.steps,
    };
  }

  /** What the robot is asked to do, and does. */
  get state() {
    const { qpos } = this.parts.simulation;
    return {
      settings: this.settings,
      command: this.steering.command,
      position: Array.from(qpos.subarray(0, 3)),
      gait: this.walk.gait(),
      levels: this.levels,
      isHearing: this.isHearing,
    };
  }

  // -- what controls and keys ask for ------------------------------------------------------------

  set(axis: Axis, value: number): void {
    this.ask(() => this.steering.set({ [axis]: value }));
  }

  change(axis: Axis, step: number): void {
    this.ask(() => this.steering.change(axis, step));
  }

  stopOrGo(): void {
    this.ask(() => this.steering.stopOrGo());
  }

  push(): void {
    // Beside the robot, whichever way it looks.
    const [w, , , z] = this.parts.simulation.qpos.subarray(3, 7);
    const side = this.pushes++ % 2 ? -PUSH : PUSH;
    const heading = 2 * Math.atan2(z, w);
    this.parts.simulation.push(-side * Math.sin(heading), side * Math.cos(heading));
    this.panel.tell(`Pushed to the ${side > 0 ? "left" : "right"} by ${PUSH} m/s.`);
  }

  restart(): void {
    this.comparison.stop();
    this.begin();
    this.panel.tell("The robot starts again.");
  }

  setFloor(name: string): void {
    this.comparison.stop();
    const { simulation, picture } = this.parts;
    simulation.setFloor(name);
    this.batcher.setFriction(simulation.floor.friction);
    this.hearing?.setSurface(name);
    picture?.paint(simulation.floor.colour);
    this.keep({ floor: name });
    this.panel.tell(`The floor is ${name}.`);
  }

  setGround(choice: string): void {
    this.comparison.stop();
    const [ground, level = "0"] = choice.split(" ");
    this.parts.simulation.setGround(ground as Ground, Number(level));
    this.keep({ ground: ground as Ground, level: Number(level) });
    this.parts.picture?.lookAhead(this.parts.simulation);
    this.begin();
    const stairs =
      "The policy that ships has learnt on flat floors alone: it may stumble and fall.";
    this.panel.tell(ground === "flat" ? "The ground is flat." : stairs);
  }

  setController(name: string): void {
    void this.changeController(name);
  }

  openPolicy(file: File): void {
    void this.openFile(file);
  }

  toggleSound(): void {
    void this.switchSound(!this.isHearing);
  }

  compare(): void {
    if (this.comparison.isRunning) this.comparison.stop();
    else void this.startComparison();
  }

  share(): void {
    this.writeAddress();
    const address = window.location.href;
    const copied = navigator.clipboard?.writeText(address) ?? Promise.reject();
    copied.then(
      () => this.panel.tell("The address is copied: it keeps what is set here."),
      () => this.panel.tell(`Copy it yourself: ${address}`),
    );
  }

  // -- the walk ------------------------------------------------------------------------------------

  private advance(now: number): void {
    this.gamepad.poll();
    const due = this.clock.tick(now, this.walk.stepTime);
    for (let i = 0; i < due; i++) this.step();
    this.controlRate.add(now, due);
    if ((now - this.shown) * SHOWN >= 1) this.showFigures(now);
  }

  private draw(now: number, seconds: number): void {
    this.pictureRate.add(now, 1);
    const share = this.clock.share(now, this.walk.stepTime);
    this.parts.picture?.draw(share, this.parts.simulation, seconds);
  }

  private step(): void {
    const { walk, batcher, hearing } = this;
    const { picture, simulation } = this.parts;
    walk.command = this.steering.command;
    const outcome = walk.step(this.isHearing ? batcher.listen : undefined);
    this.steps++;
    if (this.isHearing) hearing?.feed(batcher.take());
    if (outcome === "walking") {
      picture?.keep(simulation);
    } else {
      batcher.restart(simulation);
      picture?.jump(simulation);
      this.panel.tell(`The robot ${outcome === "fallen" ? "fell" : "blew up"} and starts again.`);
    }
    this.comparison.follow(walk.seconds, this.levels.mnl);
  }

  /** Begins the walk, its figures and its levels anew. */
  private begin(): void {
    const { simulation, picture } = this.parts;
    this.walk.restart();
    this.batcher.restart(simulation);
    this.hearing?.reset();
    this.levels = SILENCE;
    picture?.jump(simulation);
  }

  private ask(change: () => void): void {
    this.comparison.stop();
    change();
    this.show();
    this.keep({ command: this.steering.command });
  }

  /** Shares from -1 to 1 of the speeds that are trained. */
  private drive(forward: number, turn: number, left = 0): void {
    const { trained } = this.parts.page.command;
    const part = (share: number, axis: "vx" | "vy" | "wz") => {
      const value = Math.abs(share) * trained[axis][share < 0 ? 0 : 1];
      return Math.round(100 * value) / 100;
    };
    this.ask(() =>
      this.steering.set({ vx: part(forward, "vx"), vy: part(left, "vy"), wz: part(turn, "wz") }),
    );
  }

  private lose(name: string): void {
    this.ask(() => this.steering.set({ vx: 0, vy: 0, wz: 0 }));
    this.panel.tell(`The gamepad ${name} is gone: the robot stands. Keys and sliders go on.`, true);
  }

  // -- controllers ---------------------------------------------------------------------------------

  private async changeController(name: string): Promise<void> {
    this.comparison.stop();
    try {
      this.use(name, await this.shelf.get(name));
      this.panel.tell(`${this.shelf.label(name)} drives from now on.`);
    } catch (error) {
      this.panel.showSettings(this.settings);
      this.panel.tell(`${name}: ${messageOf(error)}`, true);
    }
  }

  private async openFile(file: File): Promise<void> {
    const name = file.name.slice(0, 60);
    try {
      const policy = await this.shelf.add(name, file);
      this.panel.addController(name, name);
      this.comparison.stop();
      this.use(name, policy);
      this.panel.tell(`${name} drives from now on.`);
    } catch (error) {
      this.panel.tell(`${name} is not taken: ${messageOf(error)}`, true);
    }
  }

  private use(name: string, policy: Policy): void {
    this.walk.drive(policy);
    this.batcher = new ReadingsBatcher(this.parts.simulation, policy.decimation);
    this.begin();
    this.keep({ controller: name });
  }

  // -- sound ---------------------------------------------------------------------------------------

  private async switchSound(wanted: boolean): Promise<void> {
    try {
      if (wanted && !this.hearing) await this.startHearing();
      else if (wanted) await this.hearing?.resume();
      else await this.hearing?.suspend();
      this.isHearing = wanted && this.hearing !== null;
      if (wanted) this.begin();
      else this.comparison.stop();
      this.panel.showSound(this.isHearing);
    } catch (error) {
      this.isHearing = false;
      this.panel.showSound(false);
      this.panel.tell(`There is no sound: ${messageOf(error)}`, true);
    }
  }

  private async startHearing(): Promise<void> {
    const hearing = await this.parts.startHearing?.(this.settings.floor);
    if (!hearing) return;
    this.hearing = hearing;
    let before = performance.now();
    hearing.onLevels = (levels) => {
      if (!this.isHearing || document.hidden) return;
      const now = performance.now();
      this.levels = levels;
      this.panel.showLevels(levels, Math.min((now - before) / 1000, 1));
      before = now;
    };
  }

  private async startComparison(): Promise<void> {
    if (!this.isHearing) await this.switchSound(true);
    if (!this.isHearing) return;
    if (this.steering.stands) this.steering.stopOrGo();
    if (this.steering.stands) this.steering.set(this.parts.page.command.start);
    this.heldBack = this.steering.command.beta;
    this.comparison.start();
  }

  private beginCompared(beta: number): void {
    this.steering.set({ beta });
    this.show();
    this.begin();
  }

  private endCompared(): void {
    this.steering.set({ beta: this.heldBack });
    this.show();
    this.keep({ command: this.steering.command });
  }

  // -- what is shown and kept ------------------------------------------------------------------------

  private listen(): void {
    this.panel.listen(this);
    listenToKeys(document, this);
    listenToDrops((file) => this.openPolicy(file));
    makeJoystick(anyElement("pad"), anyElement("knob"), (forward, left) =>
      this.drive(forward, left),
    );
    document.addEventListener("visibilitychange", () => this.pauseOrGoOn());
    window.addEventListener("hashchange", () => this.takeAddress());
    this.panel.showSound(this.parts.startHearing ? false : null);
  }

  /** A hidden tab pauses the robot and its sound; both go on where they were. */
  private pauseOrGoOn(): void {
    this.clock.reset();
    this.controlRate.reset();
    this.pictureRate.reset();
    this.parts.picture?.forget();
    if (!this.isHearing || !this.hearing) return;
    const change = document.hidden ? this.hearing.suspend() : this.hearing.resume();
    change.catch((error: unknown) => this.panel.tell(`Sound: ${messageOf(error)}`, true));
  }

  private takeAddress(): void {
    if (window.location.hash === toAddress(this.settings)) return;
    const { settings, faults } = fromAddress(window.location.hash, this.parts.page);
    this.ask(() => this.steering.set(settings.command));
    if (settings.floor !== this.settings.floor) this.setFloor(settings.floor);
    const { ground, level, controller } = settings;
    if (ground !== this.settings.ground || level !== this.settings.level) {
      this.setGround(`${ground} ${level}`);
    }
    if (controller !== this.settings.controller) this.setController(controller);
    if (faults.length) this.tellFaults(faults);
  }

  /** Tells what is wrong with an address, in one line. */
  tellFaults(faults: readonly string[]): void {
    const more = faults.length > 1 ? ` (and ${faults.length - 1} more)` : "";
    this.panel.tell(`Left out: ${faults[0]}${more}.`, true);
  }

  private show(): void {
    this.panel.showCommand(this.steering.command, this.steering.stands);
    this.panel.showSettings(this.settings);
  }

  private showFigures(now: number): void {
    this.shown = now;
    this.panel.showGait(this.walk.gait());
    this.panel.showRates(this.controlRate.perSecond, this.pictureRate.perSecond);
  }

  private keep(parts: Partial<Settings>): void {
    this.settings = { ...this.settings, ...parts };
    this.panel.showSettings(this.settings);
    if (this.addressDue) return;
    // Browsers take few changes of the address at a time.
    this.addressDue = true;
    setTimeout(() => this.writeAddress(), 400);
  }

  private writeAddress(): void {
    this.addressDue = false;
    // A file of the visitor's own cannot be shared by an address.
    const controller = this.shelf.shared(this.settings.controller);
    window.history.replaceState(null, "", toAddress({ ...this.settings, controller }));
  }

  /** What the robot is asked to do now. */
  get command(): Command {
    return this.steering.command;
  }
}

function messageOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
