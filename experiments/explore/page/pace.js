/* The worker of a drive: it steps the car at 1 kHz by the clock, and hands on every sample.

   At each turn it does the samples that are due, so that none is left out. Where it comes so late that a person would
   feel a halt, or is asked to, it stands still until it is told to go on, and the next sample tells how many deadlines
   were missed meanwhile, as a recording of steer-env drive does.

   Messages: {module} adds a module, {configuration} a car, {begin} starts the road anew with a configuration, {hands}
   tells what is held of the device, {drag} a motion of it, {hold} whether the wheel is held, {choose} a configuration,
   {target} a held speed, {pilot} lets a policy drive or assist, {course} tells where what it follows begins, {recentre},
   {stand} and {go}. */

"use strict";

/** @param {any} scope @param {any} declared @param {any} simulation @param {any} exchanging @param {any} handing
    @param {any} policies */
function steerPace(scope, declared, simulation, exchanging, handing, policies) {
  const { halt, period } = declared.pace, STEP = 1e3 * declared.sampleTime;
  const { own, inputs, channels } = declared.recording;
  const width = own.length + inputs.length + channels.length;
  const angleAt = channels.findIndex((/** @type {string[]} */ each) => each[0] === "handwheel_angle");
  const speedAt = channels.findIndex((/** @type {string[]} */ each) => each[0] === "handwheel_speed");
  /** @type {Map<string, any>} */
  const modules = new Map();
  /** @type {Map<string, any>} */
  const cars = new Map();
  const hands = new handing.Hands(), exchange = new exchanging.Exchange(carAt);
  const STRAIGHT = Float64Array.of(0, 0, 0, 0, 1, 0, 0, 0);
  /** Policies that act, by their roles. @type {Record<string, any>} */
  const pilots = {};
  let course = { name: "", origin: [0, 0, 0] };
  let start = 0, done = 0, stood = 0, missed = 0, stands = true, held = true, begun = 0, speed = 0, largest = 0;

  /** @param {string} key @param {number} place */
  function carAt(key, place) {
    const own = `${key} ${place}`;
    if (!cars.has(own)) {
      const { structure, wasm, begins, tables } = modules.get(key);
      cars.set(own, new simulation.Car(structure, wasm, begins, tables));
    }
    return cars.get(own);
  }

  /** Inputs by their places in what a car is given. */
  const others = () => inputs.map((/** @type {string} */ name) =>
    [exchange.car().structure.drive.inputs.indexOf(name), name === "target_speed" ? speed - begun : 0])
    .filter((/** @type {number[]} */ [place]) => place >= 0);

  /** Stand still. @param {string} why */
  function stand(why) {
    stands = true;
    stood = performance.now();
    scope.postMessage({ stands: why });
  }

  /** What a policy asks of the hands or of the assist now, 0 without one [N m]. @param {string} role */
  function asked(role) {
    const { structure, outputs, numbers } = exchange.car(), own = structure.channels.indexOf("longitudinal_speed");
    return pilots[role]?.torque(own < 0 ? speed : outputs[own], numbers[structure.places["column.I1"][0]]) ?? 0;
  }

  function follow() {
    const { driver } = pilots;
    if (driver?.data.follows) driver.follow(driver.courses[course.name] ?? STRAIGHT, course.origin);
  }

  /** Advance by one sample and write it; whether the car stays finite. @param {Float64Array} row */
  function sample(row) {
    const holds = held && !pilots.driver;  // a policy drives by torque
    if (holds !== exchange.hold && exchange.grip(holds) && holds) {
      hands.grip(exchange.shown[angleAt], exchange.shown[speedAt]);
    }
    const given = others(), driven = held && !exchange.hold, torque = driven ? asked("driver") : 0;
    given.push([exchange.car().structure.drive.inputs.indexOf("assist_request"), asked("assist")]);
    if (exchange.hold) hands.step();
    if (!exchange.sample({ torque, angle: hands.angle, speed: hands.speed, others: given })) return false;
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
    setTimeout(turn, period);
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
    pilot({ role, chosen }) {
      delete pilots[role];
      if (!chosen) return;
      const names = channels.map((/** @type {string[]} */ each) => each[0]);
      const { data, weights, courses } = chosen;
      pilots[role] = Object.assign(new policies.Policy(data, weights, names, exchange.shown), { courses });
      follow();
    },
    course(wanted) {
      course = wanted;
      follow();
    },
    recentre: () => hands.recentre(),
    stand: (why) => { if (!stands) stand(why); },
    go,
  };
  scope.onmessage = (/** @type {MessageEvent} */ { data }) => {
    for (const [name, given] of Object.entries(data)) obey[name](given);
  };
}
