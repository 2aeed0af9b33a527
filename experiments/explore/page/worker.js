/* The worker of the page: it keeps an instance for each module, and answers with a weave and its metrics.

   It is made of a Blob with the text of the functions of this folder, as a page that is opened from disk may not load
   the file of a worker. Messages: {module} adds a module, {run} asks for a weave, and {stop} leaves a whole weave that
   is under way and is not kept, since the values have changed. Answers come in the order of the runs. */

"use strict";

/** @typedef {Uint8Array<ArrayBuffer>} Wasm */
/** @typedef {{structure: any, wasm: Wasm, beginning: Wasm, tables: Float64Array}} ModuleMessage */
/** @typedef {{id: number, key: string, values: Record<string, number>, amplitude: number, exact: boolean,
 *             kept: boolean, whole: boolean}} RunMessage `whole`: with every sample in the answer */

/** @param {any} scope @param {any} settings @param {any} simulation @param {any} metrics @param {any} stability */
function steerWorker(scope, settings, simulation, metrics, stability) {
  const cars = new Map(), channel = new MessageChannel();
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
    const car = cars.get(run.key), { weave } = settings;
    stopped = false;
    const numbers = simulation.packed(car.structure, run.values);
    const amplitude = run.exact
      ? await done(simulation.findAmplitude(car, numbers, weave, run.amplitude), run) : run.amplitude;
    const cycles = run.exact ? weave.cycles : weave.movingCycles;
    const channels = Number.isFinite(amplitude)
      ? await done(simulation.drive(car, numbers, weave, amplitude, cycles, weave.channels), run) : null;
    if (amplitude === undefined || channels === undefined) return { id: run.id, stopped };
    const unstable = stability.reason(car.structure.places, numbers, run.values[weave.speed] / 3.6);
    if (!channels) return { id: run.id, exact: run.exact, failed: true, unstable };
    const found = metrics.evaluate(channels, weave.frequency, run.exact ? weave.fewest : weave.movingFewest,
      settings.metrics, unstable);
    const size = Math.round(weave.rate / weave.frequency), from = channels.lateral_acceleration.length - 2 * size;
    const thin = unstable ? 1 : weave.thin;  // an unstable loop swings faster than the plots' samples show
    const shown = Object.fromEntries(Object.entries(channels).map(([name, values]) =>
      [name, thinned(/** @type {Float64Array} */ (values), from, from + size, thin)]));
    const reached = simulation.halfSpan(channels.lateral_acceleration);
    return {
      id: run.id, exact: run.exact, amplitude, next: (amplitude * weave.target) / reached, shown, thin,
      values: found.values, reasons: found.reasons, unstable, ...(run.whole ? { channels } : {}),
    };
  }

  /** One closed cycle at every so many samples. @param {Float64Array} values @param {number} from @param {number} to
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
