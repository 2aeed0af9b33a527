/* Metrics of a step steer: a port of steer_env.metrics.step_steer to the browser. */

"use strict";

/** @typedef {{start: number, size: number, before: [number, number], response: [number, number]}} Step instant [s] and
 *             change of the angle [rad]; samples straight ahead, and from there to the end of the hold */

/** @param {Tools} tools @param {Record<string, any>} all constants of the Python modules by their names
    @returns {Reader} */
function steerSteps(tools, all) {
  const { Refused, mean, median, extremes, smoothed, time, rate, gradient, runs, crossing, polynomial } = tools;
  const { step_steer: STEP, events: EVENTS } = all;
  const ANGLE = "handwheel_angle", TORQUE = "handwheel_torque", AY = "lateral_acceleration", YAW = "yaw_rate";

  /** @param {number} seconds */
  const samples = (seconds) => Math.round(seconds * rate);
  /** @param {Float64Array} values @param {number} from @param {number} to */
  const span = (values, from, to) => {
    const [low, high] = extremes(values, from, to);
    return high - low;
  };

  /** The steps of a recording, and the responses to them. */
  class Steps {
    /** @param {Channels} channels @param {Step[] | null} steps @param {number} cutoff */
    constructor(channels, steps = null, cutoff = STEP.CUTOFF) {
      this.channels = channels;
      this.smooth = smoothed(channels, cutoff);
      this.steps = steps ?? found(this.smooth(ANGLE));
      /** @type {Map<string, any>} */
      this.kept = new Map();
    }

    /** @template T @param {string} key @param {() => T} make @returns {T} */
    once(key, make) {
      if (!this.kept.has(key)) this.kept.set(key, make());
      return this.kept.get(key);
    }

    /** Time from the start of a step, and a channel less its mean before, positive in the step's direction.
        @param {Float64Array} values @param {Step} step @param {boolean} centred */
    response(values, step, centred = true) {
      const offset = centred ? mean(values.subarray(...step.before)) : 0, [from, to] = step.response;
      return {
        t: Array.from({ length: to - from }, (_, i) => time(from + i) - step.start),
        y: Array.from(values.subarray(from, to), (v) => (v - offset) * Math.sign(step.size)),
      };
    }

    /** Means over the last second of each hold. @param {Float64Array} values @param {boolean} centred */
    steadyOf(values, centred = true) {
      return this.steps.map((step) => {
        const { t, y } = this.response(values, step, centred), end = t[t.length - 1] - STEP.STEADY;
        return mean(y.filter((_, i) => t[i] > end));
      });
    }

    /** @param {string} name */
    steady(name) {
      const values = this.once(`steady ${name}`, () => this.steadyOf(this.smooth(name)));
      if (mean(values) <= 0) throw new Refused(`${name} does not follow ${ANGLE}`);
      return values;
    }

    /** @param {string} name */
    gain(name) { return this.steady(name).map((v, k) => v / Math.abs(this.steps[k].size)); }

    /** Responses over their steady values. @param {string} name */
    relative(name) {
      return this.once(`relative ${name}`, () => this.steady(name).map((level, k) => {
        const { t, y } = this.response(this.smooth(name), this.steps[k]);
        return { t, y: y.map((v) => v / level) };
      }));
    }

    /** @param {string} name */
    responseTime(name) { return this.relative(name).map(({ t, y }) => crossing(t, y, 0.9)); }

    /** @param {string} name */
    riseTime(name) {
      return this.relative(name).map(({ t, y }) => {
        const end = crossing(t, y, 0.9);
        let under = 0;
        for (let i = 0; t[i] < end; i++) if (y[i] < 0.1) under = i;
        return end - crossing(t.slice(under), y.slice(under), 0.1);
      });
    }

    /** Time and height of the peak of each response. @param {string} name */
    peak(name) {
      return this.once(`peak ${name}`, () => this.relative(name).map(({ t, y }) => {
        const early = t.filter((at) => at < t[t.length - 1] - STEP.STEADY).length;
        return peak(t.slice(0, early), y.slice(0, early), 1);
      }));
    }

    /** Time until the response stays within 5 % of its steady value, low-passed further. @param {string} name */
    settlingTime(name) {
      const calm = this.once("calm", () => new Steps(this.channels, this.steps, STEP.SETTLING_CUTOFF));
      const each = calm.relative(name);
      const size = Math.min(...each.map(({ y }) => y.length)), { t } = /** @type {any} */ (each.find(({ y }) => y.length === size));
      const all = each.map((one) => Float64Array.from(t, (at) => tools.interpolated(at, one.t, one.y) - 1));
      const middle = all[0].map((_, i) => mean(all.map((y) => y[i])));
      let k = size - 1;
      while (Math.abs(middle[k]) <= STEP.BAND) k--;
      if (t[k] > t[size - 1] - STEP.STEADY) throw new Refused(`${name} does not settle within 5 %`);
      const ends = [Math.abs(middle[k]), Math.abs(middle[k + 1])];
      const at = t[k] + ((ends[0] - STEP.BAND) / (ends[0] - ends[1])) * (t[k + 1] - t[k]);
      /** @type {number[]} */
      const near = t.flatMap((/** @type {number} */ one, /** @type {number} */ i) => (Math.abs(one - at) <= STEP.AROUND ? [i] : []));
      const side = Math.sign(middle[near[0]]), places = near.map((i) => (t[i] - at) / STEP.AROUND);
      const fits = all.map((y) => polynomial(places, near.map((i) => side * y[i] - STEP.BAND), 2));
      const slope = mean(fits.map((fit) => fit[1])) / STEP.AROUND;
      if (!(slope < 0)) throw new Refused(`${name} only touches the band of 5 %, so its settling time is not defined`);
      return fits.map((fit) => at - fit[0] / slope);
    }

    sideslip() {
      const lateral = this.smooth("lateral_speed"), forward = this.smooth("vehicle_speed");
      return this.steadyOf(lateral.map((v, i) => Math.atan2(v, forward[i])));
    }

    peakAcceleration() { return mean(this.steady(AY)) / STEP.G; }
  }

  /** The steps from straight ahead; the handwheel is straight before the first of them. @param {Float64Array} angle
      @returns {Step[]} */
  function found(angle) {
    const speed = gradient(angle).map(Math.abs), fastest = extremes(speed)[1];
    if (fastest < STEP.SLOWEST) throw new Refused(`${ANGLE} changes too slowly for a step`);
    /** @type {Step[]} */
    const steps = [];
    let straight = NaN, largest = 0;
    for (const [i, j] of runs(angle.length, (k) => speed[k] > STEP.FAST * fastest, samples(0.1))) {
      const from = Math.max(i - samples(STEP.BEFORE + 0.1), 0), to = Math.max(i - samples(0.1), 0);
      const settled = angle.subarray(j + samples(0.1), j + samples(0.6));
      if (to - from < 2 || (to - 1 - from) / rate < 0.5 * STEP.BEFORE || !settled.length) continue;
      const before = mean(angle.subarray(from, to)), level = median(settled), size = level - before;
      if (Number.isNaN(straight)) straight = before;
      largest = Math.max(largest, Math.abs(size));
      if (Math.abs(before - straight) > 0.2 * Math.abs(size)) continue;  // a step back to straight ahead
      const off = (/** @type {number} */ k) => Math.abs(angle[k] - level);
      let first = j, end = 0;
      while (first < angle.length && off(first) > STEP.HELD * Math.abs(size)) first++;
      if (first === angle.length) first = j;
      for (end = first; end < angle.length && off(end) <= STEP.HELD * Math.abs(size);) end++;
      if (end < angle.length) end = endOfHold(angle, first, end, Math.abs(size)) - samples(0.1);
      if (end <= first || (end - 1 - first) / rate < STEP.HOLD || span(angle, from, to) > STEP.HELD * Math.abs(size)) continue;
      const held = mean(angle.subarray(Math.max(first, end - 1 - samples(STEP.STEADY) + 1), end));
      const a = Math.max(i - samples(0.1), 0), rise = angle.subarray(a, first + 1);
      const start = crossing(Array.from(rise, (_, k) => time(a + k)), rise.map((v) => (v - before) / (held - before)), 0.5);
      steps.push({ start, size: held - before, before: [from, to], response: [from, end] });
    }
    const whole = steps.filter((step) => Math.abs(step.size) > 0.5 * largest);
    if (!whole.length) throw new Refused(`no step from straight ahead held for ${STEP.HOLD} s`);
    return whole;
  }

  /** Sample before another at which the handwheel leaves the angle that it holds: where it was last within its own
      scatter. @param {Float64Array} angle @param {number} first @param {number} away @param {number} size */
  function endOfHold(angle, first, away, size) {
    const part = angle.subarray(first, away), level = median(part), off = part.map((v) => Math.abs(v - level));
    const band = Math.max(STEP.STILL * size, 3 * 1.4826 * median(off));
    let k = off.length - 1;
    while (off[k] > band) k--;
    return first + k + 1;
  }

  /** Place and height of the highest peak, from a cubic through its top. @param {number[]} x @param {number[]} y
      @param {number} base */
  function peak(x, y, base) {
    let k = 0;
    for (let i = 1; i < y.length; i++) if (y[i] > y[k]) k = i;
    if (k === 0 || k === y.length - 1) throw new Refused("the response has no peak within the section that is evaluated");
    const least = base + EVENTS.TOP * (y[k] - base);
    let i = k, j = k + 1;
    while (i > 0 && y[i - 1] >= least) i--;
    while (j < y.length && y[j] >= least) j++;
    if (j - i < EVENTS.FEWEST) throw new Refused(`${j - i} samples at the peak are too few`);
    const half = Math.max(x[j - 1] - x[k], x[k] - x[i]), u = x.slice(i, j).map((at) => (at - x[k]) / half);
    const fit = polynomial(u, y.slice(i, j), 3), [c, b, a] = [fit[1], 2 * fit[2], 3 * fit[3]];
    const discriminant = b * b - 4 * a * c, top = (2 * c) / (-b + Math.sqrt(discriminant));
    if (!(b < 0 && discriminant > 0) || !(top >= u[0] && top <= u[u.length - 1])) {
      throw new Refused("the response has no clear peak within the section that is evaluated");
    }
    return [x[k] + top * half, fit[0] + top * (fit[1] + top * (fit[2] + top * fit[3]))];
  }

  /** The metrics of a channel by their names. @param {string} name */
  const response = (name) => ({
    [`${name}_step_gain`]: (/** @type {Steps} */ steps) => steps.gain(name),
    [`${name}_time_to_90`]: (/** @type {Steps} */ steps) => steps.responseTime(name),
    [`${name}_rise_time`]: (/** @type {Steps} */ steps) => steps.riseTime(name),
    [`${name}_peak_time`]: (/** @type {Steps} */ steps) => steps.peak(name).map(([at]) => at),
    [`${name}_overshoot`]: (/** @type {Steps} */ steps) => steps.peak(name).map(([, height]) => height - 1),
    [`${name}_settling_time`]: (/** @type {Steps} */ steps) => steps.settlingTime(name),
  });

  return {
    read: (channels) => new Steps(channels),
    metrics: {
      ...response(YAW),
      ...response(AY),
      steady_step_torque: (/** @type {Steps} */ steps) => steps.steadyOf(steps.smooth(TORQUE), false),
      steady_step_sideslip: (/** @type {Steps} */ steps) => steps.sideslip(),
      tb_factor: (/** @type {Steps} */ steps) => {
        const sideslip = steps.sideslip();
        return steps.peak(YAW).map(([at], k) => at * Math.abs(sideslip[k]));
      },
    },
  };
}
