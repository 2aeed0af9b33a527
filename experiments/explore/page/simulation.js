/* The car as the worker runs it: packed numbers from values of the parameters, an instance of the module, a weave. */

"use strict";

/** @typedef {{parameters: number[], degrees: number[], places: number[], coefficients: number[][]}} Dependence */
/** @typedef {{name: string, low: number, high: number}} SliderRange */
/** @typedef {{law: string, chassis: string, parameters: SliderRange[], numbers: number[], dependences: Dependence[],
 *             states: number, given: number, inputs: number, channels: string[], zeroStates: number[],
 *             zeroOutputs: number[], ofLaw: number[], beginning: number[],
 *             places: Record<string, [number, number]>}} Structure */
/** @typedef {{frequency: number, rate: number, target: number, trialCycles: number, channels: string[]}} Weave */

function steerSimulation() {
  const SLICE = 2000;  // milliseconds of a drive
  const FIRST = 0.2;  // amplitude with which the search begins in Python [rad]

  /** Chebyshev's polynomials up to a degree. @param {number} t @param {number} degree */
  function chebyshev(t, degree) {
    const found = [1, t];
    for (let k = 2; k <= degree; k++) found.push(2 * t * found[k - 1] - found[k - 2]);
    return found.slice(0, degree + 1);
  }

  /** The packed numbers for values of the parameters; steer_env.experiments.explore.packing says how they are made.
      @param {Structure} structure @param {Record<string, number>} values */
  function packed(structure, values) {
    const numbers = Float64Array.from(structure.numbers);
    for (const { parameters, degrees, places, coefficients } of structure.dependences) {
      let terms = [1];
      parameters.forEach((which, k) => {
        const { name, low, high } = structure.parameters[which];
        const own = chebyshev((2 * values[name] - low - high) / (high - low), degrees[k]);
        terms = terms.flatMap((term) => own.map((each) => term * each));
      });
      places.forEach((place, row) => {
        numbers[place] = terms.reduce((sum, term, k) => sum + term * coefficients[row][k], 0);
      });
    }
    return numbers;
  }

  /** An instance of a module, with arrays of floats in its memory. */
  class Instance {
    /** @param {WebAssembly.Module} module @param {number[]} sizes of the arrays; the first two hold results */
    constructor(module, sizes) {
      this.exports = /** @type {any} */ (new WebAssembly.Instance(module, {}).exports);
      this.exports._initialize();
      let end = Math.ceil(this.exports.__heap_base.value / 16) * 16;
      this.at = sizes.map((size) => {
        const start = end;
        end += 8 * size;
        return start;
      });
      const { memory } = this.exports, lacking = Math.ceil((end - memory.buffer.byteLength) / 65536);
      if (lacking > 0) memory.grow(lacking);
      this.word = new Int32Array(memory.buffer, this.at[0], 2);
      this.arrays = this.at.map((at, k) => new Float64Array(memory.buffer, at, sizes[k]));
    }
  }

  /** What begins a drive on a chassis, with whatever law. */
  class Beginning {
    /** @param {Structure} structure of any law on the chassis @param {WebAssembly.Module} module
        @param {Float64Array} tables */
    constructor(structure, module, tables) {
      const [from, to] = structure.ofLaw, numbers = structure.numbers.length - (to - from) + structure.beginning.length;
      this.instance = new Instance(module, [1, 1, numbers, tables.length, structure.states]);
      this.instance.arrays[3].set(tables);
    }

    /** Write the state of straight running; in how many milliseconds it settles.
        @param {Structure} structure @param {Float64Array} numbers @param {Float64Array} state */
    write(structure, numbers, state) {
      const [from, to] = structure.ofLaw, [, , own, , begun] = this.instance.arrays;
      own.set(numbers.subarray(0, from));
      own.set(structure.beginning, from);
      own.set(numbers.subarray(to), from + structure.beginning.length);
      this.instance.exports.steer_begin(...this.instance.at);
      state.fill(0);
      state.set(begun.subarray(0, Math.min(begun.length, state.length)));
      return this.instance.word[0];
    }
  }

  /** The car with a law on a chassis. */
  class Car {
    /** @param {Structure} structure @param {WebAssembly.Module} module @param {Beginning} beginning
        @param {Float64Array} tables */
    constructor(structure, module, beginning, tables) {
      this.structure = structure;
      this.beginning = beginning;
      const { numbers, states, given, inputs, channels } = structure;
      const sizes = [1, 1, numbers.length, tables.length, states, given, inputs, channels.length];
      this.instance = new Instance(module, sizes);
      const { arrays } = this.instance;
      this.numbers = arrays[2];
      this.state = arrays[4];
      this.given = arrays[5];
      this.inputs = arrays[6];
      this.outputs = arrays[7];
      arrays[3].set(tables);
    }

    /** Settle in straight running. @param {Float64Array} numbers */
    begin(numbers) {
      this.numbers.set(numbers);
      const samples = this.beginning.write(this.structure, numbers, this.state);
      this.given.fill(0);
      this.inputs.fill(0);
      this.advance(samples);
      for (const place of this.structure.zeroStates) this.state[place] = 0;
      for (const place of this.structure.zeroOutputs) this.outputs[place] = 0;
    }

    /** Advance by so many milliseconds; whether every state is finite. @param {number} samples */
    advance(samples) {
      const { at, exports, word } = this.instance;
      exports.steer_advance(...at, BigInt(samples));
      return word[0] !== 0;
    }
  }

  /** Sine of the handwheel angle whose amplitude grows over the first cycle, and its rate: as sine of
      steer_env.manoeuvres.common.shapes. @param {number} t @param {number} amplitude @param {number} frequency */
  function sine(t, amplitude, frequency) {
    const omega = 2 * Math.PI * frequency, s = Math.min(Math.max(t * frequency, 0), 1);
    const envelope = s * s * (3 - 2 * s), growth = 6 * s * (1 - s) * frequency;
    return [
      amplitude * envelope * Math.sin(omega * t),
      amplitude * (envelope * omega * Math.cos(omega * t) + growth * Math.sin(omega * t)),
    ];
  }

  /** Drive a weave and record channels at 1 kHz; null where a state does not stay finite. It yields every two seconds of
      the drive, so that long work can be left.
      @param {Car} car @param {Float64Array} numbers @param {Weave} weave @param {number} amplitude
      @param {number} cycles @param {string[]} names @returns {Generator<void, Record<string, Float64Array> | null>} */
  function* drive(car, numbers, weave, amplitude, cycles, names) {
    const size = Math.round((cycles / weave.frequency) * weave.rate), one = BigInt(1);
    const record = names.map(() => new Float64Array(size));
    const places = names.map((name) => car.structure.channels.indexOf(name));
    const { given, outputs } = car, advance = car.instance.exports.steer_advance;
    const [result, unused, at, tables, state, from, inputs, to] = car.instance.at;
    car.begin(numbers);
    for (let i = 0; i < size; i++) {
      [given[1], given[2]] = sine((i + 1) / weave.rate, amplitude, weave.frequency);
      advance(result, unused, at, tables, state, from, inputs, to, one);
      for (let k = 0; k < places.length; k++) record[k][i] = outputs[places[k]];
      if (i % SLICE === SLICE - 1) yield;
    }
    if (car.instance.word[0] === 0) return null;
    return Object.fromEntries(names.map((name, k) => [name, record[k]]));
  }

  /** Half the difference of the extremes in the second half. @param {Float64Array} values */
  function halfSpan(values) {
    let low = Infinity, high = -Infinity;
    for (let i = values.length >> 1; i < values.length; i++) {
      low = Math.min(low, values[i]);
      high = Math.max(high, values[i]);
    }
    return (high - low) / 2;
  }

  /** The amplitude that reaches the lateral acceleration, from a first guess, or else from that of Python; NaN where there
      is none. It yields as drive. @param {Car} car @param {Float64Array} numbers @param {Weave} weave
      @param {number} guess @returns {Generator<void, number>} */
  function* findAmplitude(car, numbers, weave, guess) {
    for (const first of [guess, FIRST]) {
      let amplitude = first;
      for (let round = 0; round < 10 && amplitude > 0 && amplitude < 6; round++) {
        const run = yield* drive(car, numbers, weave, amplitude, weave.trialCycles, ["lateral_acceleration"]);
        const reached = run ? halfSpan(run.lateral_acceleration) : NaN;
        if (Math.abs(reached / weave.target - 1) < 1e-5) return amplitude;
        amplitude *= weave.target / reached;
      }
    }
    return NaN;
  }

  return { packed, Beginning, Car, sine, drive, halfSpan, findAmplitude };
}
