/** The policies that may drive: those of the page, loaded once they are wanted, and the visitor's. */

import type { ControllerEntry } from "../physics/page_data.js";
import { checkSize, Policy, type Robot } from "./policy.js";

export class PolicyShelf {
  private readonly policies = new Map<string, Policy>();

  /**
   * @param entries The page's own, of which there is one at least.
   * @param robot What they have to fit.
   * @param load Loads a file of the page.
   */
  constructor(
    private readonly entries: readonly ControllerEntry[],
    private readonly robot: Robot,
    private readonly load: (file: string) => Promise<Uint8Array>,
  ) {}

  /**
   * Returns a policy by its name.
   *
   * @throws Error If there is none, or its file cannot be loaded or used.
   */
  async get(name: string): Promise<Policy> {
    const known = this.policies.get(name);
    if (known) return known;
    const entry = this.entries.find((one) => one.name === name);
    if (!entry) throw new Error(`there is no controller ${name}`);
    return this.put(name, await this.load(entry.file));
  }

  /** Returns what a file of the visitor's is called: not as a policy of the page. */
  nameFor(file: string): string {
    return this.entries.some(({ name }) => name === file) ? `${file} (file)` : file;
  }

  /**
   * Adds a file of the visitor's, and returns its policy.
   *
   * @throws PolicyError If it is none.
   */
  async add(name: string, file: Blob): Promise<Policy> {
    checkSize(file.size);
    return this.put(name, new Uint8Array(await file.arrayBuffer()));
  }

  /** Returns what a policy is called in sentences. */
  label(name: string): string {
    return this.entries.find((one) => one.name === name)?.label ?? name;
  }

  /** Returns the name of a policy that others have, too: this one, or the page's first. */
  shared(name: string): string {
    return (this.entries.find((one) => one.name === name) ?? this.entries[0])?.name ?? "";
  }

  private put(name: string, file: Uint8Array): Policy {
    const policy = new Policy(file, this.robot);
    this.policies.set(name, policy);
    return policy;
  }
}
