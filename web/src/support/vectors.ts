/** Parts of long arrays of numbers, as tuples whose every number is there. */

export type Triple = [number, number, number];

/** w, x, y, z. */
export type Quadruple = [number, number, number, number];

/** Returns the three numbers of an index, of an array of as many for each. */
export function triple(values: ArrayLike<number>, index = 0): Triple {
  return Array.from({ length: 3 }, (_, i) => values[3 * index + i]) as Triple;
}

/** The same of four. */
export function quadruple(values: ArrayLike<number>, index = 0): Quadruple {
  return Array.from({ length: 4 }, (_, i) => values[4 * index + i]) as Quadruple;
}
