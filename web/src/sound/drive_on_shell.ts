/** The drive's force as it presses on the shell at all rates, which are to be heard together. */

import type { Drive } from "./drive.js";
import { Press, type TierForce } from "./press.js";
import type { ContactReadings } from "./readings.js";
import type { SoundTables, TierTable } from "./tables.js";

export class DriveOnShell {
  private readonly onShell: Press;
  /** The last samples of the force, and after them those of this step. */
  private readonly force: Float64Array;
  private readonly now: Float64Array;
  private readonly tiers: readonly TierTable[];

  constructor(tables: SoundTables, samples: number) {
    this.tiers = tables.tiers;
    this.onShell = new Press(tables, samples);
    const longest = Math.max(...tables.tiers.map(lag));
    this.force = new Float64Array(longest + samples);
    this.now = this.force.subarray(longest);
  }

  reset(): void {
    this.force.fill(0);
    this.onShell.begin();
  }

  /** Returns what presses on the shell in a step. */
  press(drive: Drive, readings: ContactReadings): Press {
    const { onShell, force, now } = this;
    force.copyWithin(0, now.length);
    drive.press(readings, now, now.length);
    for (let i = 0; i < now.length; i++) onShell.force[i] = force[i] as number;
    for (let tier = 0; tier < this.tiers.length; tier++) {
      this.average(this.tiers[tier] as TierTable, (onShell.tiers[tier] as TierForce).force);
    }
    onShell.differ();
    return onShell;
  }

  /** Fills in the means over the samples of a tier, which lags less the higher it is. */
  private average(tier: TierTable, into: Float64Array): void {
    const { divisor } = tier;
    const first = lag(tier);
    for (let frame = 0; frame < into.length; frame++) {
      let sum = 0;
      for (let i = 0; i < divisor; i++) sum += this.force[first + frame * divisor + i] as number;
      into[frame] = sum / divisor;
    }
  }
}

/** Returns by how many samples of sound a tier is late that is given means over the samples to come. */
export function lag(tier: TierTable): number {
  return tier.late - (tier.divisor - 1);
}
