/** The built page in a real browser: Chromium as the system has it, without a screen. */

import { existsSync, mkdirSync } from "node:fs";
import { join } from "node:path";
import { type Browser, type BrowserContextOptions, chromium, type Page } from "playwright-core";

import type {} from "../src/console.js";
import { serve } from "./serve.js";

const PLACES = [process.env.CHROMIUM ?? "", "/usr/bin/chromium", "/usr/bin/chromium-browser"];

/** Where pictures of the page are kept. */
export const PICTURES = join(".test", "pictures");

/** A page that is open, and everything that went wrong in it. */
export interface Opened {
  readonly page: Page;
  /** Errors of scripts and of the console. */
  readonly errors: string[];
  /** Addresses that were asked for outside the page's own server. */
  readonly strangers: string[];
  /** What the page says in its line. */
  note(): Promise<string>;
  picture(name: string): Promise<void>;
}

export interface Visit extends BrowserContextOptions {
  /** What comes after the page's address. */
  readonly hash?: string;
  /** Runs in the page before anything of its own. */
  readonly before?: () => void;
  /** Whether the page is expected to begin. */
  readonly begins?: boolean;
}

/** A server of the built page and a browser, both to be closed. */
export class Site {
  private constructor(
    private readonly browser: Browser,
    private readonly server: Awaited<ReturnType<typeof serve>>,
  ) {}

  static async open(flags: readonly string[] = []): Promise<Site> {
    const executablePath = PLACES.find((place) => place && existsSync(place));
    if (!executablePath) throw new Error("there is no chromium; name one with CHROMIUM");
    mkdirSync(PICTURES, { recursive: true });
    const args = ["--no-sandbox", "--enable-unsafe-swiftshader", "--mute-audio", ...flags];
    const browser = await chromium.launch({ executablePath, args });
    return new Site(browser, await serve("dist"));
  }

  async close(): Promise<void> {
    await this.browser.close();
    this.server.close();
  }

  async visit(visit: Visit = {}): Promise<Opened> {
    const { hash = "", before, begins = true, ...options } = visit;
    const context = await this.browser.newContext({
      viewport: { width: 1280, height: 800 },
      ...options,
    });
    const page = await context.newPage();
    const errors: string[] = [];
    const strangers: string[] = [];
    page.on("pageerror", (error) => errors.push(error.message));
    page.on("console", (message) => {
      if (message.type() === "error") errors.push(message.text());
    });
    page.on("request", (request) => {
      const url = request.url();
      const own = [this.server.address, "data:", "blob:"].some((start) => url.startsWith(start));
      if (!own) strangers.push(url);
    });
    if (before) await page.addInitScript(before);
    await page.goto(this.server.address + hash);
    if (begins) await page.waitForFunction(() => globalThis.mute !== undefined, null, LONG);
    return {
      page,
      errors,
      strangers,
      note: async () => (await page.textContent("#note")) ?? "",
      picture: async (name) => {
        await page.screenshot({ path: join(PICTURES, `${name}.png`) });
      },
    };
  }
}

/** For machines that are busy with something else. */
export const LONG = { timeout: 120_000 };
