/** What the page is made of, once all is loaded. */

import type { PageData } from "./physics/page_data.js";
import type { Simulation } from "./physics/simulation.js";
import type { Picture } from "./picture/picture.js";
import type { Policy } from "./policy/policy.js";
import type { PolicyShelf } from "./policy/shelf.js";
import type { Settings } from "./settings/settings.js";
import type { StartHearing } from "./sound_files.js";
import type { Panel } from "./ui/panel.js";

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
  readonly startHearing: StartHearing | null;
}
