/* Whether the assist loop is stable with the handwheel held: a port of steer_env.vehicle.steering.stability, which
   refuses a weave with a loop that is not. Slow oscillations need not be left out here: with a held handwheel the loop
   has none that grows. */

"use strict";

/** @typedef {Record<string, [number, number]>} Places of packed numbers, by name */

function steerStability() {
  const SAMPLE = 1e-3, ROUNDING = 1e-6;  // [s], growth in a sample that counts as none [1]
  const SQUARINGS = 30, HALVINGS = 20;
  const TWIST = 0, SPEED = 1, MOTOR = 2;  // states of column and motor

  /** @typedef {number[][]} Matrix */

  /** @param {Matrix} a @param {Matrix} b @returns {Matrix} */
  function times(a, b) {
    return a.map((row) => {
      const found = new Array(b[0].length).fill(0);
      for (let k = 0; k < row.length; k++) {
        if (row[k]) for (let j = 0; j < found.length; j++) found[j] += row[k] * b[k][j];
      }
      return found;
    });
  }

  /** @param {number} n @returns {Matrix} */
  const identity = (n) => Array.from({ length: n }, (_, i) => Array.from({ length: n }, (_, j) => Number(i === j)));
  /** @param {Matrix} a */
  const size = (a) => Math.max(...a.map((row) => row.reduce((sum, v) => sum + Math.abs(v), 0)));

  /** Exponential of a matrix, by its series for a part of it that is squared again. @param {Matrix} a */
  function exponential(a) {
    const halvings = Math.max(Math.ceil(Math.log2(size(a) || 1)) + 4, 0);
    const part = a.map((row) => row.map((v) => v / 2 ** halvings));
    let term = identity(a.length), sum = term;
    for (let k = 1; k < 14; k++) {
      term = times(term, part).map((row) => row.map((v) => v / k));
      sum = sum.map((row, i) => row.map((v, j) => v + term[i][j]));
    }
    for (let k = 0; k < halvings; k++) sum = times(sum, sum);
    return sum;
  }

  /** Largest size of an eigenvalue, from the growth of a high power. @param {Matrix} a */
  function radius(a) {
    let log = 0, power = a;
    for (let k = 0; k < SQUARINGS; k++) {
      const scale = size(power);
      if (scale === 0) return 0;
      log += Math.log(scale) / 2 ** k;
      power = power.map((row) => row.map((v) => v / scale));
      power = times(power, power);
    }
    return Math.exp(log + Math.log(size(power) || 1) / 2 ** SQUARINGS);
  }

  /** Cell of a grid and place in it, 0 to 1, held at the ends. @param {ArrayLike<number>} grid @param {number} x */
  function bracket(grid, x) {
    let i = 0;
    while (i < grid.length - 2 && grid[i + 1] <= x) i++;
    return [i, Math.min(Math.max((x - grid[i]) / (grid[i + 1] - grid[i]), 0), 1)];
  }

  /** Parameters of column and assist by their names. @param {Places} places @param {Float64Array} numbers */
  function read(places, numbers) {
    const list = (/** @type {string} */ name) => numbers.subarray(...places[name]);
    const one = (/** @type {string} */ name) => numbers[places[name][0]];
    const filter = (/** @type {string} */ name) => ["b0", "b1", "a1"].map((key) => one(`${name}.${key}`));
    const speeds = list("assist.speeds"), inertia = "assist.functions.inertia_compensation";
    return {
      I2: one("column.I2"), K: one("column.K_tb"), C_tb: one("column.C_tb"), C2: one("column.C2"), speeds,
      torques: list("assist.torques"), boost: list("assist.boost"), damping: list("assist.damping"),
      lead: ["lead_b0", "lead_b1", "lead_a1"].map((key) => one(`assist.${key}`)), delay: one("assist.delay"),
      offset: one("assist.offset"), bandwidth: one("assist.bandwidth"), leadLag: one("assist.functions.lead_lag.gain"),
      first: filter("assist.functions.lead_lag.lag"), second: filter("assist.functions.lead_lag.lead"),
      inertia: list(`${inertia}.gain`), derivative: filter(`${inertia}.derivative`),
    };
  }

  /** @typedef {ReturnType<typeof read>} Loop */

  /** Column and motor over a time [s] at a constant command, which the last column takes. @param {Loop} p
      @param {number} time */
  function discrete(p, time) {
    return exponential([
      [0, -1, 0, 0],
      [p.K / p.I2, (-p.C_tb - p.C2) / p.I2, 1 / p.I2, 0],
      [0, 0, -p.bandwidth, p.bandwidth],
      [0, 0, 0, 0],
    ].map((row) => row.map((v) => v * time)));
  }

  /** A value by speed. @param {ArrayLike<number>} values @param {[number, number] | number[]} at */
  const between = (values, [i, u]) => values[i] + u * (values[i + 1] - values[i]);

  /** The matrix that takes the states of the loop one sample further, as closed_loop. @param {Loop} p
      @param {number} speed [m/s] @param {number} slope of the boost curve [1] @param {Matrix[]} steps */
  function closedLoop(p, speed, slope, steps) {
    const n = 3 + p.delay + 5, Z = identity(n), at = bracket(p.speeds, speed);
    /** @param {[number, number[]][]} terms */
    const sum = (...terms) => Z[0].map((_, j) => terms.reduce((total, [factor, row]) => total + factor * row[j], 0));
    const queue = Z.slice(3, 4 + p.delay), x = Z.slice(4 + p.delay), twist = sum([p.K, Z[TWIST]]), turning = Z[SPEED];
    /** @param {number[]} filter @param {number[]} state @param {number[]} u */
    const filtered = ([b0, b1, a1], state, u) => {
      const y = sum([b0, u], [1, state]);
      return [y, sum([b1, u], [-a1, y])];
    };
    const [boosted, lead] = filtered(p.lead, x[0], sum([slope, twist]));
    const [lagging, lag] = filtered(p.first, x[1], twist), [shifted, second] = filtered(p.second, x[2], lagging);
    const [accelerated, derivative] = filtered(p.derivative, x[3], turning);
    const command = sum([1, boosted], [-between(p.damping, at), turning], [p.leadLag, shifted],
      [between(p.inertia, at), accelerated]);
    const commands = [command, ...queue];
    let state = Z.slice(0, 3);
    [queue[queue.length - 1], commands[p.delay]].forEach((acting, k) => {
      const step = steps[k];
      state = [TWIST, SPEED, MOTOR].map((i) =>
        sum([step[i][0], state[0]], [step[i][1], state[1]], [step[i][2], state[2]], [step[i][3], acting]));
    });
    return [...state, ...commands.slice(0, -1), lead, lag, second, derivative];
  }

  /** @param {Loop} p @param {number} speed [m/s] */
  function stable(p, speed) {
    const steps = [p.offset, SAMPLE - p.offset].map((time) => discrete(p, time)), at = bracket(p.speeds, speed);
    const boost = Array.from(p.torques, (_, j) => between(
      Array.from(p.speeds, (_, i) => p.boost[i * p.torques.length + j]), at));
    const slopes = boost.slice(1).map((v, j) => (v - boost[j]) / (p.torques[j + 1] - p.torques[j]));
    return slopes.every((slope) => radius(closedLoop(p, speed, slope, steps)) <= 1 + ROUNDING);
  }

  /** The largest factor up to which a condition holds that holds at 0 and not at 1. @param {(f: number) => boolean} holds */
  function largest(holds) {
    let low = 0, high = 1;
    for (let k = 0; k < HALVINGS; k++) {
      const middle = (low + high) / 2;
      if (holds(middle)) low = middle;
      else high = middle;
    }
    return low;
  }

  /** Rounded towards 0 to three digits. @param {number} value */
  function threeDigits(value) {
    const step = 10 ** (Math.floor(Math.log10(value)) - 2);
    return String(Number((Math.trunc(value / step) * step).toPrecision(3)));
  }

  /** Why the loop is unstable and what helps, in Python's words where no function of the assist is to blame; empty where
      it is stable. @param {Places} places @param {Float64Array} numbers @param {number} speed [m/s] */
  function reason(places, numbers, speed) {
    const p = read(places, numbers);
    if (stable(p, speed)) return "";
    const text = `the assist loop is unstable at ${Number((3.6 * speed).toPrecision(4))} km/h with the handwheel held`;
    const bare = { ...p, leadLag: 0, inertia: p.inertia.map(() => 0) };
    if (stable(bare, speed)) {
      return `${text}: inertia_compensation or lead_lag_gain is too large`;
    }
    const softer = (/** @type {number} */ f) => f === 0 || stable({ ...bare, K: f * p.K }, speed);
    const flatter = (/** @type {number} */ f) => stable({ ...bare, boost: p.boost.map((v) => f * v) }, speed);
    const ways = `K_tb ${threeDigits(largest(softer) * p.K)}` +
      (flatter(0) ? `, or with ${threeDigits(largest(flatter))} times the boost` : "");
    return `${text}: K_tb ${Number(p.K.toPrecision(6))} N m/rad is too stiff for this assist; it is stable with ${ways}`;
  }

  return { reason };
}
