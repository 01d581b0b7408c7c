/**
 * The wire format of protocol buffers, as far as ONNX files need it: fields of one message in turn.
 *
 * Every length is checked before it is used, so that a damaged or foreign file can do no more than
 * throw a `RangeError`.
 */

/** One field of a message: its number, and its value by the type on the wire. */
export interface Field {
  readonly number: number;
  /** Of a varint, as a number; beyond 2^53 it is not exact. */
  readonly integer: number;
  /** Of a length-delimited field, or the bytes of a fixed one; else empty. */
  readonly bytes: Uint8Array;
}

const EMPTY = new Uint8Array(0);
const VARINT = 0;
const FIXED64 = 1;
const DELIMITED = 2;
const FIXED32 = 5;

/**
 * Walks through the fields of a message.
 *
 * @throws RangeError If the bytes are no message.
 */
export function* fields(message: Uint8Array): Generator<Field> {
  const reader = new Reader(message);
  while (reader.at < message.length) {
    const key = reader.varint();
    const number = Math.floor(key / 8);
    const wire = key % 8;
    if (number < 1) throw new RangeError("a field has no number");
    if (wire === VARINT) yield { number, integer: reader.varint(), bytes: EMPTY };
    else if (wire === DELIMITED) yield { number, integer: 0, bytes: reader.take(reader.varint()) };
    else if (wire === FIXED32) yield { number, integer: 0, bytes: reader.take(4) };
    else if (wire === FIXED64) yield { number, integer: 0, bytes: reader.take(8) };
    else throw new RangeError(`a field has the unknown type ${wire}`);
  }
}

/** Returns the integers of a packed field. */
export function packedIntegers(bytes: Uint8Array): number[] {
  const reader = new Reader(bytes);
  const values: number[] = [];
  while (reader.at < bytes.length) values.push(reader.varint());
  return values;
}

/** Returns the text of a field. */
export function text(bytes: Uint8Array): string {
  return new TextDecoder("utf-8", { fatal: true }).decode(bytes);
}

class Reader {
  at = 0;

  constructor(private readonly bytes: Uint8Array) {}

  varint(): number {
    let value = 0n;
    for (let shift = 0n; shift < 70n; shift += 7n) {
      if (this.at >= this.bytes.length) throw new RangeError("it ends within a number");
      const byte = this.bytes[this.at++] as number;
      value |= BigInt(byte & 0x7f) << shift;
      if (byte < 0x80) return Number(BigInt.asIntN(64, value));
    }
    throw new RangeError("a number is too long");
  }

  take(length: number): Uint8Array {
    if (!(length >= 0 && length <= this.bytes.length - this.at)) {
      throw new RangeError("it ends within a field");
    }
    const taken = this.bytes.subarray(this.at, this.at + length);
    this.at += length;
    return taken;
  }
}
