/* What the metrics of every manoeuvre share: the low-pass, crossings, fits, and the evaluation of one metric after the
   other, as steer_env.metrics does it. The metrics themselves stand in metrics_*.js, one script for each kind.

   A recording is that of a simulation: no noise, sampled evenly, its first sample one sample time after the start. The
   intervals of the Python metrics are left out. Channels have the names and SI units of Python; the filters and the
   constants are Python's. What is equal to Python is tested metric by metric. */

"use strict";

/** @typedef {{b: number[], a: number[], zi: number[], cutoff: number}} LowPass a section of second order, its start */
/** @typedef {Record<string, Float64Array>} Channels */
/** @typedef {{frequency: number | null, fewest: number}} Repeats what a reading needs of a manoeuvre */
/** @typedef {{read: (channels: Channels, course: Repeats) => any,
 *             metrics: Record<string, (reading: any) => ArrayLike<number>>}} Reader */
/** @typedef {{name: string, scale: number, validity: [number, number] | null}} Wanted */
/** @typedef {ReturnType<typeof steerMetrics>} Tools */

/** @param {Record<string, LowPass>} filters by their cutoff [Hz] @param {number} rate [Hz] */
function steerMetrics(filters, rate) {
  /** A metric has no meaning for a recording, for the reason that the text gives. */
  class Refused extends Error {}

  /** @param {ArrayLike<number>} values */
  function mean(values) {
    let sum = 0;
    for (let i = 0; i < values.length; i++) sum += values[i];
    return sum / values.length;
  }

  /** Lowest and highest of values from one place to before another. @param {ArrayLike<number>} values
      @param {number} [from] @param {number} [to] */
  function extremes(values, from = 0, to = values.length) {
    let low = Infinity, high = -Infinity;
    for (let i = from; i < to; i++) {
      if (values[i] < low) low = values[i];
      if (values[i] > high) high = values[i];
    }
    return [low, high];
  }

  /** The value below which a share of all values lies, interpolated. @param {ArrayLike<number>} values
      @param {number} share */
  function quantile(values, share) {
    const sorted = Float64Array.from(values).sort(), at = share * (sorted.length - 1), k = Math.floor(at);
    return sorted[k] + (at - k) * ((sorted[k + 1] ?? sorted[k]) - sorted[k]);
  }

  /** @param {ArrayLike<number>} values */
  const median = (values) => quantile(values, 0.5);

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

  /** Low-pass forwards and backwards, continued oddly beyond both ends. @param {Float64Array} x
      @param {number} cutoff [Hz] */
  function lowPassed(x, cutoff) {
    const filter = filters[cutoff], edge = Math.ceil(rate / cutoff), n = x.length;
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

  /** A channel, which a recording may lack. @param {Channels} channels @param {string} name */
  function channel(channels, name) {
    if (!(name in channels)) throw new Refused(`there is no channel ${name}`);
    return channels[name];
  }

  /** Channels by name, low-passed when asked for. @param {Channels} channels @param {number} cutoff [Hz] */
  function smoothed(channels, cutoff) {
    /** @type {Channels} */
    const kept = {};
    return (/** @type {string} */ name) => (kept[name] ??= lowPassed(channel(channels, name), cutoff));
  }

  /** Instant of a sample [s]. @param {number} i */
  const time = (i) => (i + 1) / rate;

  /** Slope over the sample time by central differences, one-sided at both ends. @param {Float64Array} y */
  function gradient(y) {
    const last = y.length - 1;
    return y.map((_, i) => {
      const from = Math.max(i - 1, 0), to = Math.min(i + 1, last);
      return ((y[to] - y[from]) / (to - from)) * rate;
    });
  }

  /** Runs [i, j) of samples for which a condition holds; those at most so many samples apart are joined.
      @param {number} size @param {(i: number) => boolean} holds @param {number} [gap] @returns {[number, number][]} */
  function runs(size, holds, gap = 0) {
    /** @type {[number, number][]} */
    const found = [];
    for (let i = 0; i < size; i++) {
      if (!holds(i)) continue;
      const last = found[found.length - 1];
      if (last && (i === last[1] || i - last[1] <= gap)) last[1] = i + 1;
      else found.push([i, i + 1]);
    }
    return found;
  }

  /** y(x) at a place, between its points, and held at the ends. @param {number} at @param {ArrayLike<number>} x
      ascending @param {ArrayLike<number>} y */
  function interpolated(at, x, y) {
    let low = 0, high = x.length;
    while (low < high) {  // the first point beyond
      const middle = (low + high) >> 1;
      if (x[middle] <= at) low = middle + 1;
      else high = middle;
    }
    if (low === 0) return y[0];
    if (low === x.length) return y[low - 1];
    return y[low - 1] + ((at - x[low - 1]) * (y[low] - y[low - 1])) / (x[low] - x[low - 1]);
  }

  /** Where y over x first rises to a level, by a straight line. @param {ArrayLike<number>} x
      @param {ArrayLike<number>} y @param {number} level */
  function crossing(x, y, level) {
    for (let k = 0; k + 1 < y.length; k++) {
      if (y[k + 1] >= level && y[k] < level) return x[k] + ((level - y[k]) / (y[k + 1] - y[k])) * (x[k + 1] - x[k]);
    }
    throw new Refused("the response does not cross the level");
  }

  /** Solution of a small system of equations. @param {number[][]} matrix @param {number[]} right */
  function solved(matrix, right) {
    const rows = matrix.map((row, i) => [...row, right[i]]), n = rows.length;
    for (let i = 0; i < n; i++) {
      let pivot = i;
      for (let k = i + 1; k < n; k++) if (Math.abs(rows[k][i]) > Math.abs(rows[pivot][i])) pivot = k;
      [rows[i], rows[pivot]] = [rows[pivot], rows[i]];
      for (let k = i + 1; k < n; k++) {
        const factor = rows[k][i] / rows[i][i];
        for (let j = i; j <= n; j++) rows[k][j] -= factor * rows[i][j];
      }
    }
    const found = new Array(n).fill(0);
    for (let i = n - 1; i >= 0; i--) {
      found[i] = (rows[i][n] - found.reduce((sum, v, j) => (j > i ? sum + v * rows[i][j] : sum), 0)) / rows[i][i];
    }
    return found;
  }

  /** Coefficients of the least-squares polynomial in x, the constant first. @param {ArrayLike<number>} x about -1 to 1
      @param {ArrayLike<number>} y @param {number} degree */
  function polynomial(x, y, degree) {
    const sums = new Array(2 * degree + 1).fill(0), right = new Array(degree + 1).fill(0);
    for (let i = 0; i < x.length; i++) {
      let power = 1;
      for (let k = 0; k <= 2 * degree; k++) {
        sums[k] += power;
        if (k <= degree) right[k] += power * y[i];
        power *= x[i];
      }
    }
    return solved(right.map((_, i) => right.map((_, j) => sums[i + j])), right);
  }

  /** Every metric in the unit of the reports, or why there is none.
      @param {Reader} reader @param {Channels} channels @param {Repeats} course @param {Wanted[]} wanted
      @param {string} refused why there is none at all; empty where there may be some
      @returns {{values: Record<string, number>, reasons: Record<string, string>, reading: any}} the reading is null where
      there is none */
  function evaluate(reader, channels, course, wanted, refused = "") {
    /** @type {Record<string, number>} */
    const values = {};
    /** @type {Record<string, string>} */
    const reasons = {};
    let whole = refused;
    /** @type {any} */
    let reading = null;
    try {
      if (refused) throw new Refused(refused);
      reading = reader.read(channels, course);
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      whole = error.message;
    }
    for (const { name, scale, validity } of wanted) {
      values[name] = NaN;
      try {
        if (!reading) throw new Refused(whole);
        const peak = validity ? reading.peakAcceleration() : 0;  // [g]
        if (validity && !(validity[0] <= peak && peak <= validity[1])) {
          const advice = peak < validity[0] ? `below ${validity[0]} g` : `above ${validity[1]} g`;
          throw new Refused(`lateral acceleration peaks at ${peak.toFixed(3)} g, ${advice}`);
        }
        const value = mean(reader.metrics[name](reading)) * scale;
        if (!Number.isFinite(value)) throw new Refused("no finite value");
        values[name] = value;
      } catch (error) {
        if (!(error instanceof Refused)) throw error;
        reasons[name] = error.message;
      }
    }
    return { values, reasons, reading };
  }

  return {
    Refused, mean, extremes, quantile, median, lowPassed, channel, smoothed, time, rate, gradient, runs, interpolated, crossing,
    solved, polynomial, evaluate,
  };
}
