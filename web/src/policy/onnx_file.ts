/**
 * An ONNX file as plain data: nodes, constants, inputs, outputs and metadata. What the nodes do is
 * `graph.ts`'s.
 */

import { fields, packedIntegers, text } from "./protobuf.js";

/** A constant, or what a value looks like. */
export interface Tensor {
  readonly shape: readonly number[];
  readonly data: Float32Array;
}

export interface OnnxNode {
  readonly operator: string;
  readonly inputs: readonly string[];
  readonly outputs: readonly string[];
  /** Numbers and lists of integers; no operator that is known here has another kind. */
  readonly attributes: ReadonlyMap<string, number | readonly number[]>;
}

export interface OnnxFile {
  readonly nodes: readonly OnnxNode[];
  readonly constants: ReadonlyMap<string, Tensor>;
  readonly inputs: ReadonlyMap<string, readonly number[]>;
  readonly outputs: readonly string[];
  readonly metadata: ReadonlyMap<string, string>;
}

const FLOAT = 1;
const INT64 = 7;

/** More numbers than any policy of a robot's has, and few enough for every phone. */
const MOST_NUMBERS = 8_000_000;

/**
 * Reads a file.
 *
 * @throws RangeError If it is no ONNX file, or has constants that are neither float32 nor int64.
 */
export function readOnnx(file: Uint8Array): OnnxFile {
  const metadata = new Map<string, string>();
  let graph: Uint8Array | undefined;
  for (const field of fields(file)) {
    if (field.number === 7) graph = field.bytes;
    else if (field.number === 14) metadata.set(...pair(field.bytes));
  }
  if (!graph) throw new RangeError("it holds no graph");
  const nodes: OnnxNode[] = [];
  const constants = new Map<string, Tensor>();
  const inputs = new Map<string, readonly number[]>();
  const outputs: string[] = [];
  for (const field of fields(graph)) {
    if (field.number === 1) nodes.push(node(field.bytes));
    else if (field.number === 5) constants.set(...constant(field.bytes));
    else if (field.number === 11) inputs.set(...valueInfo(field.bytes));
    else if (field.number === 12) outputs.push(valueInfo(field.bytes)[0]);
  }
  return { nodes, constants, inputs, outputs, metadata };
}

function pair(message: Uint8Array): [string, string] {
  const parts: [string, string] = ["", ""];
  for (const field of fields(message)) {
    if (field.number === 1 || field.number === 2) parts[field.number - 1] = text(field.bytes);
  }
  return parts;
}

function node(message: Uint8Array): OnnxNode {
  const inputs: string[] = [];
  const outputs: string[] = [];
  const attributes = new Map<string, number | readonly number[]>();
  let operator = "";
  for (const field of fields(message)) {
    if (field.number === 1) inputs.push(text(field.bytes));
    else if (field.number === 2) outputs.push(text(field.bytes));
    else if (field.number === 4) operator = text(field.bytes);
    else if (field.number === 5) attributes.set(...attribute(field.bytes));
    else if (field.number === 7 && field.bytes.length)
      operator = `${text(field.bytes)}.${operator}`;
  }
  return { operator, inputs, outputs, attributes };
}

function attribute(message: Uint8Array): [string, number | readonly number[]] {
  let name = "";
  let value: number | readonly number[] = Number.NaN;
  const integers: number[] = [];
  for (const field of fields(message)) {
    if (field.number === 1) name = text(field.bytes);
    else if (field.number === 2) value = view(field.bytes).getFloat32(0, true);
    else if (field.number === 3) value = field.integer;
    else if (field.number === 8) {
      integers.push(...(field.bytes.length ? packedIntegers(field.bytes) : [field.integer]));
    }
  }
  return [name, integers.length ? integers : value];
}

function valueInfo(message: Uint8Array): [string, readonly number[]] {
  let name = "";
  const shape: number[] = [];
  for (const field of fields(message)) {
    if (field.number === 1) name = text(field.bytes);
    else if (field.number === 2) {
      for (const tensor of of(field.bytes, 1)) {
        for (const dims of of(tensor, 2)) {
          for (const dim of of(dims, 1)) shape.push(size(dim));
        }
      }
    }
  }
  return [name, shape];
}

/** A dimension without a size, which a name may stand for, counts as one. */
function size(dimension: Uint8Array): number {
  for (const field of fields(dimension)) if (field.number === 1) return field.integer;
  return 1;
}

function* of(message: Uint8Array, number: number): Generator<Uint8Array> {
  for (const field of fields(message)) if (field.number === number) yield field.bytes;
}

function constant(message: Uint8Array): [string, Tensor] {
  let name = "";
  let type = 0;
  let raw: Uint8Array = new Uint8Array(0);
  const shape: number[] = [];
  for (const field of fields(message)) {
    if (field.number === 1) {
      shape.push(...(field.bytes.length ? packedIntegers(field.bytes) : [field.integer]));
    } else if (field.number === 2) type = field.integer;
    else if (field.number === 8) name = text(field.bytes);
    else if (field.number === 9) raw = field.bytes;
  }
  return [name, { shape, data: numbers(name, type, raw, count(name, shape)) }];
}

function count(name: string, shape: readonly number[]): number {
  const product = shape.reduce((a, b) => a * b, 1);
  if (!(Number.isInteger(product) && product >= 0 && product <= MOST_NUMBERS)) {
    throw new RangeError(`${name} has the shape ${shape.join(" x ")}`);
  }
  return product;
}

function numbers(name: string, type: number, raw: Uint8Array, length: number): Float32Array {
  const width = type === FLOAT ? 4 : type === INT64 ? 8 : 0;
  if (!width) throw new RangeError(`${name} is of the type ${type}, not float32 or int64`);
  if (raw.length !== width * length) throw new RangeError(`${name} has too few or too many bytes`);
  const bytes = view(raw);
  return Float32Array.from({ length }, (_, i) =>
    type === FLOAT ? bytes.getFloat32(4 * i, true) : Number(bytes.getBigInt64(8 * i, true)),
  );
}

function view(bytes: Uint8Array): DataView {
  return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}
