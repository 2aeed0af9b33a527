/* The car as the worker runs it: packed numbers from values of the parameters, an instance of the module, a drive. */

"use strict";

/** @typedef {{parameters: number[], degrees: number[], places: number[], coefficients: number[][]}} Dependence */
/** @typedef {{name: string, low: number, high: number}} SliderRange */
/** @typedef {{law: string, chassis: string, parameters: SliderRange[], numbers: number[], dependences: Dependence[],
 *             states: number, given: number, inputs: number, channels: string[], zeroStates: number[], memory: number, path: number,
 *             zeroOutputs: number[], ofLaw: number[], beginning: number[], places: Record<string, [number, number]>}} Structure */
/** @typedef {{pieces: [number, number[], number[]][], samples: number, released: number[], frequency: number | null,
 *             fewest: number}} Course the motion of the hands at an amplitude of 1; steer_env.experiments.explore.drives */
/** @typedef {{name: string, speed: number, amplitude: number | null, lock: boolean, target: number | null, reach: string,
 *             trial: number, whole: Course, moving: Course}} Manoeuvre */

/** @typedef {{loop: {x: number[], step: number}, slide: number[], speeds: number[], steps: number[], sines: Course[],
 *             amplitude: number, periods: number, hold: number}} Characteristics displacements [rad] with times between
 *             them [s], speeds [rad/s]; sines of the handwheel, of which every so many samples of the last period are read */

/** @param {number} rate samples in a second @param {number} regrip time after which a robot that grips again has its
    prescribed angle [s] */
function steerSimulation(rate, regrip) {
  const SLICE = 2000;  // samples of a drive
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
      const { numbers, states, given, inputs, channels, memory, path } = structure;
      const sizes = [1, 1, numbers.length, tables.length, states, given, inputs, channels.length, memory, 2 * path, path,
        1, path];
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

    /** The torque of the friction law alone along a displacement, from rest, as steer_env.friction.response.
        @param {Float64Array} numbers @param {number[]} x displacement [rad] @param {number} step [s] */
    friction(numbers, x, step) {
      const { at, arrays, exports } = this.instance, [memory, scales, path, time, torque] = arrays.slice(8);
      this.numbers.set(numbers);
      memory.fill(0);
      scales.fill(numbers[this.structure.places.friction_torque_scale[0]]);
      path.set(x);
      time[0] = step;
      torque[0] = 0;
      exports.steer_friction(at[0], at[1], at[2] + 8 * this.structure.ofLaw[0], at[3], ...at.slice(8));
      return torque.slice();
    }

    /** Advance by so many milliseconds; whether every state is finite. @param {number} samples */
    advance(samples) {
      const { at, exports, word } = this.instance;
      exports.steer_advance(...at.slice(0, 8), BigInt(samples));
      return word[0] !== 0;
    }
  }

  /** What a friction law does alone: its loop, and its torque in steady sliding. @param {Car} car
      @param {Float64Array} numbers @param {Characteristics} of */
  function characteristics(car, numbers, { loop, slide, speeds, steps }) {
    const back = slide.map((x) => -x), last = slide.length - 1;
    return {
      loop: { x: loop.x, y: Array.from(car.friction(numbers, loop.x, loop.step)) },
      sliding: { x: speeds, y: speeds.map((v, k) => car.friction(numbers, v < 0 ? back : slide, steps[k])[last]) },
    };
  }

  /** Sum of Chebyshev's polynomials with coefficients. @param {number[]} c @param {number} t */
  function series(c, t) {
    let one = 0, two = 0;
    for (let k = c.length - 1; k > 0; k--) [one, two] = [2 * t * one - two + c[k], one];
    return t * one - two + c[0];
  }

  /** @type {WeakMap<Course, {angle: Float64Array, speed: Float64Array}>} */
  const motions = new WeakMap();

  /** Angle and speed of the handwheel at the end of every sample, for an amplitude of 1. @param {Course} course */
  function motion(course) {
    let found = motions.get(course);
    if (!found) {
      found = { angle: new Float64Array(course.samples), speed: new Float64Array(course.samples) };
      let at = 0;
      for (const [size, angle, speed] of course.pieces) {
        for (let i = 0; i < size; i++, at++) {
          const t = size > 1 ? (2 * i) / (size - 1) - 1 : 0;
          found.angle[at] = series(angle, t);
          found.speed[at] = series(speed, t);
        }
      }
      motions.set(course, found);
    }
    return found;
  }

  /** Drive a manoeuvre and record channels at 1 kHz; null where a state does not stay finite. The robot lets go and grips
      again where the manoeuvre says so; when it grips, it leads the handwheel smoothly to what is prescribed, as
      steer_env.manoeuvres.common.driving. It yields every two seconds of the drive, so that long work can be left.
      @param {Car} car @param {Float64Array} numbers @param {Course} course @param {number} amplitude
      @param {string[]} names @param {number} [samples]
      @returns {Generator<void, Record<string, Float64Array> | null>} */
  function* drive(car, numbers, course, amplitude, names, samples = course.samples) {
    const { angle, speed } = motion(course), one = BigInt(1);
    const record = names.map(() => new Float64Array(samples));
    const { channels, places: named } = car.structure, places = names.map((name) => channels.indexOf(name));
    const { given, outputs } = car, advance = car.instance.exports.steer_advance;
    const [result, unused, at, tables, state, from, inputs, to] = car.instance.at;
    const [robot] = named.robot, changes = [...course.released, samples];
    let next = 0, gripped = 0, off = 0, offSpeed = 0;
    car.begin(numbers);
    for (let i = 0; i < samples; i++) {
      let hand = amplitude * angle[i], handSpeed = amplitude * speed[i];
      if (i === changes[next]) {
        next++;
        car.numbers[robot] = next % 2 ? 0 : 1;
        gripped = i;
        off = outputs[channels.indexOf("handwheel_angle")] - hand;
        offSpeed = regrip * (outputs[channels.indexOf("handwheel_speed")] - handSpeed);
      }
      if (next && next % 2 === 0) {
        const s = Math.min((i + 1 - gripped) / rate / regrip, 1), rest = 1 - s;
        hand += off * (1 - s * s * (3 - 2 * s)) + offSpeed * s * rest * rest;
        handSpeed += (offSpeed * rest * (1 - 3 * s) - 6 * off * s * rest) / regrip;
      }
      given[0] = given[1] = hand;  // a torque while the handwheel is free
      given[2] = handSpeed;
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

  /** The lateral acceleration that a run has reached. @param {Manoeuvre} manoeuvre @param {Float64Array} acceleration */
  function reached(manoeuvre, acceleration) {
    const seen = acceleration.subarray(0, manoeuvre.trial);
    if (manoeuvre.reach === "half span") return halfSpan(seen);
    return seen.subarray(-rate).reduce((sum, v) => sum + v, 0) / rate;
  }

  /** The amplitude that a manoeuvre prescribes, or that reaches its lateral acceleration, from a first guess, or else from
      that of Python; NaN where there is none. It yields as drive. @param {Car} car @param {Float64Array} numbers
      @param {Manoeuvre} manoeuvre @param {number} guess @returns {Generator<void, number>} */
  function* findAmplitude(car, numbers, manoeuvre, guess) {
    const { target, whole, trial } = manoeuvre, fixed = prescribed(car, numbers, manoeuvre);
    if (fixed !== null || target === null) return fixed ?? NaN;
    for (const first of [guess, FIRST]) {
      let amplitude = first;
      for (let round = 0; round < 10 && amplitude > 0 && amplitude < 6; round++) {
        const run = yield* drive(car, numbers, whole, amplitude, ["lateral_acceleration"], trial);
        const found = run ? reached(manoeuvre, run.lateral_acceleration) : NaN;
        if (Math.abs(found / target - 1) < 1e-5) return amplitude;
        amplitude *= target / found;
      }
    }
    return NaN;
  }

  /** The amplitude that a manoeuvre prescribes; null where it is to be found. @param {Car} car
      @param {Float64Array} numbers @param {Manoeuvre} manoeuvre */
  function prescribed(car, numbers, manoeuvre) {
    const { places } = car.structure;
    const byWire = places["assist.wire.ratio"]; // whose first value is that of a standing car, as these manoeuvres have it
    const ratio = byWire ? numbers[byWire[0]] : 1;
    if (manoeuvre.lock) return numbers[places.rack_limit[0]] / numbers[places.pinion_radius[0]] / ratio;
    return manoeuvre.amplitude;
  }

  /** Gain and phase of the yaw rate, and gain of the hand torque, over sines of the handwheel angle; null where a state does
      not stay finite. As sine_response of steer_env.manoeuvres.common.driving; it yields as drive. @param {Car} car
      @param {Float64Array} numbers @param {Characteristics} of */
  function* responses(car, numbers, { sines, amplitude, periods, hold }) {
    /** @type {Record<string, number[]>} */
    const found = { frequency: [], yaw_gain: [], yaw_phase: [], torque_gain: [] };
    for (const sine of sines) {
      const run = yield* drive(car, numbers, sine, amplitude, ["yaw_rate", "handwheel_torque"]);
      if (!run) return null;
      const omega = 2 * Math.PI * Number(sine.frequency);
      const [yaw, torque] = [run.yaw_rate, run.handwheel_torque].map((values) => {
        let [ss, sc, cc, sy, cy] = [0, 0, 0, 0, 0];
        for (let end = sine.samples - sine.samples / periods + hold; end <= sine.samples; end += hold) {
          const s = Math.sin((omega * end) / rate), c = Math.cos((omega * end) / rate), y = values[end - 1];
          [ss, sc, cc, sy, cy] = [ss + s * s, sc + s * c, cc + c * c, sy + s * y, cy + c * y];
        }
        const scale = amplitude * (ss * cc - sc * sc);
        return [(sy * cc - cy * sc) / scale, (cy * ss - sy * sc) / scale];
      });
      found.frequency.push(Number(sine.frequency));
      found.yaw_gain.push(Math.hypot(...yaw));
      found.yaw_phase.push(Math.atan2(yaw[1], yaw[0]));
      found.torque_gain.push(Math.hypot(...torque));
    }
    return found;
  }

  return { packed, Beginning, Car, characteristics, responses, motion, drive, reached, prescribed, findAmplitude };
}
