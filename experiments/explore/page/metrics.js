/* On-centre metrics of a weave: a port of steer_env.metrics.common.loops and .on_centre to the browser.

   It is for a simulated weave of a steering robot: no noise, no drift of a sensor's zero, sampled evenly. The intervals
   of the Python metrics are left out, as the cycles of a simulation are alike; what is equal is tested metric by metric.
   Names and units are those of the Python module: handwheel angle [rad], torque [N m], lateral acceleration [m/s2], yaw
   rate [rad/s]. The filters come from Python. */

"use strict";

/** @typedef {{b: number[], a: number[], zi: number[], cutoff: number}} LowPass a section of second order, its start */
/** @typedef {{rate: number, gravity: number, smooth: LowPass, sharp: LowPass, samplesPerCutoff: number, samples: number,
 *             window: Record<string, number>, fewestInWindow: number, spread: number, endSlack: number,
 *             frequencySpread: number}} LoopConstants */
/** @typedef {Record<string, Float64Array>} Channels */

/** @param {LoopConstants} constants */
function steerMetrics(constants) {
  const ANGLE = "handwheel_angle", TORQUE = "handwheel_torque", AY = "lateral_acceleration", YAW = "yaw_rate";
  const SAMPLES = constants.samples, HALF = SAMPLES / 2, G = constants.gravity;

  const COSINE = Float64Array.from({ length: SAMPLES }, (_, i) => Math.cos((2 * Math.PI * i) / SAMPLES));

  class Refused extends Error {}

  /** @param {ArrayLike<number>} values */
  function mean(values) {
    let sum = 0;
    for (let i = 0; i < values.length; i++) sum += values[i];
    return sum / values.length;
  }

  /** Lowest and highest of values from one place to before another. @param {Float64Array} values @param {number} from
      @param {number} to */
  function extremes(values, from, to) {
    let low = Infinity, high = -Infinity;
    for (let i = from; i < to; i++) {
      if (values[i] < low) low = values[i];
      if (values[i] > high) high = values[i];
    }
    return [low, high];
  }

  /** @param {number[]} values */
  function median(values) {
    const sorted = [...values].sort((a, b) => a - b), middle = sorted.length >> 1;
    return sorted.length % 2 ? sorted[middle] : 0.5 * (sorted[middle - 1] + sorted[middle]);
  }

  /** One pass of a section, in place, from the steady state of its first value. @param {Float64Array} y
      @param {LowPass} filter */
  function pass(y, filter) {
    const [b0, b1, b2] = filter.b, [, a1, a2] = filter.a;
    let z0 = filter.zi[0] * y[0], z1 = filter.zi[1] * y[0];
    for (let i = 0; i < y.length; i++) {
      const x = y[i], out = b0 * x + z0;
      z0 = b1 * x - a1 * out + z1;
      z1 = b2 * x - a2 * out;
      y[i] = out;
    }
  }

  /** Low-pass forwards and backwards, continued oddly beyond both ends. @param {Float64Array} x @param {LowPass} filter */
  function lowPassed(x, filter) {
    const edge = Math.ceil(constants.rate / filter.cutoff), n = x.length;
    if (n <= edge) throw new Refused("the run is too short for the low-pass");
    const y = new Float64Array(n + 2 * edge);
    for (let i = 0; i < edge; i++) {
      y[i] = 2 * x[0] - x[edge - i];
      y[n + edge + i] = 2 * x[n - 1] - x[n - 2 - i];
    }
    y.set(x, edge);
    pass(y, filter);
    y.reverse();
    pass(y, filter);
    return y.subarray(edge, n + edge).reverse();
  }

  /** Second derivatives of a cubic spline at even knots without a kink in the third derivative at the second and the
      last but one, in place of h^2/6 times them. @param {Float64Array} y */
  function moments(y) {
    const n = y.length, m = new Float64Array(n), c = new Float64Array(n), d = new Float64Array(n);
    // Not-a-knot: m0 = 2 m1 - m2 at even knots, which makes the first and the last equation 6 m = difference.
    for (let i = 1; i < n - 1; i++) {
      const r = y[i + 1] - 2 * y[i] + y[i - 1], end = i === 1 || i === n - 2;
      const low = end && i === 1 ? 0 : end ? 0 : 1, high = end ? 0 : 1, diagonal = end ? 6 : 4;
      const w = diagonal - low * c[i - 1];
      c[i] = high / w;
      d[i] = (r - low * d[i - 1]) / w;
    }
    for (let i = n - 2; i > 0; i--) m[i] = d[i] - c[i] * m[i + 1];
    m[0] = 2 * m[1] - m[2];
    m[n - 1] = 2 * m[n - 2] - m[n - 3];
    return m;
  }

  /** Rising zero crossings that bound the cycles of full amplitude and one more cycle at each end [s].
      @param {Float64Array} angle @param {number} frequency */
  function cycleStarts(angle, frequency) {
    const time = (/** @type {number} */ i) => (i + 1) / constants.rate;
    const [low, high] = extremes(angle, 0, angle.length);
    const middle = (high + low) / 2, least = (high - middle) / 4;
    /** @type {number[]} */
    let starts = [];
    let before = -1;
    for (let j = 0; j < angle.length; j++) {
      const s = angle[j] - middle;
      if (Math.abs(s) <= least) continue;
      if (before >= 0 && angle[before] - middle < 0 && s > 0) {
        const s0 = angle[before] - middle;
        starts.push(time(before) - (s0 * (time(j) - time(before))) / (s - s0));
      }
      before = j;
    }
    if (starts.length < 2) throw new Refused("no whole cycle of the handwheel angle");
    const period = median(starts.slice(1).map((t, i) => t - starts[i]));
    if (Math.abs(period * frequency - 1) > constants.frequencySpread) throw new Refused("the handwheel does not follow its frequency");
    const last = time(angle.length - 1);
    for (const end of [starts[0] - period, starts[starts.length - 1] + period]) {
      const inside = Math.min(Math.max(end, time(0)), last);
      if (Math.abs(end - inside) < constants.endSlack * period) starts.push(inside);
    }
    starts = starts.sort((a, b) => a - b);
    const span = starts.slice(1).map((b, k) => {
      const from = Math.max(Math.ceil(starts[k] * constants.rate - 1 - 1e-9), 0);
      const [least, most] = extremes(angle, from, Math.min(Math.floor(b * constants.rate + 1e-9), angle.length));
      return most - least;
    });
    const usual = median(span);
    const over = (/** @type {number} */ share) => span.flatMap((s, k) => (s > share * usual ? [k] : []));
    const steered = over(constants.spread), full = over(1 - constants.spread);
    const first = Math.max(steered[0] + 1, full[0]);
    const end = Math.min(steered[steered.length - 1] - 1, full[full.length - 1]);
    return starts.slice(first - 1, end + 3);
  }

  /** The settled cycles of a weave. */
  class Loops {
    /** @param {Channels} channels @param {number} frequency @param {number} fewest cycles without the first and last */
    constructor(channels, frequency, fewest) {
      this.channels = channels;
      /** @type {Map<string, any>} */
      this.kept = new Map();
      const starts = cycleStarts(this.smooth(ANGLE), frequency);
      this.count = Math.max(starts.length - 3, 0);
      if (this.count < fewest) throw new Refused(`${this.count} settled cycles, and ${fewest} are needed`);
      const lengths = starts.slice(1).map((t, k) => t - starts[k]);
      this.period = lengths.slice(1, -1);
      this.time = new Float64Array((this.count + 2) * SAMPLES);
      for (let i = 0; i < this.time.length; i++) {
        const k = Math.floor(i / SAMPLES);
        this.time[i] = starts[k] + (i / SAMPLES - k) * lengths[k];
      }
      const ay = this.cycles(AY), span = [];
      for (let k = 0; k < this.count; k++) {
        const [low, high] = extremes(ay, k * SAMPLES, (k + 1) * SAMPLES);
        span.push(high - low);
      }
      const usual = median(span);
      if (span.some((s) => Math.abs(s - usual) > constants.spread * usual)) {
        throw new Refused("the cycles differ: the car or the assist loop is not steady");
      }
    }

    /** @template T @param {string} key @param {() => T} make @returns {T} */
    once(key, make) {
      if (!this.kept.has(key)) this.kept.set(key, make());
      return this.kept.get(key);
    }

    /** @param {string} name */
    channel(name) {
      if (!(name in this.channels)) throw new Refused(`there is no channel ${name}`);
      return this.channels[name];
    }

    /** @param {string} name */
    smooth(name) { return this.once(`smooth ${name}`, () => lowPassed(this.channel(name), constants.smooth)); }

    /** A low-passed channel at the instants of the cycles, by a cubic spline. @param {Float64Array} filtered */
    sampled(filtered) {
      const thin = Math.max(Math.floor(constants.rate / (constants.samplesPerCutoff * constants.smooth.cutoff)), 1);
      const y = new Float64Array(Math.ceil(filtered.length / thin));
      for (let i = 0; i < y.length; i++) y[i] = filtered[i * thin];
      const m = moments(y), found = new Float64Array(this.time.length), most = y.length - 2;
      for (let i = 0; i < found.length; i++) {
        const at = (this.time[i] * constants.rate - 1) / thin, k = Math.min(Math.max(Math.floor(at), 0), most);
        const t = at - k, u = 1 - t;
        found[i] = u * y[k] + t * y[k + 1] + (u * u * u - u) * m[k] + (t * t * t - t) * m[k + 1];
      }
      return found;
    }

    /** Less the linear drift of the means of the cycles, in place. @param {Float64Array} samples */
    withoutDrift(samples) {
      let rise = 0, norm = 0;
      for (let k = 0; k < this.count; k++) {
        const order = k - (this.count - 1) / 2;
        rise += order * mean(samples.subarray((k + 1) * SAMPLES, (k + 2) * SAMPLES));
        norm += order * order;
      }
      rise /= Math.max(norm, 1);
      for (let i = 0; i < samples.length; i++) samples[i] -= (rise * (i - samples.length / 2)) / SAMPLES;
      return samples;
    }

    /** @param {string} name */
    driftFree(name) { return this.once(`drift ${name}`, () => this.withoutDrift(this.sampled(this.smooth(name)))); }

    /** Reading where the car goes straight: the mean of what shows its turning, of the others that on the mean branch
        where the lateral acceleration passes its zero. @param {string} name @returns {number} */
    zero(name) {
      return this.once(`zero ${name}`, () => {
        if (name === AY || name === YAW) return mean(this.settled(this.driftFree(name), 0));
        return mean(crossed(this.split(this.driftFree(name), AY), this.split(this.samples(AY), AY), 0));
      });
    }

    /** @param {string} name @returns {Float64Array} */
    samples(name) {
      return this.once(`samples ${name}`, () => {
        const zero = this.zero(name), found = Float64Array.from(this.driftFree(name));
        for (let i = 0; i < found.length; i++) found[i] -= zero;
        return found;
      });
    }

    /** @param {Float64Array} samples @param {number} shift */
    settled(samples, shift) { return samples.subarray(SAMPLES + shift, SAMPLES + shift + this.count * SAMPLES); }

    /** @param {string} name */
    cycles(name) { return this.settled(this.samples(name), 0); }

    /** First harmonic of each cycle, real and imaginary part. @param {string} name @returns {[number, number][]} */
    harmonic(name) {
      return this.once(`harmonic ${name}`, () => {
        const y = this.settled(this.driftFree(name), 0), found = [];
        for (let k = 0; k < this.count; k++) {
          let re = 0, im = 0;
          for (let i = 0; i < SAMPLES; i++) {
            re += y[k * SAMPLES + i] * COSINE[i];
            im -= y[k * SAMPLES + i] * COSINE[(i + 3 * SAMPLES / 4) % SAMPLES];
          }
          found.push(/** @type {[number, number]} */ ([(re * 2) / SAMPLES, (im * 2) / SAMPLES]));
        }
        return found;
      });
    }

    /** The first harmonic; refused where it opposes that of the handwheel angle. @param {string} name */
    fundamental(name) {
      const angle = this.harmonic(ANGLE), own = this.harmonic(name);
      if (mean(own.map(([re, im], k) => re * angle[k][0] + im * angle[k][1])) <= 0) {
        throw new Refused(`${name} does not follow the handwheel angle`);
      }
      return own;
    }

    /** Samples (2 n, SAMPLES/2) on the falling and the rising branch of x. @param {Float64Array} samples @param {string} x */
    split(samples, x) {
      const own = this.harmonic(x);
      const phase = Math.atan2(mean(own.map((h) => h[1])), mean(own.map((h) => h[0])));
      return this.settled(samples, roundedToEven((-phase / (2 * Math.PI)) * SAMPLES));
    }

    /** y and x on their branches. @param {string} y @param {string} x */
    branches(y, x) {
      this.fundamental(y);
      this.fundamental(x);
      return [this.split(this.samples(y), x), this.split(this.samples(x), x)];
    }

    /** y where each branch of x crosses a level: falling, rising, falling ... @param {string} y @param {string} x
        @param {number} level */
    at(y, x, level) {
      const [u, v] = this.branches(y, x);
      return crossed(u, v, level);
    }

    /** y on the rising less y on the falling branch, at x = 0. @param {string} y @param {string} x */
    width(y, x) { return pairs(this.at(y, x, 0)).map(([falling, rising]) => rising - falling); }

    /** @param {string} y @param {string} x @param {number} level */
    meanBranch(y, x, level) {
      const below = this.at(y, x, -level);
      return pairs(this.at(y, x, level).map((v, k) => v - below[k])).map(([a, b]) => (a + b) / 4);
    }

    /** dy/dx on the mean of the branches: of parabolas within the window of x around +level and -level.
        @param {string} y @param {string} x @param {number} level @returns {number[]} */
    slope(y, x, level = 0) {
      return this.once(`slope ${y} ${x} ${level}`, () => {
        const window = constants.window[x], [u, v] = this.branches(y, x), found = new Array(this.count).fill(0);
        for (const centre of [level, -level]) {
          for (let b = 0; b < 2 * this.count; b++) found[b >> 1] += parabola(u, v, b, centre, window) / window / 4;
        }
        return found;
      });
    }

    /** Half the difference of samples half a cycle apart, where it is largest. @param {string} name */
    peak(name) {
      return this.once(`peak ${name}`, () => {
        this.fundamental(name);
        const y = this.cycles(name), mean = new Float64Array(SAMPLES);
        for (let i = 0; i < y.length; i++) mean[i % SAMPLES] += y[i] / this.count;
        let k = 0;
        for (let i = 1; i < HALF; i++) {
          if (Math.abs(mean[i] - mean[i + HALF]) > Math.abs(mean[k] - mean[k + HALF])) k = i;
        }
        const sharp = this.withoutDrift(this.sampled(lowPassed(this.channel(name), constants.sharp)));
        const cycles = this.settled(sharp, 0);
        return Array.from({ length: this.count }, (_, n) =>
          Math.abs(cycles[n * SAMPLES + k] - cycles[n * SAMPLES + k + HALF]) / 2);
      });
    }

    /** Delay behind the handwheel angle [s]. @param {string} name */
    lag(name) {
      const angle = this.harmonic(ANGLE);
      return this.fundamental(name).map(([re, im], k) => {
        const [a, b] = angle[k];
        return (Math.atan2(b * re - a * im, a * re + b * im) / (2 * Math.PI)) * this.period[k];
      });
    }

    peakAcceleration() { return mean(this.peak(AY)) / G; }
  }

  /** As numpy rounds. @param {number} x */
  function roundedToEven(x) {
    const low = Math.floor(x), rest = x - low;
    return rest < 0.5 || (rest === 0.5 && low % 2 === 0) ? low : low + 1;
  }

  /** @param {number[]} values @returns {[number, number][]} */
  const pairs = (values) => Array.from({ length: values.length / 2 }, (_, k) => [values[2 * k], values[2 * k + 1]]);

  /** u where v crosses a level, for each branch; the mean where it crosses several times.
      @param {Float64Array} u @param {Float64Array} v @param {number} level */
  function crossed(u, v, level) {
    /** @type {number[]} */
    const found = [];
    for (let start = 0; start < v.length; start += HALF) {
      let sum = 0, crossings = 0;
      for (let i = start; i < start + HALF - 1; i++) {
        if (v[i] >= level === v[i + 1] >= level) continue;
        sum += u[i] + ((level - v[i]) / (v[i + 1] - v[i])) * (u[i + 1] - u[i]);
        crossings++;
      }
      if (crossings % 2 === 0) throw new Refused("a branch of the loop does not cross the level: steer further");
      found.push(sum / crossings);
    }
    return found;
  }

  /** Slope in the middle of a least-squares parabola through the samples of a branch within a window, over the window.
      @param {Float64Array} u @param {Float64Array} v @param {number} branch @param {number} centre @param {number} window */
  function parabola(u, v, branch, centre, window) {
    const s = [0, 0, 0, 0, 0], r = [0, 0, 0];
    let most = -Infinity, least = Infinity;
    for (let i = branch * HALF; i < (branch + 1) * HALF; i++) {
      const place = (v[i] - centre) / window;
      most = Math.max(most, place);
      least = Math.min(least, place);
      if (Math.abs(place) > 1) continue;
      let power = 1;
      for (let k = 0; k < 5; k++) {
        s[k] += power;
        if (k < 3) r[k] += power * u[i];
        power *= place;
      }
    }
    if (most < 1 || least > -1 || s[0] < constants.fewestInWindow) {
      throw new Refused("the weave does not span the window of the slope: steer further");
    }
    const minor = (/** @type {number[][]} */ m) =>
      m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
      m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    const whole = minor([[s[0], s[1], s[2]], [s[1], s[2], s[3]], [s[2], s[3], s[4]]]);
    return minor([[s[0], r[0], s[2]], [s[1], r[1], s[3]], [s[2], r[2], s[4]]]) / whole;
  }

  /** @param {number[]} a @param {number[]} b */
  const over = (a, b) => a.map((v, k) => v / b[k]);
  /** @param {Loops} l @param {number} level [g] */
  const sensitivity = (l, level) => l.slope(ANGLE, AY, level * G).map((s) => 1 / s);

  /** Values of the cycles [SI] by the names of steer_env.metrics.common.on_centre. @type {Record<string, (l: Loops) => number[]>} */
  const METRICS = {
    torque_at_0g: (l) => l.width(TORQUE, AY).map((w) => w / 2),
    torque_at_0p1g: (l) => l.meanBranch(TORQUE, AY, 0.1 * G),
    torque_gradient_at_0g: (l) => l.slope(TORQUE, AY),
    torque_gradient_at_0p1g: (l) => l.slope(TORQUE, AY, 0.1 * G),
    torque_gradient_ratio: (l) => over(l.slope(TORQUE, AY, 0.1 * G), l.slope(TORQUE, AY)),
    lateral_acceleration_at_0nm: (l) => l.width(AY, TORQUE).map((w) => -w / 2),
    angle_hysteresis: (l) => l.width(ANGLE, AY),
    angle_deadband: (l) => l.width(ANGLE, TORQUE).map((w) => -w),
    torque_deadband: (l) => l.width(TORQUE, ANGLE),
    steering_stiffness: (l) => l.slope(TORQUE, ANGLE),
    steering_sensitivity_at_0p1g: (l) => sensitivity(l, 0.1),
    minimum_steering_sensitivity: (l) => {
      const all = [0, 0.05, 0.1].map((level) => sensitivity(l, level)), means = all.map(mean);
      // A level other than the first counts where it is lower by two standard errors.
      const clearly = all.map((values) => {
        const lower = values.map((v, k) => v - all[0][k]), off = mean(lower);
        const error = Math.sqrt(lower.reduce((sum, v) => sum + (v - off) ** 2, 0) / (lower.length - 1) / lower.length);
        return off < -2 * error;
      });
      let chosen = 0;
      for (const k of [1, 2]) if (clearly[k] && (chosen === 0 || means[k] < means[chosen])) chosen = k;
      return all[chosen];
    },
    yaw_rate_gain: (l) => l.slope(YAW, ANGLE),
    yaw_lag: (l) => l.lag(YAW),
    lateral_acceleration_lag: (l) => l.lag(AY),
    work_sensitivity: (l) => over(sensitivity(l, 0.1), l.meanBranch(TORQUE, AY, 0.1 * G)),
    peak_handwheel_torque: (l) => l.peak(TORQUE),
    peak_handwheel_angle: (l) => l.peak(ANGLE),
    loop_area: (l) => {
      l.fundamental(TORQUE);
      const torque = l.cycles(TORQUE), angle = l.cycles(ANGLE), found = new Array(l.count).fill(0);
      for (let k = 0; k < l.count; k++) {
        for (let i = 0; i < SAMPLES; i++) {
          const at = k * SAMPLES;
          const change = angle[at + ((i + 1) % SAMPLES)] - angle[at + ((i + SAMPLES - 1) % SAMPLES)];
          found[k] += (torque[at + i] * change) / 2;
        }
      }
      return found;
    },
  };

  /** Every metric in the unit of the reports, or why there is none.
      @param {Channels} channels @param {number} frequency @param {number} fewest
      @param {{name: string, scale: number, validity: [number, number] | null}[]} wanted
      @param {string} refused why there is none at all; empty where there may be some
      @returns {{values: Record<string, number>, reasons: Record<string, string>, loops: Loops | null}} */
  function evaluate(channels, frequency, fewest, wanted, refused = "") {
    /** @type {Record<string, number>} */
    const values = {};
    /** @type {Record<string, string>} */
    const reasons = {};
    let loops = null, whole = refused;
    try {
      if (refused) throw new Refused(refused);
      loops = new Loops(channels, frequency, fewest);
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      whole = error.message;
    }
    for (const { name, scale, validity } of wanted) {
      values[name] = NaN;
      try {
        if (!loops) throw new Refused(whole);
        const peak = loops.peakAcceleration();
        if (validity && !(validity[0] <= peak && peak <= validity[1])) {
          const advice = peak < validity[0] ? `below ${validity[0]} g` : `above ${validity[1]} g`;
          throw new Refused(`lateral acceleration peaks at ${peak.toFixed(3)} g, ${advice}`);
        }
        const value = mean(METRICS[name](loops)) * scale;
        if (!Number.isFinite(value)) throw new Refused("no finite value");
        values[name] = value;
      } catch (error) {
        if (!(error instanceof Refused)) throw error;
        reasons[name] = error.message;
      }
    }
    return { values, reasons, loops };
  }

  return { evaluate, lowPassed, Loops };
}
