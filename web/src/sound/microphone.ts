/** Where the listening is done: Python's `mute.acoustics.microphone`. */

import type { ContactReadings } from "./readings.js";

/** `trunk`: fixed in the trunk's frame. `beside`: a listener who walks along, in the frame of the
 * robot's heading, z from the ground up. `world`: fixed in the world. */
export type Mount = "trunk" | "beside" | "world";

export class Microphone {
  /** Where it is now, world frame, m. */
  readonly at = new Float64Array(3);

  /**
   * @param mount What it is fixed to.
   * @param offset Its place in that frame, m.
   * @param nearest Distance that no source is nearer than, m.
   */
  constructor(
    private readonly mount: Mount,
    private readonly offset: readonly number[],
    private readonly nearest: number,
  ) {
    if (offset.length !== 3 || !offset.every(Number.isFinite)) {
      throw new RangeError(`a microphone's offset must be three finite numbers, got ${String(offset)}`);
    }
  }

  /** Goes to where it is in a step. */
  follow(readings: ContactReadings): void {
    const { trunkPosition, trunkQuaternion } = readings;
    const [ahead, left, up] = this.offset as [number, number, number];
    const x = trunkPosition[0] as number;
    const y = trunkPosition[1] as number;
    const z = trunkPosition[2] as number;
    const qw = trunkQuaternion[0] as number;
    const qx = trunkQuaternion[1] as number;
    const qy = trunkQuaternion[2] as number;
    const qz = trunkQuaternion[3] as number;
    if (this.mount === "world") {
      this.at[0] = ahead;
      this.at[1] = left;
      this.at[2] = up;
    } else if (this.mount === "beside") {
      const yaw = Math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz));
      this.at[0] = x + Math.cos(yaw) * ahead - Math.sin(yaw) * left;
      this.at[1] = y + Math.sin(yaw) * ahead + Math.cos(yaw) * left;
      this.at[2] = up;
    } else {
      // v + 2 w (q x v) + 2 q x (q x v), of the quaternion's vector q.
      const cx = qy * up - qz * left;
      const cy = qz * ahead - qx * up;
      const cz = qx * left - qy * ahead;
      this.at[0] = x + ahead + 2 * (qw * cx + qy * cz - qz * cy);
      this.at[1] = y + left + 2 * (qw * cy + qz * cx - qx * cz);
      this.at[2] = z + up + 2 * (qw * cz + qx * cy - qy * cx);
    }
  }

  /** Returns the distance of a point, m. */
  distance(x: number, y: number, z: number): number {
    const dx = x - (this.at[0] as number);
    const dy = y - (this.at[1] as number);
    const dz = z - (this.at[2] as number);
    return Math.max(Math.sqrt(dx * dx + dy * dy + dz * dz), this.nearest);
  }
}
