/* Metrics of a release: a port of steer_env.metrics.release, with .common.free_control, .free_hands and .decay. */

"use strict";

/** @param {Tools} tools @param {Record<string, any>} all constants of the Python modules by their names
    @returns {Reader} */
function steerRelease(tools, all) {
  const { Refused, mean, quantile, extremes, smoothed, time, rate, gradient, runs, polynomial } = tools;
  const { free_hands: HANDS, free_control: CONTROL, decay: DECAY } = all;
  const ANGLE = "handwheel_angle", TORQUE = "handwheel_torque", AY = "lateral_acceleration", YAW = "yaw_rate";

  /** @typedef {{t: number[], y: number[]}} Section */

  /** The releases of a recording; every channel counts positive towards the side of its turn. */
  class Releases {
    /** @param {Channels} channels */
    constructor(channels) {
      this.smooth = smoothed(channels, HANDS.CUTOFF);
      /** @type {Map<string, (at: number) => number>} */
      this.integrals = new Map();
      const size = this.smooth(TORQUE).map(Math.abs), level = quantile(size, 0.95);
      const found = runs(size.length, (i) => size[i] < HANDS.FREE * level).filter(([a, b]) => letGo(size, a, b, level));
      if (!found.length) throw new Refused(`${TORQUE} nowhere drops from a held value to zero for ${CONTROL.FREE} s`);
      /** @type {number[]} */
      this.start = found.map(([a]) => fall(size, a));
      /** @type {number[]} */
      this.side = this.start.map(() => 1);
      this.side = this.mean(ANGLE, HANDS.BEFORE[0], HANDS.BEFORE[1]).map(Math.sign);
      this.held(TORQUE);
      this.held(ANGLE);
      /** @type {number[][] | undefined} */
      this.fits = undefined;
    }

    /** Time from the start of an event and the channel there. @param {string} name @param {number} event
        @param {number} begin @param {number} end @returns {Section} */
    section(name, event, begin, end) {
      const y = this.smooth(name), found = { t: /** @type {number[]} */ ([]), y: /** @type {number[]} */ ([]) };
      const first = Math.max(Math.floor((this.start[event] + begin) * rate) - 2, 0);
      for (let i = first; i < y.length; i++) {
        const t = time(i) - this.start[event];
        if (t > end) break;
        if (t < begin) continue;
        found.t.push(t);
        found.y.push(this.side[event] * y[i]);
      }
      if (found.t.length < 5) throw new Refused(`${found.t.length} samples from ${begin} to ${end} s after an event`);
      return found;
    }

    /** Mean of a channel from begin to end after each event. @param {string} name @param {number} begin
        @param {number} end @returns {number[]} */
    mean(name, begin, end) {
      const total = this.integrals.get(name) ?? integral(this.smooth(name));
      this.integrals.set(name, total);
      return this.start.map((start, k) => (this.side[k] * (total(start + end) - total(start + begin))) / (end - begin));
    }

    /** Mean of a channel before the release; refused where it opposed the angle or was not steady. @param {string} name */
    held(name) {
      const [from, to] = HANDS.BEFORE, now = this.mean(name, from, to), before = this.mean(name, from - 0.5, to - 0.5);
      if (now.some((v) => v <= 0)) throw new Refused(`${name} does not follow ${ANGLE}`);
      if (now.some((v, k) => Math.abs(v - before[k]) > HANDS.STEADY * v)) {
        throw new Refused(`${name} changes by over ${100 * HANDS.STEADY} % in the second before the release`);
      }
      return now;
    }

    peakAcceleration() { return Math.max(...this.held(AY)) / HANDS.G; }

    excitation() { return this.held(YAW); }

    /** @param {string} name */
    residual(name) {
      const [from, to] = CONTROL.RESIDUAL;
      this.excitation().forEach((size, k) => {
        const [low, high] = extremes(this.section(YAW, k, from, to).y);
        if (high - low > CONTROL.UNSETTLED * size) {
          throw new Refused(`${YAW} still spans over ${100 * CONTROL.UNSETTLED} % of the excitation ${from} s after the ` +
            "hands let go: the car oscillates");
        }
      });
      return this.mean(name, from, to);
    }

    /** Time and yaw rate of the first extreme to the other side. */
    opposite() {
      return this.excitation().map((_, k) => lowest(this.section(YAW, k, 0, 1.5)));
    }

    /** Damping ratio and natural frequency [Hz] of the oscillation after each event. */
    decays() {
      const end = (/** @type {number} */ t) => Math.min(t + CONTROL.FITTED, CONTROL.FREE);
      return (this.fits ??= this.opposite().map(([t], k) => fit(this.section(YAW, k, t, end(t)))));
    }
  }

  /** Whether a run of small torques is a release: long enough, and with a held torque right before it.
      @param {Float64Array} size @param {number} a @param {number} b @param {number} level */
  function letGo(size, a, b, level) {
    if (a === 0 || time(b - 1) - time(a) < CONTROL.FREE - HANDS.FALL || time(a) < time(0) + 1.3) return false;
    const from = size.findIndex((_, i) => time(i) >= time(a) - HANDS.FALL);
    return extremes(size, from, a)[1] > HANDS.GRIP * level;
  }

  /** Time at which the size falls through half of its mean in the half second before the fall [s].
      @param {Float64Array} size @param {number} a */
  function fall(size, a) {
    const half = 0.5 * mean(size.filter((_, i) => time(i) > time(a) - 0.8 && time(i) < time(a) - HANDS.FALL));
    let k = a;
    while (size[k] < half) k--;
    return time(k) + ((size[k] - half) / (size[k] - size[k + 1])) / rate;
  }

  /** Integral over time of a smooth channel, as a function of time [s], by cubics between the samples.
      @param {Float64Array} y */
  function integral(y) {
    const slope = gradient(y), h = 1 / rate, total = new Float64Array(y.length);
    for (let i = 1; i < y.length; i++) total[i] = total[i - 1] + (0.5 * (y[i] + y[i - 1])) * h;
    for (let i = 0; i < y.length; i++) total[i] -= (h * h / 12) * (slope[i] - slope[0]);
    return (/** @type {number} */ at) => {
      const place = at * rate - 1, i = Math.min(Math.max(Math.floor(place), 0), y.length - 2), s = place - i, r = 1 - s;
      return (1 + 2 * s) * r * r * total[i] + s * s * (3 - 2 * s) * total[i + 1] +
        h * (s * r * r * y[i] - s * s * r * y[i + 1]);
    };
  }

  /** Time and value of the lowest point: the vertex of a parabola through the samples around the lowest sample.
      @param {Section} section */
  function lowest({ t, y }) {
    const half = DECAY.HALF_WIDTH;
    let k = 0;
    for (let i = 1; i < y.length; i++) if (y[i] < y[k]) k = i;
    const near = t.flatMap((each, i) => (Math.abs(each - t[k]) <= half ? [i] : []));
    const [c0, c1, c2] = polynomial(near.map((i) => (t[i] - t[k]) / half), near.map((i) => y[i]), 2);
    if (c2 <= 0) return [t[k], y[k]];
    const place = Math.min(Math.max(-c1 / (2 * c2), -1), 1);
    return [t[k] + place * half, c0 + place * (c1 + place * c2)];
  }

  /** What the best damped cosine with a rate of decay and a frequency leaves of samples, by orthogonal projection.
      @param {number[]} t @param {number[]} y @param {number} decay @param {number} omega */
  function rest(t, y, decay, omega) {
    const wave = [t.map(() => 1), t.map((at) => Math.exp(-decay * at) * Math.cos(omega * at)),
      t.map((at) => Math.exp(-decay * at) * Math.sin(omega * at))];
    const dot = (/** @type {number[]} */ a, /** @type {number[]} */ b) => a.reduce((sum, v, i) => sum + v * b[i], 0);
    /** @type {number[][]} */
    const basis = [];
    let left = y;
    for (let column of wave) {
      for (const each of basis) {
        const share = dot(column, each);
        column = column.map((v, i) => v - share * each[i]);
      }
      const size = Math.sqrt(dot(column, column));
      column = column.map((v) => v / size);
      basis.push(column);
      const share = dot(left, column);
      left = left.map((v, i) => v - share * column[i]);
    }
    return left;
  }

  /** @param {number[]} values */
  const squares = (values) => values.reduce((sum, v) => sum + v * v, 0);

  /** Damping ratio and natural frequency [Hz] of a decaying cosine, by least squares from the best place of a grid.
      @param {Section} section */
  function fit(section) {
    const thin = Math.max(1, Math.floor(section.t.length / DECAY.SAMPLES)), every = (/** @type {number[]} */ list) =>
      list.filter((_, i) => i % thin === 0);
    const t = every(section.t).map((at) => at - section.t[0]), y = every(section.y);
    /** @type {[number, number][]} */
    const grid = DECAY.GRID;
    let [place, least] = [grid[0], Infinity];
    for (const each of grid) {
      const left = squares(rest(t, y, ...each));
      if (left < least) [place, least] = [each, left];
    }
    const scale = [1, 5];
    let damping = 1e-3;
    for (let round = 0; round < 60 && damping < 1e9; round++) {  // Levenberg and Marquardt
      const now = rest(t, y, ...place);
      const slopes = scale.map((size, k) => {
        const step = 1e-6 * size, ends = [step, -step].map((by) =>
          rest(t, y, place[0] + (k === 0 ? by : 0), place[1] + (k === 1 ? by : 0)));
        return ends[0].map((v, i) => ((v - ends[1][i]) / (2 * step)) * size);
      });
      const inner = slopes.map((a) => slopes.map((b) => a.reduce((sum, v, i) => sum + v * b[i], 0)));
      const right = slopes.map((a) => -a.reduce((sum, v, i) => sum + v * now[i], 0));
      const step = tools.solved(inner.map((row, i) => row.map((v, j) => (i === j ? v * (1 + damping) : v))), right);
      const to = /** @type {[number, number]} */ (place.map((v, k) => v + step[k] * scale[k]));
      const left = squares(rest(t, y, ...to));
      if (left <= least) {
        [place, least, damping] = [to, left, damping / 10];
        if (Math.hypot(...step) < 1e-9) break;
      } else damping *= 10;
    }
    const middle = mean(y), explained = 1 - least / squares(y.map((v) => v - middle)), omega = Math.abs(place[1]);
    if (!(explained >= DECAY.EXPLAINED && place[0] < DECAY.HEAVIEST && DECAY.SLOWEST < omega / Math.PI &&
          omega / Math.PI < 4 * DECAY.FASTEST)) {
      throw new Refused(`a decaying oscillation explains ${Math.round(100 * Math.max(explained, 0))} % of the ${YAW}, ` +
        `less than ${100 * DECAY.EXPLAINED} %: it does not oscillate`);
    }
    if (place[0] <= 0) throw new Refused(`the oscillation of ${YAW} does not die out: there is no damping to report`);
    const natural = Math.hypot(place[0], omega);
    return [place[0] / natural, natural / (2 * Math.PI)];
  }

  /** Time at which |y| last enters a band, interpolated. @param {number[]} t @param {number[]} y @param {number} band */
  function lastOutside(t, y, band) {
    let k = y.length - 1;
    while (k >= 0 && Math.abs(y[k]) <= band) k--;
    if (k < 0) return t[0];
    if (k + 1 === y.length) throw new Refused("it does not settle before the hands grip again");
    const a = Math.abs(y[k]) - band, b = Math.abs(y[k + 1]) - band;
    return t[k] + ((t[k + 1] - t[k]) * a) / (a - b);
  }

  /** Time at which y first falls through a level. @param {Section} section @param {number} level */
  function firstBelow({ t, y }, level) {
    const k = y.findIndex((v) => v < level);
    if (k <= 0) throw new Refused(`${YAW} does not fall through the level`);
    return t[k - 1] + ((t[k] - t[k - 1]) * (y[k - 1] - level)) / (y[k - 1] - y[k]);
  }

  return {
    read: (channels) => new Releases(channels),
    metrics: {
      free_damping_ratio: (/** @type {Releases} */ free) => free.decays().map(([ratio]) => ratio),
      free_natural_frequency: (/** @type {Releases} */ free) => free.decays().map(([, frequency]) => frequency),
      residual_yaw_rate: (/** @type {Releases} */ free) => free.residual(YAW),
      residual_handwheel_angle: (/** @type {Releases} */ free) => free.residual(ANGLE),
      free_yaw_rate_settling_time: (/** @type {Releases} */ free) => {
        const size = free.excitation(), residual = free.residual(YAW);
        return size.map((s, k) => {
          const { t, y } = free.section(YAW, k, 0, CONTROL.FREE);
          return lastOutside(t, y.map((v) => v - residual[k]), CONTROL.BAND * s);
        });
      },
      yaw_rate_after_1s: (/** @type {Releases} */ free) => {
        const held = free.excitation();
        return free.mean(YAW, 0.9, 1.1).map((v, k) => v / held[k]);
      },
      release_overshoot: (/** @type {Releases} */ free) => {
        const residual = free.residual(YAW), held = free.excitation(), other = free.opposite();
        return residual.map((r, k) => (r - other[k][1]) / (held[k] - r));
      },
      yaw_rate_time_to_half: (/** @type {Releases} */ free) =>
        free.excitation().map((held, k) => firstBelow(free.section(YAW, k, -0.2, CONTROL.FREE), 0.5 * held)),
    },
  };
}
