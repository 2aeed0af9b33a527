/* Whether the assist loop is stable with the handwheel held or free: a port of steer_env.vehicle.steering.linear and stability,
   by which Python refuses a drive with a loop that is not. */

"use strict";

/** @typedef {Record<string, [number, number]>} Places of packed numbers, by name */

/** @param {Record<string, number>} constants of both Python modules
    @param {Record<string, [string, string, string]>} functions of the assist that may be too strong: key of their
    strength, its unit, and what else helps */
function steerStability(constants, functions) {
  const { SAMPLE_TIME: SAMPLE, ROUNDING, SLOWEST, TWIST, COLUMN_SPEED, HANDWHEEL_SPEED, HANDWHEEL_ANGLE } = constants;
  const HALVINGS = 20;

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

  /** Eigenvalues, real and imaginary part: elimination to Hessenberg's form, then QR steps with two shifts at once
      (Martin, Peters, Wilkinson, Numer. Math. 14 (1970) 219). @param {Matrix} given @returns {[number, number][]} */
  function eigenvalues(given) {
    const a = given.map((row) => [...row]), n = a.length;
    for (let m = 1; m < n - 1; m++) {
      let pivot = m;
      for (let j = m; j < n; j++) if (Math.abs(a[j][m - 1]) > Math.abs(a[pivot][m - 1])) pivot = j;
      if (a[pivot][m - 1] === 0) continue;
      [a[m], a[pivot]] = [a[pivot], a[m]];
      for (const row of a) [row[m], row[pivot]] = [row[pivot], row[m]];
      for (let i = m + 1; i < n; i++) {
        const y = a[i][m - 1] / a[m][m - 1];
        if (y === 0) continue;
        for (let j = m - 1; j < n; j++) a[i][j] -= y * a[m][j];
        for (const row of a) row[m] += y * row[i];
      }
    }
    /** @type {[number, number][]} */
    const found = [];
    const norm = size(a), small = (/** @type {number} */ l) =>
      Math.abs(a[l][l - 1]) <= 2 ** -52 * (Math.abs(a[l][l]) + Math.abs(a[l - 1][l - 1]) || norm);
    for (let end = n - 1, round = 0, shift = 0; end >= 0;) {
      let low = end;
      while (low > 0 && !small(low)) low--;
      let x = a[end][end];
      if (low === end) {
        found.push([x + shift, 0]);
        end--;
        round = 0;
        continue;
      }
      let y = a[end - 1][end - 1], w = a[end][end - 1] * a[end - 1][end];
      if (low === end - 1) {
        const p = 0.5 * (y - x), q = p * p + w, z = Math.sqrt(Math.abs(q));
        if (q >= 0) {
          const far = p + (p >= 0 ? z : -z);
          found.push([x + shift + far, 0], [x + shift - (far ? w / far : 0), 0]);
        } else found.push([x + shift + p, z], [x + shift + p, -z]);
        end -= 2;
        round = 0;
        continue;
      }
      if (round > 0 && round % 10 === 0) {  // another shift where it goes in circles
        shift += x;
        for (let i = 0; i <= end; i++) a[i][i] -= x;
        const s = Math.abs(a[end][end - 1]) + Math.abs(a[end - 1][end - 2]);
        [x, y, w] = [0.75 * s, 0.75 * s, -0.4375 * s * s];
      }
      if (round++ > 60) throw new Error("the eigenvalues of the assist loop were not found");
      let m = end - 2, p = 0, q = 0, r = 0;
      for (; m >= low; m--) {
        const z = a[m][m], u = x - z, v = y - z;
        p = (u * v - w) / a[m + 1][m] + a[m][m + 1];
        q = a[m + 1][m + 1] - z - u - v;
        r = a[m + 2][m + 1];
        const s = Math.abs(p) + Math.abs(q) + Math.abs(r);
        [p, q, r] = [p / s, q / s, r / s];
        if (m === low) break;
        const beside = Math.abs(a[m - 1][m - 1]) + Math.abs(z) + Math.abs(a[m + 1][m + 1]);
        if (Math.abs(a[m][m - 1]) * (Math.abs(q) + Math.abs(r)) <= 2 ** -52 * Math.abs(p) * beside) break;
      }
      for (let i = m + 2; i <= end; i++) {
        a[i][i - 2] = 0;
        if (i > m + 2) a[i][i - 3] = 0;
      }
      for (let k = m; k < end; k++) {
        const last = k === end - 1;
        if (k > m) {
          [p, q, r] = [a[k][k - 1], a[k + 1][k - 1], last ? 0 : a[k + 2][k - 1]];
          x = Math.abs(p) + Math.abs(q) + Math.abs(r);
          if (x) [p, q, r] = [p / x, q / x, r / x];
        }
        const s = (p >= 0 ? 1 : -1) * Math.hypot(p, q, r);
        if (s === 0) continue;
        if (k > m) a[k][k - 1] = -s * x;
        else if (low !== m) a[k][k - 1] = -a[k][k - 1];
        p += s;
        x = p / s;
        y = q / s;
        const z = r / s;
        q /= p;
        r /= p;
        for (let j = k; j <= end; j++) {
          p = a[k][j] + q * a[k + 1][j] + (last ? 0 : r * a[k + 2][j]);
          if (!last) a[k + 2][j] -= p * z;
          a[k + 1][j] -= p * y;
          a[k][j] -= p * x;
        }
        for (let i = low; i <= Math.min(end, k + 3); i++) {
          p = x * a[i][k] + y * a[i][k + 1] + (last ? 0 : z * a[i][k + 2]);
          if (!last) a[i][k + 2] -= p * r;
          a[i][k + 1] -= p * q;
          a[i][k] -= p;
        }
      }
    }
    return found;
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
    const own = "assist.functions", column = (/** @type {string} */ key) => one(`column.${key}`);
    return {
      I1: column("I1") + column("I_arm"), I2: column("I2"), K: column("K_tb"), C_tb: column("C_tb"),
      C1: column("C1") + column("C_arm"), C2: column("C2"), K_arm: column("K_arm"),
      speeds: list("assist.speeds"), torques: list("assist.torques"), boost: list("assist.boost"),
      damping: list("assist.damping"), lead: ["lead_b0", "lead_b1", "lead_a1"].map((key) => one(`assist.${key}`)),
      delay: one("assist.delay"), offset: one("assist.offset"), bandwidth: one("assist.bandwidth"),
      first: filter(`${own}.lead_lag.lag`), second: filter(`${own}.lead_lag.lead`),
      derivative: filter(`${own}.inertia_compensation.derivative`),
      returnLead: one(`${own}.active_return.lead`), halfSpeed: one(`${own}.active_return.half_speed`),
      gains: Object.fromEntries(Object.keys(functions).map((name) => [name, Array.from(list(`${own}.${name}.gain`))])),
    };
  }

  /** @typedef {ReturnType<typeof read>} Loop */

  /** Column and motor over a time [s] at a constant command, which the last column takes; with a free handwheel its speed
      and angle are states too. @param {Loop} p @param {number} time @param {boolean} free */
  function discrete(p, time, free) {
    const held = [
      [0, -1, 0, 1, 0, 0],
      [p.K / p.I2, (-p.C_tb - p.C2) / p.I2, 1 / p.I2, p.C_tb / p.I2, 0, 0],
      [0, 0, -p.bandwidth, 0, 0, p.bandwidth],
      [-p.K / p.I1, p.C_tb / p.I1, 0, (-p.C_tb - p.C1) / p.I1, -p.K_arm / p.I1, 0],
      [0, 0, 0, 1, 0, 0],
      [0, 0, 0, 0, 0, 0],
    ];
    const kept = free ? [0, 1, 2, 3, 4, 5] : [0, 1, 2, 5];
    return exponential(kept.map((i) => kept.map((j) => held[i][j] * time)));
  }

  /** A value by speed. @param {ArrayLike<number>} values @param {[number, number] | number[]} at */
  const between = (values, [i, u]) => values[i] + u * (values[i + 1] - values[i]);

  /** The matrix that takes the states of the loop one sample further, as closed_loop. @param {Loop} p
      @param {number} speed [m/s] @param {number} slope of the boost curve [1] @param {Matrix[]} steps
      @param {boolean} free */
  function closedLoop(p, speed, slope, steps, free) {
    const n = free ? 5 : 3, Z = identity(n + p.delay + 5), at = bracket(p.speeds, speed);
    /** @param {[number, number[]][]} terms */
    const sum = (...terms) => Z[0].map((_, j) => terms.reduce((total, [factor, row]) => total + factor * row[j], 0));
    const queue = Z.slice(n, n + 1 + p.delay), x = Z.slice(n + 1 + p.delay);
    const twist = sum([p.K, Z[TWIST]]), turning = Z[COLUMN_SPEED];
    /** @param {number[]} filter @param {number[]} state @param {number[]} u */
    const filtered = ([b0, b1, a1], state, u) => {
      const y = sum([b0, u], [1, state]);
      return [y, sum([b1, u], [-a1, y])];
    };
    const [boosted, lead] = filtered(p.lead, x[0], sum([slope, twist]));
    const [lagging, lag] = filtered(p.first, x[1], twist), [shifted, second] = filtered(p.second, x[2], lagging);
    const [accelerated, derivative] = filtered(p.derivative, x[3], turning);
    let command = sum([1, boosted], [-between(p.damping, at), turning], [p.gains.lead_lag[0], shifted],
      [between(p.gains.inertia_compensation, at), accelerated]);
    if (free) {
      const stiffness = (between(p.gains.active_return, at) * speed) / (speed + p.halfSpeed);
      const damping = between(p.gains.damping, at) + stiffness * p.returnLead;
      command = sum([1, command], [-damping, Z[HANDWHEEL_SPEED]], [-stiffness, Z[HANDWHEEL_ANGLE]]);
    }
    const commands = [command, ...queue];
    let state = Z.slice(0, n);
    [queue[queue.length - 1], commands[p.delay]].forEach((acting, k) => {
      const all = [...state, acting];
      state = state.map((_, i) => sum(.../** @type {[number, number[]][]} */ (all.map((row, j) => [steps[k][i][j], row]))));
    });
    return [...state, ...commands.slice(0, -1), lead, lag, second, derivative];
  }

  /** Whether no oscillation above 3 Hz grows at any slope of the boost curve. @param {Loop} p @param {number} speed [m/s]
      @param {boolean} free */
  function stable(p, speed, free) {
    const steps = [p.offset, SAMPLE - p.offset].map((time) => discrete(p, time, free)), at = bracket(p.speeds, speed);
    const boost = Array.from(p.torques, (_, j) => between(
      Array.from(p.speeds, (_, i) => p.boost[i * p.torques.length + j]), at));
    const slopes = new Set(boost.slice(1).map((v, j) => (v - boost[j]) / (p.torques[j + 1] - p.torques[j])));
    return [...slopes].every((slope) => eigenvalues(closedLoop(p, speed, slope, steps, free)).every(([re, im]) =>
      Math.abs(Math.atan2(im, re)) <= 2 * Math.PI * SLOWEST * SAMPLE || Math.hypot(re, im) <= 1 + ROUNDING));
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
    if (value === 0) return "0";
    const step = 10 ** (Math.floor(Math.log10(Math.abs(value))) - 2);
    return String(Number((Math.trunc(value / step) * step).toPrecision(3)));
  }

  /** The loop with a factor on the strength of some functions. @param {Loop} p @param {string[]} names
      @param {number} factor */
  const scaled = (p, names, factor) => ({ ...p, gains: Object.fromEntries(Object.entries(p.gains).map(([name, gain]) =>
    [name, names.includes(name) ? gain.map((v) => factor * v) : gain])) });

  /** Reasons that were found; the friction law, for one, does not change them. @type {Map<string, string>} */
  const known = new Map();

  /** Why the loop is unstable and what helps, in Python's words; empty where it is stable. @param {Places} places
      @param {Float64Array} numbers @param {number} speed [m/s] @param {boolean} free whether the handwheel is */
  function reason(places, numbers, speed, free) {
    const p = read(places, numbers), key = JSON.stringify([p, speed, free]);
    if (known.size > 20) known.clear();
    if (!known.has(key)) known.set(key, found(p, speed, free));
    return /** @type {string} */ (known.get(key));
  }

  /** @param {Loop} p @param {number} speed [m/s] @param {boolean} free */
  function found(p, speed, free) {
    const calm = (/** @type {Loop} */ loop) => stable(loop, speed, free);
    if (calm(p)) return "";
    const text = `the assist loop is unstable at ${Number((3.6 * speed).toPrecision(4))} km/h ` +
      (free ? "with the hands off" : "with the handwheel held");
    const active = Object.keys(p.gains).filter((name) => p.gains[name].some(Boolean));
    const blamed = [...active.map((name) => [name]), active].find((names) => calm(scaled(p, names, 0)));
    if (blamed) {
      const factor = largest((f) => calm(scaled(p, blamed, f)));
      return `${text}: ${blamed.map((name) => {
        const [key, unit, more] = functions[name], gain = p.gains[name];
        const value = gain.length > 1 ? between(gain, bracket(p.speeds, speed)) : gain[0];
        return `assist.${key} is ${Number(value.toPrecision(4))}${unit}; it is stable with ${threeDigits(factor * value)}${more}`;
      }).join(", ")}`;
    }
    const bare = scaled(p, active, 0);
    const softer = (/** @type {number} */ f) => f === 0 || calm({ ...bare, K: f * p.K });
    const flatter = (/** @type {number} */ f) => calm({ ...bare, boost: p.boost.map((v) => f * v) });
    const ways = `K_tb ${threeDigits(largest(softer) * p.K)}` +
      (flatter(0) ? `, or with ${threeDigits(largest(flatter))} times the boost` : "");
    return `${text}: K_tb ${Number(p.K.toPrecision(6))} N m/rad is too stiff for this assist; it is stable with ${ways}`;
  }

  return { reason };
}
