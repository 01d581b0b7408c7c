/** What is set, kept in the address of the page, and taken from it where the visitor changes it. */

import type { PageData } from "../physics/page_data.js";
import { fromAddress, type Settings, toAddress } from "./settings.js";

/** Browsers take few changes of the address at a time, ms. */
const PATIENCE = 400;

export class AddressBar {
  private isDue = false;

  /**
   * @param kept What is set now.
   * @param page What can be set.
   */
  constructor(
    private readonly kept: () => Settings,
    private readonly page: PageData,
  ) {}

  /** Writes what is set into the address before long. */
  keep(): void {
    if (this.isDue) return;
    this.isDue = true;
    setTimeout(() => this.write(), PATIENCE);
  }

  /** Writes it now, and gives it to the visitor, who is told so in a line. */
  async share(tell: (line: string) => void): Promise<void> {
    this.write();
    const { href } = window.location;
    try {
      await navigator.clipboard.writeText(href);
      tell("The address is copied: it keeps what is set here.");
    } catch {
      // There is no clipboard without https, or the visitor does not allow it.
      tell(`Copy it yourself: ${href}`);
    }
  }

  private write(): void {
    this.isDue = false;
    window.history.replaceState(null, "", toAddress(this.kept()));
  }

  /** Begins to listen to changes by the visitor. */
  listen(take: (settings: Settings, faults: readonly string[]) => void): void {
    window.addEventListener("hashchange", () => {
      const { hash } = window.location;
      if (hash === toAddress(this.kept())) return;
      const { settings, faults } = fromAddress(hash, this.page);
      take(settings, faults);
    });
  }
}
