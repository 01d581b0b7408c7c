/**
 * What one physics step hands over to be heard: landings, sliding, the work of the joints, and where
 * all is. The same quantities as Python's `mute.acoustics.contacts.ContactBlock`, of one robot and one
 * step. Legs are in the order FR, FL, RR, RL, joints within a leg hip, thigh, calf.
 *
 * All numbers of a step lie in one Float32Array, so that a batch of steps is one transfer to the
 * audio thread. `Recorder` (recorder.ts) makes readings of a simulation's sensors.
 */

export const FEET = 4;
export const JOINTS = 12;

/** One physics step. Every array is a view of `packed`. */
export interface ContactReadings {
  /** All of the below, in this order. */
  readonly packed: Float32Array;
  /** Approach speed of each foot that landed in this step, along the floor's normal, just before
   * contact, m/s; 0 of a foot that did not land. */
  readonly landingSpeed: Float32Array;
  /** Effective mass at each foot that landed, (n^T J M^-1 J^T n)^-1, kg; of no meaning else. */
  readonly landingMass: Float32Array;
  /** Power that each foot loses to the floor by sliding, W, not negative. */
  readonly frictionPower: Float32Array;
  /** Centres of the feet in the world frame, m: x, y, z of each. */
  readonly footPosition: Float32Array;
  /** Angle of each joint, rad. */
  readonly jointPosition: Float32Array;
  /** Velocity of each joint, rad/s. */
  readonly jointVelocity: Float32Array;
  /** Torque of each joint's drive, N m. */
  readonly jointTorque: Float32Array;
  /** Trunk in the world frame, m. */
  readonly trunkPosition: Float32Array;
  /** Trunk's orientation in the world, a unit quaternion w x y z. */
  readonly trunkQuaternion: Float32Array;
}

/** Lengths of the arrays in `packed`, in their order. */
const LENGTHS = {
  landingSpeed: FEET,
  landingMass: FEET,
  frictionPower: FEET,
  footPosition: 3 * FEET,
  jointPosition: JOINTS,
  jointVelocity: JOINTS,
  jointTorque: JOINTS,
  trunkPosition: 3,
  trunkQuaternion: 4,
} as const;

/** Numbers of one step. */
export const READINGS_LENGTH = Object.values(LENGTHS).reduce((sum, length) => sum + length, 0);

/**
 * Returns readings in some part of an array, or in one of their own.
 *
 * @param into Where they lie; a batch of n steps is an array of n times `READINGS_LENGTH`.
 * @param step Which of the steps in `into`.
 */
export function viewReadings(
  into: Float32Array = new Float32Array(READINGS_LENGTH),
  step = 0,
): ContactReadings {
  let offset = step * READINGS_LENGTH;
  if (offset < 0 || offset + READINGS_LENGTH > into.length) {
    throw new RangeError(`no step ${step} in an array of ${into.length} numbers`);
  }
  const packed = into.subarray(offset, offset + READINGS_LENGTH);
  const views: Record<string, Float32Array> = {};
  for (const [name, length] of Object.entries(LENGTHS)) {
    views[name] = into.subarray(offset, offset + length);
    offset += length;
  }
  return { packed, ...views } as unknown as ContactReadings;
}
