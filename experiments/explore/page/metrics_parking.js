/* Metrics of parking: a port of steer_env.metrics.parking to the browser. */

"use strict";

/** @param {Tools} tools @param {Record<string, any>} all constants of the Python modules by their names
    @returns {Reader} */
function steerParking(tools, all) {
  const { Refused, mean, median, smoothed, time, rate, interpolated } = tools, PARKING = all.parking;
  const ANGLE = "handwheel_angle", TORQUE = "handwheel_torque", RACK = "rack_force", MOTOR = "motor_torque";

  /** The half sweeps from lock to lock. */
  class Sweeps {
    /** @param {Channels} channels @param {number} fewest */
    constructor(channels, fewest) {
      this.channels = channels;
      this.smooth = smoothed(channels, PARKING.CUTOFF);
      const angle = this.smooth(ANGLE), [left, right] = [1, -1].map((sign) => {
        const most = angle.reduce((so, v) => Math.max(so, sign * v), -Infinity);
        return sign * median(angle.filter((v) => sign * v >= PARKING.AT_LOCK * most).map((v) => sign * v));
      });
      const lock = 0.5 * (left - right), travel = angle.map((v) => (v - 0.5 * (left + right)) / Math.max(lock, 1e-9));
      /** @type {{from: number, to: number, side: number, times: Float64Array, farthest: Float64Array}[]} */
      this.sweeps = [];
      let before = -1;
      for (let i = 0; i < travel.length; i++) {
        if (Math.abs(travel[i]) < PARKING.END) continue;
        if (before >= 0 && travel[before] * travel[i] < 0) {
          const side = Math.sign(travel[i] - travel[before]);
          const farthest = travel.slice(before, i + 1), from = before;
          farthest.forEach((v, k) => { farthest[k] = Math.max(side * v, farthest[k - 1] ?? -Infinity); });
          this.sweeps.push({ from, to: i + 1, side, farthest, times: farthest.map((_, k) => time(from + k)) });
        }
        before = i;
      }
      if (this.sweeps.length < fewest) throw new Refused(`${this.sweeps.length} half sweeps from lock to lock`);
    }

    /** A channel in each half sweep, positive in the direction of the turning handwheel. @param {string} name */
    along(name) {
      return this.sweeps.map(({ from, to, side }) => this.smooth(name).slice(from, to).map((v) => side * v));
    }

    /** As along; refused where the channel opposes the handwheel. @param {string} name */
    effort(name) {
      const found = this.along(name);
      if (found.some((values) => mean(values) < 0)) throw new Refused(`${name} runs against the turning ${ANGLE}`);
      return found;
    }

    /** Means over time between consecutive places of the travel. @param {Float64Array[]} efforts @param {number[]} edges */
    between(efforts, edges) {
      return this.sweeps.map(({ times, farthest }, k) => {
        const values = efforts[k], total = new Float64Array(values.length);
        for (let i = 1; i < values.length; i++) total[i] = total[i - 1] + (0.5 * (values[i] + values[i - 1])) / rate;
        const at = edges.map((edge) => interpolated(edge, farthest, times));
        const sums = at.map((t) => interpolated(t, times, total));
        return at.slice(1).map((t, i) => (sums[i + 1] - sums[i]) / (t - at[i]));
      });
    }

    /** @param {string} name @param {number} low @param {number} high */
    mean(name, low = -PARKING.END, high = PARKING.END) {
      return this.between(this.effort(name), [low, high]).map(([value]) => value);
    }

    /** Mean over the section of the travel in which the mean of all half sweeps is highest. @param {Float64Array[]} efforts */
    peak(efforts) {
      const edges = Array.from({ length: PARKING.PARTS + 1 }, (_, i) => PARKING.END * ((2 * i) / PARKING.PARTS - 1));
      const found = this.between(efforts, edges), means = found[0].map((_, i) => mean(found.map((row) => row[i])));
      return found.map((row) => row[means.indexOf(Math.max(...means))]);
    }

    /** Root mean square from 1 to 10 Hz, without the noise. @param {string} name */
    ripple(name) {
      this.effort(name);
      return this.sweeps.map(({ from, to }) => {
        const edge = Math.floor((to - from) / 10), values = this.channels[name].subarray(from + edge, to - edge);
        if (values.length <= rate / PARKING.RIPPLE) throw new Refused("a half sweep is too quick for its ripple");
        const density = periodogram(values), step = rate / values.length;
        const noise = median(density.filter((_, k) => k * step > PARKING.CUTOFF)) / Math.log(2);
        const inside = density.filter((_, k) => k * step >= PARKING.RIPPLE && k * step <= PARKING.CUTOFF);
        return Math.sqrt(Math.max(inside.reduce((sum, v) => sum + v - noise, 0) * step, 0));
      });
    }

    rate() {
      const angle = this.smooth(ANGLE);
      return this.sweeps.map(({ from, to }) => Math.abs(angle[to - 1] - angle[from]) / (time(to - 1) - time(from)));
    }
  }

  /** Spectral density of samples without their line, in Hann's window, from 0 Hz to half the rate.
      @param {Float64Array} values */
  function periodogram(values) {
    const n = values.length, middle = (n - 1) / 2, level = mean(values);
    let rise = 0, norm = 0, power = 0;
    for (let i = 0; i < n; i++) {
      rise += (i - middle) * values[i];
      norm += (i - middle) ** 2;
    }
    const windowed = values.map((v, i) => {
      const window = 0.5 - 0.5 * Math.cos((2 * Math.PI * i) / n);
      power += window * window;
      return (v - level - (rise / norm) * (i - middle)) * window;
    });
    const { re, im } = transformed(windowed);
    return Float64Array.from({ length: (n >> 1) + 1 }, (_, k) =>
      ((re[k] * re[k] + im[k] * im[k]) / (rate * power)) * (k === 0 || 2 * k === n ? 1 : 2));
  }

  /** Fourier transform of any number of samples, as a convolution with a chirp (Bluestein, 1970). @param {Float64Array} x */
  function transformed(x) {
    const n = x.length, size = 2 ** Math.ceil(Math.log2(2 * n));
    const chirp = Array.from({ length: n }, (_, k) => (Math.PI * ((k * k) % (2 * n))) / n);
    const re = new Float64Array(size), im = new Float64Array(size);
    const cos = new Float64Array(size), sin = new Float64Array(size);
    for (let k = 0; k < n; k++) {
      cos[k] = cos[(size - k) % size] = Math.cos(chirp[k]);
      sin[k] = sin[(size - k) % size] = Math.sin(chirp[k]);
      re[k] = x[k] * cos[k];
      im[k] = -x[k] * sin[k];
    }
    fourier(re, im);
    fourier(cos, sin);
    for (let k = 0; k < size; k++) [re[k], im[k]] = [re[k] * cos[k] - im[k] * sin[k], -re[k] * sin[k] - im[k] * cos[k]];
    fourier(re, im);  // of the conjugate, which is the inverse
    return {
      re: Float64Array.from(chirp, (a, k) => (re[k] * Math.cos(a) - im[k] * Math.sin(a)) / size),
      im: Float64Array.from(chirp, (a, k) => (-im[k] * Math.cos(a) - re[k] * Math.sin(a)) / size),
    };
  }

  /** Fourier transform of a power of two of complex samples, in place. @param {Float64Array} re @param {Float64Array} im */
  function fourier(re, im) {
    const n = re.length;
    for (let i = 1, j = 0; i < n; i++) {
      let bit = n >> 1;
      for (; j & bit; bit >>= 1) j ^= bit;
      j ^= bit;
      if (i < j) [re[i], re[j], im[i], im[j]] = [re[j], re[i], im[j], im[i]];
    }
    const cos = Float64Array.from({ length: n / 2 }, (_, k) => Math.cos((2 * Math.PI * k) / n));
    const sin = Float64Array.from({ length: n / 2 }, (_, k) => -Math.sin((2 * Math.PI * k) / n));
    for (let size = 2; size <= n; size *= 2) {
      const half = size >> 1, stride = n / size;
      for (let start = 0; start < n; start += size) {
        for (let k = 0, a = start; k < half; k++, a++) {
          const c = cos[k * stride], s = sin[k * stride], b = a + half;
          const u = re[b] * c - im[b] * s, v = re[b] * s + im[b] * c;
          re[b] = re[a] - u;
          im[b] = im[a] - v;
          re[a] += u;
          im[a] += v;
        }
      }
    }
  }

  return {
    read: (channels, course) => new Sweeps(channels, course.fewest),
    metrics: {
      parking_handwheel_rate: (/** @type {Sweeps} */ sweeps) => sweeps.rate(),
      rack_force_at_centre: (/** @type {Sweeps} */ sweeps) => sweeps.mean(RACK, -PARKING.CENTRE, PARKING.CENTRE),
      rack_force_peak: (/** @type {Sweeps} */ sweeps) => sweeps.peak(sweeps.effort(RACK)),
      rack_force_mean_towards_lock: (/** @type {Sweeps} */ sweeps) => sweeps.mean(RACK, 0),
      handwheel_torque_at_centre: (/** @type {Sweeps} */ sweeps) => sweeps.mean(TORQUE, -PARKING.CENTRE, PARKING.CENTRE),
      handwheel_torque_mean: (/** @type {Sweeps} */ sweeps) => sweeps.mean(TORQUE),
      handwheel_torque_peak: (/** @type {Sweeps} */ sweeps) => sweeps.peak(sweeps.effort(TORQUE)),
      handwheel_torque_ripple: (/** @type {Sweeps} */ sweeps) => sweeps.ripple(TORQUE),
      motor_torque_peak: (/** @type {Sweeps} */ sweeps) => sweeps.peak(sweeps.effort(MOTOR)),
      motor_torque_mean: (/** @type {Sweeps} */ sweeps) => sweeps.mean(MOTOR),
      motor_power_peak: (/** @type {Sweeps} */ sweeps) => {
        const speed = sweeps.along("column_speed");
        return sweeps.peak(sweeps.effort(MOTOR).map((torque, k) => torque.map((v, i) => v * speed[k][i])));
      },
    },
  };
}
