/* Metrics of catch-up: a port of steer_env.metrics.catch_up to the browser. */

"use strict";

/** @param {Tools} tools @param {Record<string, any>} all constants of the Python modules by their names
    @returns {Reader} */
function steerSweeps(tools, all) {
  const { Refused, mean, extremes, smoothed, time, interpolated, polynomial } = tools, SWEEPS = all.catch_up;
  const ANGLE = "handwheel_angle", TORQUE = "handwheel_torque";

  /** For each side the torque of the slow sweeps, and the speeds of all, ascending, with their excess torques. */
  class FastSweeps {
    /** @param {Channels} channels */
    constructor(channels) {
      const smooth = smoothed(channels, SWEEPS.CUTOFF), angle = smooth(ANGLE), torque = smooth(TORQUE);
      const [low, high] = extremes(angle), half = Math.max(0.5 * (high - low), 1e-9);
      const travel = angle.map((v) => (v - 0.5 * (high + low)) / half);
      /** @type {{rate: number, effort: number, side: number}[]} */
      const found = [];
      let before = -1;
      for (let i = 0; i < travel.length; i++) {
        if (Math.abs(travel[i]) < SWEEPS.FULL) continue;
        if (before >= 0 && travel[before] * travel[i] < 0) found.push(this.sweep(angle, torque, travel, before, i));
        before = i;
      }
      this.sides = [1, -1].flatMap((side) => {
        const own = found.filter((each) => each.side === side).sort((a, b) => a.rate - b.rate);
        const slow = own.filter(({ rate }) => rate <= SWEEPS.SLOW).map(({ effort }) => effort);
        if (!slow.length) return [];
        const quasiStatic = mean(slow);
        return [{ quasiStatic, rate: own.map(({ rate }) => rate), excess: own.map(({ effort }) => effort - quasiStatic) }];
      });
      if (!this.sides.length) throw new Refused("no slow sweep to compare with");
      if (this.sides.some(({ quasiStatic }) => quasiStatic <= 0)) throw new Refused(`${TORQUE} runs against the turning ${ANGLE}`);
    }

    /** Speed and mean torque in the middle of a sweep. @param {Float64Array} angle @param {Float64Array} torque
        @param {Float64Array} travel @param {number} a @param {number} b */
    sweep(angle, torque, travel, a, b) {
      const inside = [];
      for (let i = a; i <= b; i++) if (Math.abs(travel[i]) <= SWEEPS.MIDDLE) inside.push(i);
      if (inside.length < SWEEPS.FEWEST) throw new Refused(`${inside.length} samples in the middle of a sweep`);
      const side = Math.sign(travel[b] - travel[a]), first = inside[0], last = inside[inside.length - 1];
      const span = time(last) - time(first);
      const slope = polynomial(inside.map((i) => (time(i) - time(first)) / span), inside.map((i) => angle[i]), 1)[1] / span;
      let work = 0;
      for (let k = 1; k < inside.length; k++) {
        const [from, to] = [inside[k - 1], inside[k]];
        work += 0.5 * (torque[from] + torque[to]) * (angle[to] - angle[from]);
      }
      return { rate: side * slope, effort: (side * work) / (angle[last] - angle[first]), side };
    }
  }

  return {
    read: (channels) => new FastSweeps(channels),
    metrics: {
      catch_up_rate: (/** @type {FastSweeps} */ sweeps) => sweeps.sides.map(({ rate, excess }) => {
        const k = excess.findIndex((v) => v >= SWEEPS.CATCH_UP);
        if (k < 0) {
          throw new Refused(`not reached up to ${(rate[rate.length - 1] / SWEEPS.DEGREE).toFixed(0)} deg/s: the assist keeps up`);
        }
        return interpolated(SWEEPS.CATCH_UP, excess.slice(k - 1, k + 1), rate.slice(k - 1, k + 1));
      }),
      torque_excess_at_500_deg_s: (/** @type {FastSweeps} */ sweeps) => sweeps.sides.map(({ rate, excess }) => {
        if (rate[rate.length - 1] < SWEEPS.AT) throw new Refused("the fastest sweep is too slow");
        return interpolated(SWEEPS.AT, rate, excess);
      }),
      quasi_static_torque: (/** @type {FastSweeps} */ sweeps) => sweeps.sides.map(({ quasiStatic }) => quasiStatic),
    },
  };
}
