/** The controls beside the picture: what is set, what is told. It does nothing by itself. */

import type { Gait } from "../control/gait_meter.js";
import type { Levels } from "../control/hearing.js";
import type { Axis, Command, PageData } from "../physics/page_data.js";
import type { Ground } from "../physics/simulation.js";
import type { Settings } from "../settings/settings.js";
import { anyElement, button, canvas, input, output, select } from "./elements.js";
import { Trace } from "./trace.js";

/** What the controls ask for. */
export interface PanelActions {
  set(axis: Axis, value: number): void;
  stopOrGo(): void;
  push(): void;
  restart(): void;
  setFloor(name: string): void;
  setGround(ground: Ground, level: number): void;
  setController(name: string): void;
  openPolicy(file: File): void;
  toggleSound(): void;
  compare(): void;
  share(): void;
}

const UNITS: Readonly<Record<Axis, string>> = { vx: " m/s", vy: " m/s", wz: " rad/s", beta: "" };
const AXES = Object.keys(UNITS) as Axis[];

export class Panel {
  private readonly trace = new Trace(canvas("trace"));
  private readonly note = anyElement("note");

  constructor(page: PageData) {
    const { trained, limits } = page.command;
    for (const axis of AXES) {
      const [low, high] = axis === "beta" ? limits.beta : trained[axis];
      Object.assign(input(axis), { min: String(low), max: String(high) });
    }
    fill(
      select("floor"),
      page.floors.map(({ name }) => [name, name]),
    );
    fill(select("ground"), [["flat", "flat"], ...page.stairs.risers.map(stairsOption)]);
    fill(
      select("controller"),
      page.controllers.map(({ name, label }) => [name, label]),
    );
  }

  /** Shows a command. */
  showCommand(command: Command, stands: boolean): void {
    for (const axis of AXES) {
      const value = command[axis] || 0;
      input(axis).value = String(value);
      output(`${axis}-value`).value = `${value.toFixed(2)}${UNITS[axis]}`;
    }
    button("stop").textContent = stands ? "Go" : "Stop";
  }

  /** Shows all else that is set. */
  showSettings(settings: Settings): void {
    select("floor").value = settings.floor;
    select("ground").value =
      settings.ground === "flat" ? "flat" : `${settings.ground} ${settings.level}`;
    select("controller").value = settings.controller;
  }

  /** Adds a controller to the list. */
  addController(name: string, label: string): void {
    const list = select("controller");
    const known = [...list.options].find((option) => option.value === name);
    if (!known) list.add(new Option(label, name));
  }

  /** Tells something in one line. */
  tell(line: string, isFault = false): void {
    this.note.textContent = line;
    this.note.classList.toggle("fault", isFault);
  }

  /** Tells what is wrong with an address, in one line. */
  tellFaults(faults: readonly string[]): void {
    const more = faults.length > 1 ? ` (and ${faults.length - 1} more)` : "";
    this.tell(`Left out: ${faults[0]}${more}.`, true);
  }

  showGait(gait: Gait): void {
    anyElement("speed").textContent = figure(gait.speed, 2, "m/s");
    anyElement("landing").textContent = figure(gait.landing_speed_mean, 2, "m/s");
    anyElement("falls").textContent = String(gait.falls);
  }

  showRates(control: number, pictures: number): void {
    anyElement("rates").textContent =
      `control ${control.toFixed(0)} Hz, pictures ${pictures.toFixed(0)}/s`;
  }

  showLevels(levels: Levels, seconds: number): void {
    anyElement("level").textContent = figure(levels.level, 1, "");
    anyElement("mnl").textContent = figure(levels.mnl, 1, "");
    anyElement("pnl").textContent = figure(levels.pnl, 1, "");
    this.trace.add(levels.level, seconds);
  }

  /** Shows whether there is sound, and whether that is about to change. */
  showSound(isOn: boolean, isBusy: boolean): void {
    const toggle = button("sound");
    toggle.setAttribute("aria-pressed", String(isOn));
    toggle.textContent = isOn ? "Sound off" : isBusy ? "Sound begins…" : "Sound on";
    // Not disabled: that would take the focus away from whoever works it by keys.
    for (const own of [toggle, button("compare")]) own.setAttribute("aria-disabled", String(isBusy));
  }

  /** Shows that there can be no sound. */
  showNoSound(): void {
    button("sound").textContent = "No sound here";
    for (const id of ["sound", "compare"]) button(id).disabled = true;
  }

  showComparison(text: string, isRunning: boolean): void {
    anyElement("comparison").textContent = text;
    button("compare").textContent = isRunning ? "Stop comparing" : "Compare β 0 and 1";
    if (!isRunning) anyElement("countdown").textContent = "";
  }

  /** Shows how long a part of the comparison goes on; nobody wants that read out. */
  showCountdown(seconds: number): void {
    anyElement("countdown").textContent = `${seconds} s to go.`;
  }

  /** Shows that all is there, or says why there is nothing to see. */
  ready(why = ""): void {
    const loading = anyElement("loading");
    loading.hidden = why === "";
    loading.textContent = why;
  }

  /** Begins to do what the controls ask for. */
  listen(actions: PanelActions): void {
    for (const axis of AXES) {
      const slider = input(axis);
      slider.addEventListener("input", () => actions.set(axis, Number(slider.value)));
    }
    const clicks = {
      stop: actions.stopOrGo,
      push: actions.push,
      restart: actions.restart,
      sound: actions.toggleSound,
      compare: actions.compare,
      share: actions.share,
    };
    for (const [id, action] of Object.entries(clicks)) {
      const own = button(id);
      own.addEventListener("click", () => {
        if (own.getAttribute("aria-disabled") !== "true") action.call(actions);
      });
    }
    onChange(select("floor"), (value) => actions.setFloor(value));
    onChange(select("ground"), (value) => {
      const [ground, level = "0"] = value.split(" ");
      actions.setGround(ground as Ground, Number(level));
    });
    onChange(select("controller"), (value) => actions.setController(value));
    const file = input("file");
    file.addEventListener("change", () => {
      const chosen = file.files?.[0];
      if (chosen) actions.openPolicy(chosen);
      file.value = "";
    });
  }
}

function stairsOption(riser: number, level: number): [string, string] {
  return [`stairs ${level}`, `stairs, ${Math.round(100 * riser)} cm`];
}

function fill(list: HTMLSelectElement, options: readonly (readonly string[])[]): void {
  list.replaceChildren(...options.map(([value, label]) => new Option(label, value)));
}

function onChange(list: HTMLSelectElement, action: (value: string) => void): void {
  list.addEventListener("change", () => action(list.value));
}

function figure(value: number, digits: number, unit: string): string {
  return Number.isFinite(value) ? `${value.toFixed(digits)} ${unit}`.trim() : "–";
}
