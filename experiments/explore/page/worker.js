/* The worker of the page: it keeps an instance for each module, and answers with a drive and its metrics.

   It is made of a Blob with the text of the functions of this folder, as a page that is opened from disk may not load
   the file of a worker. Messages: {module} adds a module, {run} asks for a drive, and {stop} leaves a whole drive that
   is under way and is not kept, since the values have changed. Answers come in the order of the runs. */

"use strict";

/** @typedef {Uint8Array<ArrayBuffer>} Wasm */
/** @typedef {{structure: any, wasm: Wasm, beginning: Wasm, tables: Float64Array}} ModuleMessage */
/** @typedef {{id: number, key: string, manoeuvre: string, values: Record<string, number>, amplitude: number,
 *             exact: boolean, kept: boolean, whole: boolean}} RunMessage `whole`: with every sample in the answer */

/** What reads the metrics, by the names that manoeuvres give; a further kind is a script metrics_*.js and a word here. */
const STEER_READERS = {
  loops: steerLoops, release: steerRelease, steps: steerSteps, parking: steerParking, sweeps: steerSweeps,
};

/** @param {any} scope @param {any} declared what Python declares @param {any} simulation @param {any} metrics
    @param {Record<string, Reader>} readers @param {any} stability */
function steerWorker(scope, declared, simulation, metrics, readers, stability) {
  const ALWAYS = ["longitudinal_speed", "lateral_speed"];  // of the chassis that have them: whether the car spins
  const { drives, speed } = declared, cars = new Map(), channel = new MessageChannel();
  let stopped = false, last = Promise.resolve();

  /** Let messages come in. @returns {Promise<void>} */
  const breathe = () => new Promise((resolve) => {
    channel.port1.onmessage = () => resolve();
    channel.port2.postMessage(0);
  });

  /** The result of work in steps; undefined where it was stopped. @param {Generator} steps @param {RunMessage} run */
  async function done(steps, run) {
    for (;;) {
      const step = steps.next();
      if (step.done) return step.value;
      if (run.exact) await breathe();
      if (stopped && !run.kept) return undefined;
    }
  }

  /** @param {RunMessage} run */
  async function answer(run) {
    const car = cars.get(run.key), { structure } = car, manoeuvre = drives.manoeuvres[run.manoeuvre];
    stopped = false;
    const numbers = simulation.packed(structure, run.values), held = run.values[speed.name] * speed.unit;
    const amplitude = run.exact
      ? await done(simulation.findAmplitude(car, numbers, manoeuvre, run.amplitude), run)
      : simulation.prescribed(car, numbers, manoeuvre) ?? run.amplitude;
    const course = run.exact ? manoeuvre.whole : manoeuvre.moving;
    const own = structure.channels.filter((/** @type {string} */ name) => ALWAYS.includes(name));
    const names = [...new Set([...manoeuvre.channels, ...own])];
    const channels = Number.isFinite(amplitude)
      ? await done(simulation.drive(car, numbers, course, amplitude, names), run) : null;
    if (amplitude === undefined || channels === undefined) return { id: run.id, stopped };
    let refused = unstable(structure, numbers, manoeuvre, [held]);
    const base = { id: run.id, manoeuvre: run.manoeuvre, exact: run.exact };
    if (!channels) return { ...base, failed: true, refused };
    channels.vehicle_speed = channels.longitudinal_speed ?? new Float64Array(course.samples).fill(held);
    if (channels.longitudinal_speed && run.exact) {
      refused ||= unstable(structure, numbers, manoeuvre, reached(structure, numbers, channels.longitudinal_speed));
    }
    if (held && channels.lateral_speed.some((/** @type {number} */ v, /** @type {number} */ i) =>
      Math.abs(v) > channels.vehicle_speed[i])) refused ||= "the car spins";
    const found = metrics.evaluate(readers[manoeuvre.reader], channels, course, manoeuvre.metrics, refused);
    const [from, to] = section(manoeuvre, course);
    // An unstable loop swings faster than the plots' samples show.
    const thin = refused ? 1 : Math.max(Math.round((to - from) / manoeuvre.points), 1);
    const shown = Object.fromEntries(Object.entries(channels).map(([name, values]) =>
      [name, thinned(/** @type {Float64Array} */ (values), from, to, thin)]));
    shown.time = Array.from(shown.vehicle_speed, (_, i) => (manoeuvre.section ? from + 1 : 0) / drives.rate + (i * thin) / drives.rate);
    const ratio = manoeuvre.target === null ? 1
      : manoeuvre.target / simulation.reached(manoeuvre, channels.lateral_acceleration);
    const friction = simulation.characteristics(car, numbers, declared.characteristics);
    const { values, reasons } = found;
    const all = run.whole ? { channels } : {}, asked = run.exact && held > 0 && !run.whole;
    const response = asked ? await done(simulation.responses(car, numbers, declared.characteristics), run) : null;
    if (response === undefined) return { id: run.id, stopped };
    return { ...base, response, amplitude, next: amplitude * ratio, shown, values, reasons, refused, friction, ...all };
  }

  /** Why the assist loop is unstable at one of some speeds [m/s], with the hands as in the manoeuvre; empty where it is
      not. @param {any} structure @param {Float64Array} numbers @param {any} manoeuvre @param {number[]} speeds */
  function unstable(structure, numbers, manoeuvre, speeds) {
    for (const each of speeds) {
      for (const free of manoeuvre.free ? [false, true] : [false]) {
        const reason = stability.reason(structure.places, numbers, each, free);
        if (reason) return reason;
      }
    }
    return "";
  }

  /** The least and the largest size of the speeds of a drive, and those of the boost table between them. @param {any} structure
      @param {Float64Array} numbers @param {Float64Array} speeds [m/s] */
  function reached(structure, numbers, speeds) {
    const [low, high] = metrics.extremes(speeds.map(Math.abs)), [from, to] = structure.places["assist.speeds"];
    return [low, ...numbers.subarray(from, to).filter((v) => v > low && v < high), high];
  }

  /** First and last sample of what is drawn of a drive: its section, or the last cycle but one. @param {any} manoeuvre
      @param {Course} course */
  function section(manoeuvre, course) {
    if (!manoeuvre.section) {
      const size = Math.round(drives.rate / Number(course.frequency));
      return [course.samples - 2 * size, course.samples - size];
    }
    const [from, to] = manoeuvre.section;
    return [Math.round(from * drives.rate), Math.min(Math.round(to * drives.rate), course.samples - 1)];
  }

  /** Every so many samples, one. @param {Float64Array} values @param {number} from @param {number} to
      @param {number} step */
  function thinned(values, from, to, step) {
    const found = [];
    for (let i = from; i <= to; i += step) found.push(values[i]);
    return found;
  }

  scope.onmessage = (/** @type {MessageEvent} */ { data }) => {
    if (data.stop) {
      stopped = true;
    } else if (data.module) {
      const { structure, wasm, beginning, tables } = /** @type {ModuleMessage} */ (data.module);
      const begun = new simulation.Beginning(structure, new WebAssembly.Module(beginning), tables);
      const car = new simulation.Car(structure, new WebAssembly.Module(wasm), begun, tables);
      cars.set(`${structure.law} ${structure.chassis}`, car);
    } else {
      const answered = () => answer(data.run).catch((error) => ({ error: error.message }));
      last = last.then(async () => scope.postMessage(await answered()));
    }
  };
}
