/* A trained policy of steer-env that drives or assists: its observations, its network and its guard, as in Python.

   The page loads {data, weights, courses} with policy(file) of loading.js, for a file that declared.policies lists, and
   hands them to its worker. There, before every sample of 1 ms:

     const pilot = new policies.Policy(data, weights, names, values);
     if (data.follows) pilot.follow(courses["double-lane-change"], [x, y, yaw]);   // where the course begins
     ...
     given[data.given] = pilot.torque(speed, inertia);    // [N m]; add to it what else acts at that place of the inputs

   `values` is an array that always holds the present channels with these `names`, `speed` the car's forward speed: a
   channel where the chassis reports it, else the speed that it holds; `inertia` is the number column.I1 of the plant.

   A "driver" gives the torque of hands. It acts where the number `robot` of the plant is 0, and was trained without the
   arms of a driver model on the handwheel. An "assist" adds its torque to that of the boost, and does not replace it;
   the hands are whoever drives. Either sees the channels as they are: no noise, no delay, no lag of its action. It
   decides every `data.samples` milliseconds; an assist holds its torque in between, and hands go on a straight line. */

"use strict";

/** @typedef {{name: string, bound: number, scale: number, mean: number, deviation: number}} Observed */
/** @typedef {{dt: number, hands: number, corner: number, gripKept: number, motionKept: number, caution: number,
 *             above: number, grip: number, slow: number, halfSpeed: number}} GuardNumbers */
/** @typedef {{id: string, role: "driver" | "assist", observed: Observed[], follows: boolean, clip: number,
 *             path: {names: string[], spacing: number, step: number}, layers: [number, number][], given: number,
 *             torque: number, ramped: boolean, samples: number, guard: GuardNumbers | null}} PolicyData */

function steerPolicies() {
  /** @param {number} x @param {number} low @param {number} high */
  const within = (x, low, high) => Math.min(Math.max(x, low), high);

  /** Where a car is relative to a path, and the path ahead relative to it: locate of steer_env.courses.path.
      @param {Float64Array} path rows of x, y [m], direction [rad] and curvature [1/m], evenly spaced
      @param {number} spacing of the rows [m] @param {number} x @param {number} y @param {number} yaw
      @param {number} guess arc length at which the search starts [m] @param {number} step between the points ahead [m]
      @param {Float64Array} out lateral offset [m], heading error [rad], lateral positions of the points ahead [m]
      @returns {number} arc length of the nearest point [m] */
  function locate(path, spacing, x, y, yaw, guess, step, out) {
    const last = path.length / 4 - 1;
    let i = within(Math.trunc(guess / spacing), 0, last), along = 0, back = false;
    for (let n = 0; n <= last; n++) {
      const c = Math.cos(path[4 * i + 2]), s = Math.sin(path[4 * i + 2]);
      along = (x - path[4 * i]) * c + (y - path[4 * i + 1]) * s;
      // Outside a curve a car may be beyond the metre of one point and before the next: it is between them.
      if (along >= spacing && i < last && !back) {
        i++;
      } else if (along < 0 && i > 0) {
        i--;
        back = true;
      } else {
        break;
      }
    }
    const [px, py, direction, k] = path.subarray(4 * i), part = within(along, 0, spacing);
    const across = (y - py) * Math.cos(direction) - (x - px) * Math.sin(direction);
    out[0] = across - 0.5 * k * part * part;
    const error = yaw - direction - k * part;
    out[1] = error - 2 * Math.PI * Math.floor(error / (2 * Math.PI) + 0.5);
    const position = spacing * i + along;
    for (let j = 2; j < out.length; j++) {
      // After the last point the path continues straight.
      const ahead = Math.max(position + (j - 1) * step, 0), n = within(Math.trunc(ahead / spacing), 0, last);
      const on = ahead - spacing * n, [nx, ny, yawThere, curvature] = path.subarray(4 * n);
      const left = 0.5 * (n < last ? curvature : 0) * on * on, c = Math.cos(yawThere), s = Math.sin(yawThere);
      const toX = nx + on * c - left * s - x, toY = ny + on * s + left * c - y;
      out[j] = toY * Math.cos(yaw) - toX * Math.sin(yaw);
    }
    return position;
  }

  /** The mean action of a network with hyperbolic tangents in between, within -1 and 1.
      @param {[number, number][]} layers sizes of the outputs and inputs of each layer
      @param {Float32Array} weights of each layer, row by row, and its biases @param {ArrayLike<number>} seen */
  function forward(layers, weights, seen) {
    let x = seen, at = 0;
    layers.forEach(([rows, columns], k) => {
      const y = new Float64Array(rows), biases = at + rows * columns;
      for (let i = 0; i < rows; i++) {
        let sum = weights[biases + i];
        for (let j = 0; j < columns; j++) sum += weights[at + i * columns + j] * x[j];
        y[i] = k < layers.length - 1 ? Math.tanh(sum) : sum;
      }
      x = y;
      at = biases + rows;
    });
    return within(x[0], -1, 1);
  }

  /** Fades an assist without hands and in quick steering: steer_env.assists.common.reference_feel says why and how. */
  class Guard {
    /** @param {GuardNumbers} of @param {number} speed of the handwheel [rad/s] */
    constructor(of, speed) {
      this.of = of;
      this.speed = speed;
      this.hands = [0, 0];
      this.low = [0, 0];
      this.high = [0, 0, 0, 0];
      this.grip = this.slow = this.fast = 0;
    }

    /** The share of the action that acts, once a decision. @param {number} torque of the torsion bar [N m]
        @param {number} speed of the handwheel [rad/s] @param {number} v of the car [m/s]
        @param {number} inertia of the handwheel [kg m2] */
    share(torque, speed, v, inertia) {
      const { of } = this;
      let value = torque + (inertia * (speed - this.speed)) / of.dt, slow = speed, quick = speed;
      this.speed = speed;
      this.hands = this.hands.map((held) => (value = held + of.hands * (value - held)));
      this.grip = Math.max(Math.abs(value) - of.above, of.gripKept * this.grip);
      this.low = this.low.map((held) => (slow = held + of.corner * (slow - held)));
      this.high = this.high.map((held) => {
        const now = held + of.corner * (quick - held);
        quick -= now;
        return now;
      });
      this.slow = Math.max(Math.abs(slow), of.motionKept * this.slow);
      this.fast = Math.max(Math.abs(quick), of.motionKept * this.fast);
      const held = this.grip ** 2, calm = this.slow ** 2 + of.slow ** 2;
      const disturbed = (of.caution * this.fast ** 2 * v * v) / (v * v + of.halfSpeed ** 2);
      return ((held / (held + of.grip ** 2)) * calm) / (calm + disturbed);
    }
  }

  /** A policy in a drive, from the present state on. */
  class Policy {
    /** @param {PolicyData} data @param {Float32Array} weights @param {string[]} names of channels
        @param {Float64Array} values of these channels, now and whenever it is asked later */
    constructor(data, weights, names, values) {
      this.data = data;
      this.weights = weights;
      this.values = values;
      this.pose = ["x", "y", "yaw_angle"].map((name) => names.indexOf(name));
      this.places = data.observed.map(({ name }) => names.indexOf(name));
      /** @type {Float64Array | null} */
      this.path = null;
      this.origin = [0, 0, 0];  // where the path's x = y = 0 is [m], and its direction there [rad]
      this.nearest = 0;  // arc length of the car on it [m]
      this.ahead = new Float64Array(data.path.names.length);
      this.sample = this.action = this.lastAction = 0;
      /** @type {Guard | null} */
      this.guard = null;
    }

    /** Follow a path; before its first and after its last row it goes on straight ahead.
        @param {Float64Array} path rows of x, y [m], direction [rad] and curvature [1/m]
        @param {number[]} origin x, y [m] of its zero and direction [rad] of its x axis, in the frame of the channels */
    follow(path, origin) {
      this.path = path;
      this.origin = origin;
      this.nearest = 0;
    }

    /** What it observes now [SI]. @param {number} speed of the car [m/s] */
    observations(speed) {
      const { id, observed, follows, path: { names, spacing, step } } = this.data;
      if (follows) {
        if (!this.path) throw new Error(`${id} follows a path, and there is none`);
        const [x, y, yaw] = this.pose.map((place, k) => this.values[place] - this.origin[k]);
        const c = Math.cos(this.origin[2]), s = Math.sin(this.origin[2]);
        this.nearest =
          locate(this.path, spacing, c * x + s * y, c * y - s * x, yaw, this.nearest, step * speed, this.ahead);
      }
      return observed.map(({ name, bound }, k) => {
        const value = name === "speed" ? speed : name === "last_action" ? this.action
          : this.places[k] >= 0 ? this.values[this.places[k]] : this.ahead[names.indexOf(name)];
        return Number.isNaN(value) ? 0 : within(value, -bound, bound);
      });
    }

    /** The action from -1 to 1 for observations [SI]. @param {number[]} observations
        @param {number} inertia of the handwheel [kg m2] */
    decision(observations, inertia) {
      const { observed, clip, layers, guard } = this.data;
      const scaled = observations.map((value, k) => Math.fround(value / observed[k].scale));  // Python's are 32 bits
      const seen = scaled.map((value, k) =>
        Math.fround(within((value - observed[k].mean) / observed[k].deviation, -clip, clip)));
      const action = Math.fround(forward(layers, this.weights, seen));
      if (!guard) return action;
      const [torque, turning, speed] = ["torsion_bar_torque", "handwheel_speed", "speed"].map((wanted) => {
        const k = observed.findIndex(({ name }) => name === wanted);
        return scaled[k] * observed[k].scale;
      });
      this.guard ??= new Guard(guard, turning);
      return Math.fround(action * this.guard.share(torque, turning, speed, inertia));
    }

    /** The torque for the coming sample of 1 ms [N m]; to be called once before each. @param {number} speed of the car,
        forward [m/s] @param {number} inertia of the handwheel [kg m2] */
    torque(speed, inertia) {
      const { samples, ramped, torque } = this.data, passed = this.sample++ % samples;
      if (passed === 0) {
        [this.lastAction, this.action] = [this.action, this.decision(this.observations(speed), inertia)];
      }
      const share = ramped ? (passed + 1) / samples : 1;
      return torque * (this.lastAction + share * (this.action - this.lastAction));
    }
  }

  return { forward, Policy };
}
