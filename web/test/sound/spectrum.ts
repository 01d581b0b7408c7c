/** Third octaves by one transform, as `mute/web/sound_references.py` takes them. */

/** Mean square of 0 dB, Pa^2. */
const REFERENCE = 20e-6 ** 2;

/** Returns the mean square in each band, Pa^2. */
export function bandSquares(
  sound: Float32Array,
  bands: readonly (readonly [number, number])[],
  rate: number,
): Float64Array {
  const length = 1 << Math.ceil(Math.log2(sound.length));
  const real = new Float64Array(length);
  const imaginary = new Float64Array(length);
  let squares = 0;
  for (let i = 0; i < sound.length; i++) {
    const window = 0.5 - 0.5 * Math.cos((2 * Math.PI * i) / sound.length);
    real[i] = window * (sound[i] as number);
    squares += window * window;
  }
  transform(real, imaginary);
  const scale = 2 / (length * squares);
  return Float64Array.from(bands, ([low, high]) => {
    let sum = 0;
    for (let k = Math.ceil((low * length) / rate); (k * rate) / length < high; k++) {
      sum += (real[k] as number) ** 2 + (imaginary[k] as number) ** 2;
    }
    return scale * sum;
  });
}

export function decibels(meanSquare: number): number {
  return 10 * Math.log10(meanSquare / REFERENCE);
}

/** Fourier's transform in place, of a power of two. */
function transform(real: Float64Array, imaginary: Float64Array): void {
  const length = real.length;
  for (let i = 1, j = 0; i < length; i++) {
    let bit = length >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) {
      [real[i], real[j]] = [real[j] as number, real[i] as number];
      [imaginary[i], imaginary[j]] = [imaginary[j] as number, imaginary[i] as number];
    }
  }
  for (let size = 2; size <= length; size *= 2) {
    for (let k = 0; k < size / 2; k++) {
      const cos = Math.cos((-2 * Math.PI * k) / size);
      const sin = Math.sin((-2 * Math.PI * k) / size);
      for (let a = k; a < length; a += size) {
        const b = a + size / 2;
        const re = (real[b] as number) * cos - (imaginary[b] as number) * sin;
        const im = (real[b] as number) * sin + (imaginary[b] as number) * cos;
        real[b] = (real[a] as number) - re;
        imaginary[b] = (imaginary[a] as number) - im;
        real[a] = (real[a] as number) + re;
        imaginary[a] = (imaginary[a] as number) + im;
      }
    }
  }
}
