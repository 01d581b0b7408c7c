/** The page at work: does what its controls ask for, and shows and keeps what is set. */

import { Comparing } from "./comparing.js";
import { Loop } from "./control/loop.js";
import { Mishaps } from "./control/mishaps.js";
import { SoundSwitch } from "./control/sound_switch.js";
import { Steering } from "./control/steering.js";
import { GamepadInput } from "./input/gamepad.js";
import { makeJoystick } from "./input/joystick.js";
import { listenToKeys } from "./input/keyboard.js";
import { LiveWalk, PUSH } from "./live_walk.js";
import type { Parts } from "./parts.js";
import type { Axis } from "./physics/page_data.js";
import type { Ground } from "./physics/simulation.js";
import { Drivers } from "./policy/drivers.js";
import type { Policy } from "./policy/policy.js";
import { AddressBar } from "./settings/address_bar.js";
import type { Settings } from "./settings/settings.js";
import { listenToDrops } from "./ui/drop.js";
import { anyElement } from "./ui/elements.js";
import type { Panel, PanelActions } from "./ui/panel.js";

export class App implements PanelActions {
  private readonly loop: Loop;
  private readonly live: LiveWalk;
  private readonly steering: Steering;
  private readonly drivers: Drivers;
  private readonly panel: Panel;
  private readonly gamepad: GamepadInput;
  private readonly comparing: Comparing;
  private readonly address: AddressBar;
  private readonly mishaps = new Mishaps();
  private settings: Settings;

  constructor(private readonly parts: Parts) {
    const { page, simulation, settings, first, picture, panel, startHearing } = parts;
    this.settings = settings;
    this.panel = panel;
    this.steering = new Steering(settings.command, page.command);
    simulation.setFloor(settings.floor);
    simulation.setGround(settings.ground, settings.level);
    const sound = new SoundSwitch(simulation, first.decimation, page, startHearing, panel);
    this.live = new LiveWalk(simulation, first, page, picture, sound);
    this.comparing = new Comparing(this.live, this.steering, panel, () => this.show());
    this.drivers = new Drivers(
      parts.shelf,
      panel,
      (name, policy) => this.use(name, policy),
      () => this.show(),
    );
    this.gamepad = new GamepadInput(this);
    this.address = new AddressBar(() => this.shared(), page);
    this.loop = new Loop({
      stepTime: () => this.live.stepTime,
      poll: () => this.gamepad.poll(),
      step: () => this.step(),
      draw: (share, seconds) => this.live.draw(share, seconds),
      showFigures: () => this.showFigures(),
      pauseOrGoOn: (hidden) => this.pauseOrGoOn(hidden),
    });
    this.show();
  }

  /** Begins to walk and to listen, and goes on until the page is closed. */
  run(): void {
    this.panel.listen(this);
    listenToKeys(document, this);
    listenToDrops((file) => this.openPolicy(file));
    makeJoystick(anyElement("pad"), anyElement("knob"), (forward, left) =>
      this.drive(forward, 0, left),
    );
    this.address.listen((settings, faults) => void this.takeAddress(settings, faults));
    this.loop.run();
  }

  /** Control steps and pictures a second, and what a picture takes. */
  get rates() {
    const { loop, live, parts } = this;
    return {
      control: loop.controlRate.perSecond,
      pictures: loop.pictureRate.perSecond,
      picture: parts.picture?.effort ?? null,
      seconds: live.seconds,
      steps: loop.steps,
    };
  }

  /** What the robot is asked to do, and does. */
  get state() {
    const { live, settings, steering, parts } = this;
    return {
      settings,
      command: steering.command,
      position: live.position,
      gait: live.gait,
      levels: live.sound.levels,
      isHearing: live.sound.isOn,
      camera: parts.picture?.orbit.place ?? null,
    };
  }

  // -- what controls, keys and gamepads ask for ----------------------------------------------------

  set(axis: Axis, value: number): void {
    this.ask(() => this.steering.set({ [axis]: value }));
  }

  change(axis: Axis, step: number): void {
    this.ask(() => this.steering.change(axis, step));
  }

  stopOrGo(): void {
    const { stands } = this.steering;
    this.gamepad.release();
    this.ask(() => {
      // A comparison that this ends puts its command back, which may be the one that is wanted.
      if (this.steering.stands === stands) this.steering.stopOrGo();
    });
  }

  /** Shares from -1 to 1 of the speeds that are trained. */
  drive(forward: number, left: number, turn = 0): void {
    // A stick that is held asks many times a second, mostly for what is so already.
    if (!this.steering.isPulled(forward, left, turn)) {
      this.ask(() => this.steering.pull(forward, left, turn));
    }
  }

  connected(name: string): void {
    this.panel.tell(`The gamepad ${name} drives.`);
  }

  /** A gamepad went: whatever it asked for, the robot stands. */
  lost(name: string): void {
    this.ask(() => this.steering.set({ vx: 0, vy: 0, wz: 0 }));
    this.panel.tell(`The gamepad ${name} is gone: the robot stands. Keys and sliders go on.`, true);
  }

  push(): void {
    this.comparing.stop(); // of a robot that stumbles nothing can be told
    this.panel.tell(`Pushed to the ${this.live.push()} by ${PUSH} m/s.`);
  }

  restart(): void {
    this.comparing.stop();
    this.live.begin();
    this.panel.tell("The robot starts again.");
  }

  setFloor(name: string): void {
    this.comparing.stop();
    this.live.setFloor(name);
    this.keep({ floor: name });
    this.panel.tell(`The floor is ${name}.`);
  }

  setGround(ground: Ground, level: number): void {
    this.comparing.stop();
    this.live.setGround(ground, level);
    this.keep({ ground, level });
    const stairs = "Stairs lie ahead: who has learnt on flat floors alone stumbles and falls.";
    this.panel.tell(ground === "flat" ? "The ground is flat." : stairs);
  }

  setController(name: string): void {
    void this.drivers.choose(name);
  }

  openPolicy(file: File): void {
    void this.drivers.open(file);
  }

  toggleSound(): void {
    this.comparing.stop();
    void this.live.sound.turn(!this.live.sound.isOn);
  }

  compare(): void {
    this.comparing.toggle();
  }

  turnCamera(around: number, up: number, away: number): void {
    this.parts.picture?.orbit.turn(around, up, away);
  }

  share(): void {
    void this.address.share((line) => this.panel.tell(line));
  }

  // -- what goes on by itself ----------------------------------------------------------------------

  private step(): void {
    const outcome = this.live.step(this.steering.command);
    const mishap = this.mishaps.after(outcome, this.live.stepTime);
    if (mishap) this.panel.tell(mishap);
    this.comparing.follow(outcome);
  }

  private showFigures(): void {
    this.panel.showGait(this.live.gait);
    this.panel.showRates(this.loop.controlRate.perSecond, this.loop.pictureRate.perSecond);
  }

  private pauseOrGoOn(hidden: boolean): void {
    this.parts.picture?.forget();
    void this.live.sound.follow(hidden);
  }

  // -- what is set ---------------------------------------------------------------------------------

  private ask(change: () => void): void {
    this.comparing.stop();
    const before = JSON.stringify(this.steering.command);
    change();
    const { command } = this.steering;
    // Levels and figures are of what it is asked for now.
    if (JSON.stringify(command) !== before) this.live.measureAnew();
    this.show();
    this.keep({ command });
  }

  private use(name: string, policy: Policy): void {
    this.comparing.stop();
    this.live.use(policy);
    this.keep({ controller: name });
  }

  private async takeAddress(settings: Settings, faults: readonly string[]): Promise<void> {
    this.ask(() => this.steering.set(settings.command));
    const { floor, ground, level, controller } = settings;
    if (floor !== this.settings.floor) this.setFloor(floor);
    if (ground !== this.settings.ground || level !== this.settings.level) {
      this.setGround(ground, level);
    }
    const other = controller !== this.settings.controller && this.drivers.choose(controller);
    if (faults.length) this.panel.tellFaults(faults);
    // Again after what is told of who drives.
    if ((await other) && faults.length) this.panel.tellFaults(faults);
  }

  /** A file of the visitor's own cannot be shared by an address. */
  private shared(): Settings {
    const { settings } = this;
    return { ...settings, controller: this.parts.shelf.shared(settings.controller) };
  }

  private show(): void {
    this.panel.showCommand(this.steering.command, this.steering.stands);
    this.panel.showSettings(this.settings);
  }

  private keep(parts: Partial<Settings>): void {
    this.settings = { ...this.settings, ...parts };
    this.panel.showSettings(this.settings);
    this.address.keep();
  }
}
