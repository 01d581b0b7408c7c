/**
 * A small ONNX graph as functions on Float32Arrays: what `python -m mute.export` writes, for one
 * robot. Shapes are known when it is built, so that running it allocates nothing.
 *
 * Products are summed up in double precision and kept in single; the rest is rounded after each
 * operator, as ONNX Runtime does.
 */

import type { OnnxFile, OnnxNode, Tensor } from "./onnx_file.js";

/** Runs every operator once, in turn. */
export interface Graph {
  /** Buffers of the inputs, which the caller fills. */
  readonly inputs: ReadonlyMap<string, Float32Array>;
  /** Buffers of the outputs, which `run` fills. */
  readonly outputs: ReadonlyMap<string, Float32Array>;
  run(): void;
}

/**
 * Makes a graph ready to run.
 *
 * @param file What was read.
 * @param period Time in which it has to run once, s.
 * @throws RangeError If it has an operator, or a use of one, that no policy of ours has.
 */
export function buildGraph(file: OnnxFile, period: number): Graph {
  const values = new Map<string, Tensor>(file.constants);
  const inputs = new Map<string, Float32Array>();
  for (const [name, shape] of file.inputs) {
    if (file.constants.has(name)) continue;
    const tensor = empty(shape);
    values.set(name, tensor);
    inputs.set(name, tensor.data);
  }
  const most = MOST_WORK * Math.min(period / USUAL_PERIOD, 1);
  let work = 0;
  const steps = file.nodes.map((node) => {
    const [step, own] = build(node, values);
    work += own;
    if (work > most) throw new RangeError("a control step of it takes too long");
    return step;
  });
  const outputs = new Map<string, Float32Array>();
  for (const name of file.outputs) outputs.set(name, known(values, name).data);
  return {
    inputs,
    outputs,
    run: () => {
      for (const step of steps) step();
    },
  };
}

type Step = () => void;
type Builder = (node: OnnxNode, inputs: Tensor[]) => [outputs: Tensor[], step: Step];

const MOST_NUMBERS = 1_000_000;

/**
 * Multiply-adds, or other operations on one number, that a control step of the usual period, s, may
 * take: some milliseconds of its 20. One that comes more often may take less, one that comes more
 * rarely no more, as the page stands still for it. The policy that ships takes 0.15 million.
 */
const MOST_WORK = 4_000_000;
const USUAL_PERIOD = 0.02;

/** Returns what an operator takes: a product its weights, the rest a number each of what it makes. */
function workOf(node: OnnxNode, inputs: readonly Tensor[], outputs: readonly Tensor[]): number {
  if (node.operator === "Gemm") return inputs[1]?.data.length ?? 0;
  const read = inputs.reduce((sum, { data }) => sum + data.length, 0);
  return 1 + read + outputs.reduce((sum, { data }) => sum + data.length, 0);
}

/** Makes an operator ready to run; returns what runs it, and how much work that is. */
function build(node: OnnxNode, values: Map<string, Tensor>): [step: Step, work: number] {
  const builder = BUILDERS.get(node.operator);
  if (!builder) throw new RangeError(`it has the operator ${node.operator || "without a name"}`);
  const inputs = node.inputs.map((name) => known(values, name));
  if (!inputs.length) throw new RangeError(`a ${node.operator} has no input`);
  const [outputs, step] = builder(node, inputs);
  if (node.outputs.length > outputs.length) {
    throw new RangeError(`a ${node.operator} has too many outputs`);
  }
  node.outputs.forEach((name, index) => {
    values.set(name, outputs[index] as Tensor);
  });
  return [step, workOf(node, inputs, outputs)];
}

function known(values: ReadonlyMap<string, Tensor>, name: string): Tensor {
  const value = values.get(name);
  if (!value) throw new RangeError(`nothing makes its value ${name}`);
  return value;
}

function empty(shape: readonly number[]): Tensor {
  const size = shape.reduce((a, b) => a * b, 1);
  if (!(Number.isInteger(size) && size >= 0 && size <= MOST_NUMBERS)) {
    throw new RangeError(`a value has the shape ${shape.join(" x ")}`);
  }
  return { shape, data: new Float32Array(size) };
}

function number(node: OnnxNode, name: string, otherwise: number): number {
  const value = node.attributes.get(name);
  return typeof value === "number" && !Number.isNaN(value) ? value : otherwise;
}

function require(right: boolean, node: OnnxNode): asserts right {
  if (!right) throw new RangeError(`a ${node.operator} is of a form that is not known here`);
}

/** Returns an input of a node, which must have it. */
function input(node: OnnxNode, inputs: readonly Tensor[], index: number): Tensor {
  const found = inputs[index];
  if (!found) throw new RangeError(`a ${node.operator} has too few inputs`);
  return found;
}

/** Of each number on its own. */
function unary(make: (node: OnnxNode) => (x: number) => number): Builder {
  return (node, inputs) => {
    const x = input(node, inputs, 0);
    const f = make(node);
    const y = empty(x.shape);
    const step = () => {
      for (let i = 0; i < x.data.length; i++) y.data[i] = f(x.data[i] as number);
    };
    return [[y], step];
  };
}

/** Of two of the same length, or of which one is a single number. */
function binary(f: (a: number, b: number) => number): Builder {
  return (node, inputs) => {
    require(inputs.length === 2, node);
    const [a, b] = [input(node, inputs, 0), input(node, inputs, 1)];
    const [p, q] = [a.data.length, b.data.length];
    require(p === q || p === 1 || q === 1, node);
    const y = empty(p >= q ? a.shape : b.shape);
    const [i, j] = [p === 1 ? 0 : 1, q === 1 ? 0 : 1];
    const { data } = y;
    return [
      [y],
      () => {
        for (let k = 0; k < data.length; k++) {
          data[k] = f(a.data[i * k] as number, b.data[j * k] as number);
        }
      },
    ];
  };
}

type Three = [Tensor, Tensor, Tensor];

/** y = alpha x W^T + beta c, for one row x. */
const gemm: Builder = (node, inputs) => {
  require(inputs.length === 3 && number(node, "transB", 0) === 1, node);
  const [x, weight, bias] = [0, 1, 2].map((index) => input(node, inputs, index)) as Three;
  const [rows = 0, columns = 0] = weight.shape;
  const fits = weight.shape.length === 2 && x.data.length === columns && bias.data.length === rows;
  require(fits && number(node, "transA", 0) === 0, node);
  require(number(node, "alpha", 1) === 1 && number(node, "beta", 1) === 1, node);
  const y = empty([1, rows]);
  return [[y], () => product(weight.data, x.data, bias.data, y.data)];
};

function product(weight: Float32Array, x: Float32Array, bias: Float32Array, y: Float32Array): void {
  const columns = x.length;
  for (let row = 0, at = 0; row < y.length; row++) {
    let sum = bias[row] as number;
    for (let column = 0; column < columns; column++) {
      sum += (weight[at++] as number) * (x[column] as number);
    }
    y[row] = sum;
  }
}

/** The axis is the last one, of rows of which there is one. */
function lastAxis(node: OnnxNode, tensor: Tensor, axis: number): number {
  const { shape } = tensor;
  require(axis === -1 || axis === shape.length - 1, node);
  const width = shape.at(-1) ?? 1;
  require(width === tensor.data.length, node);
  return width;
}

const split: Builder = (node, inputs) => {
  const x = input(node, inputs, 0);
  const width = lastAxis(node, x, number(node, "axis", 0));
  const parts = number(node, "num_outputs", node.outputs.length);
  require(parts >= 1 && parts <= width && width % parts === 0 && node.inputs.length === 1, node);
  const each = width / parts;
  const outputs = Array.from({ length: parts }, (_, part) => ({
    shape: [1, each],
    data: x.data.subarray(part * each, (part + 1) * each),
  }));
  return [outputs, () => undefined];
};

const concat: Builder = (node, inputs) => {
  const axis = number(node, "axis", 0);
  const width = inputs.reduce((sum, input) => sum + lastAxis(node, input, axis), 0);
  const y = empty([1, width]);
  const step = () => {
    let at = 0;
    for (const input of inputs) {
      y.data.set(input.data, at);
      at += input.data.length;
    }
  };
  return [[y], step];
};

/** Returns a number that an input holds; undefined where there is no such input. */
function whole(node: OnnxNode, inputs: readonly Tensor[], index: number): number | undefined {
  require((inputs[index]?.data.length ?? 1) === 1, node);
  return inputs[index]?.data[0];
}

const slice: Builder = (node, inputs) => {
  const x = input(node, inputs, 0);
  const [start, end, axis, by] = [1, 2, 3, 4].map((index) => whole(node, inputs, index));
  require(by === undefined || by === 1, node);
  require(start !== undefined && end !== undefined && axis !== undefined, node);
  const width = lastAxis(node, x, axis);
  const place = (index: number) => Math.min(Math.max(index < 0 ? width + index : index, 0), width);
  const [from, to] = [place(start), place(end)];
  require(from < to, node);
  const y = { shape: [1, to - from], data: x.data.subarray(from, to) };
  return [[y], () => undefined];
};

const reduceSum: Builder = (node, inputs) => {
  const [x, axis] = [input(node, inputs, 0), whole(node, inputs, 1)];
  require(axis !== undefined && number(node, "keepdims", 1) === 1, node);
  lastAxis(node, x, axis);
  const y = empty([1, 1]);
  const step = () => {
    let sum = 0;
    for (const value of x.data) sum += value;
    y.data[0] = sum;
  };
  return [[y], step];
};

const clip: Builder = (node, inputs) => {
  const x = input(node, inputs, 0);
  const [least, most] = [1, 2].map((index) => whole(node, inputs, index));
  require(least !== undefined && most !== undefined && inputs.length === 3, node);
  const y = empty(x.shape);
  const step = () => {
    for (let i = 0; i < x.data.length; i++) {
      y.data[i] = Math.min(Math.max(x.data[i] as number, least), most);
    }
  };
  return [[y], step];
};

const same: Builder = (node, inputs) => [[input(node, inputs, 0)], () => undefined];

const sigmoid = (x: number) => 1 / (1 + Math.exp(-x));

const BUILDERS: ReadonlyMap<string, Builder> = new Map<string, Builder>([
  ["Gemm", gemm],
  ["Add", binary((a, b) => a + b)],
  ["Sub", binary((a, b) => a - b)],
  ["Mul", binary((a, b) => a * b)],
  ["Div", binary((a, b) => a / b)],
  ["Pow", binary((a, b) => (b === 2 ? a * a : a ** b))],
  ["Greater", binary((a, b) => (a > b ? 1 : 0))],
  ["Sigmoid", unary(() => sigmoid)],
  ["Tanh", unary(() => Math.tanh)],
  ["Relu", unary(() => (x) => Math.max(x, 0))],
  [
    "Elu",
    unary((node) => {
      const alpha = number(node, "alpha", 1);
      return (x) => (x >= 0 ? x : alpha * Math.expm1(x));
    }),
  ],
  ["Split", split],
  ["Concat", concat],
  ["Clip", clip],
  ["Slice", slice],
  ["ReduceSum", reduceSum],
  // A truth is 0 or 1 here already.
  ["Cast", same],
  ["Identity", same],
]);
