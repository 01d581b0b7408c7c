/** Who drives: policies of the page or of the visitor, of which the one that was asked for last wins. */

import { Latest } from "../support/latest.js";
import { messageOf } from "../support/messages.js";
import type { Policy } from "./policy.js";
import type { PolicyShelf } from "./shelf.js";

/** What is told of them. */
export interface DriversTold {
  addController(name: string, label: string): void;
  tell(line: string, isFault?: boolean): void;
}

/** Longest name of a file that is shown. */
const LONGEST_NAME = 60;

export class Drivers {
  private readonly asked = new Latest();

  /**
   * @param shelf The policies.
   * @param told What is told.
   * @param use Lets a policy drive.
   * @param keep Goes on with what drives already, as another cannot.
   */
  constructor(
    private readonly shelf: PolicyShelf,
    private readonly told: DriversTold,
    private readonly use: (name: string, policy: Policy) => void,
    private readonly keep: () => void,
  ) {}

  /** Lets a policy of the shelf drive, once it is loaded; returns whether it does. */
  async choose(name: string): Promise<boolean> {
    const isWanted = this.asked.ask();
    try {
      const policy = await this.shelf.get(name);
      if (!isWanted()) return false;
      this.use(name, policy);
      this.told.tell(`${this.shelf.label(name)} drives from now on.`);
      return true;
    } catch (error) {
      if (!isWanted()) return false;
      this.keep();
      this.told.tell(`${name}: ${messageOf(error)}`, true);
      return false;
    }
  }

  /** Lets a file of the visitor's drive. */
  async open(file: File): Promise<void> {
    const isWanted = this.asked.ask();
    const name = this.shelf.nameFor(file.name.slice(0, LONGEST_NAME));
    try {
      const policy = await this.shelf.add(name, file);
      this.told.addController(name, name);
      if (!isWanted()) return;
      this.use(name, policy);
      this.told.tell(`${name} drives from now on.`);
    } catch (error) {
      this.told.tell(`${name} is not taken: ${messageOf(error)}`, true);
    }
  }
}
