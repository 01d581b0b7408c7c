/** Waits that end: browsers promise some things, and never say what became of them. */

/** Longest time that somebody who clicked is left waiting, ms. */
export const PATIENCE = 15_000;

/**
 * Waits for something, but not for ever.
 *
 * @param what What it is called where it is told that it took too long.
 * @param limit ms.
 * @throws Error If it has not come by then.
 */
export async function within<Type>(
  promise: Promise<Type>,
  what: string,
  limit = PATIENCE,
): Promise<Type> {
  let timer: ReturnType<typeof setTimeout> | undefined;
  const late = new Promise<never>((_, fail) => {
    timer = setTimeout(() => fail(new Error(`${what} took longer than ${limit / 1000} s`)), limit);
  });
  promise.catch(() => undefined); // what fails after that is nobody's any more
  try {
    return await Promise.race([promise, late]);
  } finally {
    clearTimeout(timer);
  }
}
