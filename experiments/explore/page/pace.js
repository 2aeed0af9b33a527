/* The worker of a drive: it steps the car at 1 kHz by the clock, and hands on every sample.

   At each turn it does the samples that are due, so that none is left out. Where it comes so late that a person would
   feel a halt, or is asked to, it stands still until it is told to go on, and the next sample tells how many deadlines
   were missed meanwhile, as a recording of steer-env drive does.

   Messages: {module} adds a module, {configuration} a car, {begin} starts the road anew with a configuration, {hands}
   tells what is held of the device, {drag} a motion of it, {hold} whether the wheel is held, {choose} a configuration,
   {target} a held speed, {policy} who drives or assists, {road} where it begins and its course, {recentre}, {stand} and
   {go}. */

"use strict";

/** @param {any} scope @param {any} declared @param {any} simulation @param {any} exchanging @param {any} handing
    @param {any} policies */
function steerPace(scope, declared, simulation, exchanging, handing, policies) {
  const { halt, period } = declared.pace, STEP = 1e3 * declared.sampleTime;
  const { own, inputs, channels } = declared.recording;
  const width = own.length + inputs.length + channels.length;
  const names = channels.map((/** @type {string[]} */ each) => each[0]);
  const [angleAt, speedAt, ...poseAt] = ["handwheel_angle", "handwheel_speed", "x", "y", "yaw_angle"]
    .map((name) => names.indexOf(name));
  const STRAIGHT = new Float64Array(4);  // a path of one point, behind which it goes on straight
  /** @type {Map<string, any>} */
  const modules = new Map();
  /** @type {Map<string, any>} */
  const cars = new Map();
  const hands = new handing.Hands(), exchange = new exchanging.Exchange(carAt);
  let start = 0, done = 0, stood = 0, missed = 0, stands = true, held = true, begun = 0, speed = 0, largest = 0, timer = 0;
  let road = { origin: [0, 0, 0], course: "plain" }, followed = -1;
  /** @type {any} */
  let policy = null;
  /** @type {any} */
  let pilot = null;

  /** @param {string} key @param {number} place */
  function carAt(key, place) {
    const own = `${key} ${place}`;
    if (!cars.has(own)) {
      const { structure, wasm, begins, tables } = modules.get(key);
      cars.set(own, new simulation.Car(structure, wasm, begins, tables));
    }
    return cars.get(own);
  }

  /** Inputs by their places in what a car is given. @param {any} car @param {number} assist torque [N m] */
  const others = (car, assist) => Object.entries({ target_speed: speed - begun, assist_request: assist })
    .map(([name, value]) => [car.structure.drive.inputs.indexOf(name), value]).filter(([place]) => place >= 0);

  /** Let the policy follow the course that is nearest, whose cones stand again and again along the road. */
  function follow() {
    const { first, gap, courses } = declared.road, { period } = courses[road.course], [x, y, yaw] = road.origin;
    const c = Math.cos(yaw), s = Math.sin(yaw), [nowX, nowY] = poseAt.map((place) => exchange.shown[place]);
    const along = c * (nowX - x) + s * (nowY - y);
    const number = Math.max(Math.floor((along - first + 0.5 * gap) / period), 0);
    if (number === followed) return;
    followed = number;
    const begins = first + number * period;
    pilot.follow(policy.courses[road.course] ?? STRAIGHT, [x + begins * c, y + begins * s, yaw]);
  }

  /** Torque of the policy for the coming sample [N m]. @param {any} car */
  function advice(car) {
    const { structure, outputs, numbers } = car, at = structure.channels.indexOf("longitudinal_speed");
    if (policy.data.follows) follow();
    return pilot.torque(at < 0 ? begun : outputs[at], numbers[structure.places["column.I1"][0]]);
  }

  /** Stand still. @param {string} why */
  function stand(why) {
    stands = true;
    stood = performance.now();
    scope.postMessage({ stands: why });
  }

  /** Advance by one sample and write it; whether the car stays finite. @param {Float64Array} row */
  function sample(row) {
    const driver = policy?.data.role === "driver", grips = held && !driver;
    if (grips !== exchange.hold && exchange.grip(grips) && grips) {
      hands.grip(exchange.shown[angleAt], exchange.shown[speedAt]);
    }
    const car = exchange.car(), torque = policy && (held || !driver) ? advice(car) : 0;
    if (exchange.hold) hands.step();
    if (!exchange.sample({
      torque: driver ? torque : 0, angle: hands.angle, speed: hands.speed, others: others(car, driver ? 0 : torque),
    })) return false;
    row.set([missed, exchange.acting + 1, exchange.share]);
    inputs.forEach((/** @type {string} */ name, /** @type {number} */ k) => {
      row[own.length + k] = name === "target_speed" ? speed - begun : 0;
    });
    row.set(exchange.shown, own.length + inputs.length);
    missed = 0;
    return true;
  }

  /** Do what is due. */
  function turn() {
    if (stands) return;
    clearTimeout(timer);  // of a drive that stood for less than a turn
    timer = setTimeout(turn, period);
    const behind = performance.now() - start - done * STEP, due = Math.floor(behind / STEP);
    if (behind > halt) {
      stand("slow");
      return;
    }
    largest = Math.max(largest, behind);
    if (due < 1) return;
    const samples = new Float64Array(due * width);
    for (let k = 0; k < due; k++) {
      if (!sample(samples.subarray(k * width, (k + 1) * width))) {
        stand("not finite");
        return;
      }
    }
    done += due;
    scope.postMessage({
      samples, largest, end: performance.timeOrigin + start + done * STEP, wanted: hands.wanted, hold: exchange.hold,
      dropped: exchange.dropped,
    }, [samples.buffer]);
  }

  function go() {
    if (!stands) return;
    const now = performance.now();
    if (stood) missed += Math.round((now - stood) / STEP);
    start = now - done * STEP;
    stands = false;
    turn();
  }

  /** @type {Record<string, (data: any) => void>} */
  const obey = {
    module({ structure, wasm, beginning, tables }) {
      const begins = new simulation.Beginning(structure, new WebAssembly.Module(beginning), tables);
      modules.set(`${structure.law} ${structure.chassis}`, { structure, wasm: new WebAssembly.Module(wasm), begins, tables });
    },
    configuration({ index, label, key, values }) {
      const numbers = simulation.packed(modules.get(key).structure, values);
      const [car] = [2, 0, 1].map((place) => carAt(key, place));  // the third is only to begin with
      car.begin(numbers);
      exchange.configurations[index] = { label, key, numbers, start: car.state.slice(), shown: car.outputs.slice() };
    },
    begin({ index, speed: made }) {
      begun = speed = made;
      done = missed = stood = largest = 0;
      start = performance.now();
      exchange.begin(index);
      hands.grip(0, 0);
    },
    hands: (given) => hands.take(given),
    drag: (pixels) => hands.drag(pixels),
    hold: (wanted) => { held = wanted; },
    choose: (index) => exchange.choose(index),
    target: (wanted) => { speed = wanted; },
    policy: (given) => {
      policy = given;
      pilot = given && new policies.Policy(given.data, given.weights, names, exchange.shown);
      followed = -1;
    },
    road: (given) => {
      road = given;
      followed = -1;
    },
    recentre: () => hands.recentre(),
    stand: (why) => { if (!stands) stand(why); },
    go,
  };
  scope.onmessage = (/** @type {MessageEvent} */ { data }) => {
    for (const [name, given] of Object.entries(data)) obey[name](given);
  };
}
