/* The worker of the page: it keeps an instance for each module, and answers with a weave and its metrics.

   It is made of a Blob with the text of the functions of this folder, as a page that is opened from disk may not load
   the file of a worker. Messages: {module} adds a module, {run} asks for a weave. */

"use strict";

/** @typedef {{structure: any, wasm: Uint8Array<ArrayBuffer>, beginning: Uint8Array<ArrayBuffer>, tables: Float64Array}} ModuleMessage */
/** @typedef {{id: number, key: string, values: Record<string, number>, amplitude: number, exact: boolean}} RunMessage */

/** @param {any} scope @param {any} settings @param {any} simulation @param {any} metrics */
function steerWorker(scope, settings, simulation, metrics) {
  const cars = new Map();

  /** @param {RunMessage} run */
  function answer(run) {
    const car = cars.get(run.key), { weave } = settings, begun = scope.performance.now();
    const numbers = simulation.packed(car.structure, run.values);
    const amplitude = run.exact ? simulation.findAmplitude(car, numbers, weave, run.amplitude) : run.amplitude;
    const cycles = run.exact ? weave.cycles : weave.movingCycles;
    const channels = Number.isFinite(amplitude)
      ? simulation.drive(car, numbers, weave, amplitude, cycles, weave.channels) : null;
    if (!channels) return { id: run.id, exact: run.exact, amplitude: NaN, failed: true };
    const found = metrics.evaluate(channels, weave.frequency, run.exact ? weave.fewest : weave.movingFewest,
      settings.metrics);
    const size = Math.round(weave.rate / weave.frequency), from = channels.lateral_acceleration.length - 2 * size;
    const shown = Object.fromEntries(Object.entries(channels).map(([name, values]) =>
      [name, thinned(/** @type {Float64Array} */ (values), from, from + size, weave.thin)]));
    const reached = simulation.halfSpan(channels.lateral_acceleration);
    return {
      id: run.id, exact: run.exact, amplitude, next: (amplitude * weave.target) / reached, shown,
      values: found.values, reasons: found.reasons, took: scope.performance.now() - begun,
    };
  }

  /** One closed cycle at every so many samples. @param {Float64Array} values @param {number} from @param {number} to
      @param {number} step */
  function thinned(values, from, to, step) {
    const found = [];
    for (let i = from; i <= to; i += step) found.push(values[i]);
    return found;
  }

  scope.onmessage = (/** @type {MessageEvent} */ event) => {
    if (event.data.module) {
      const { structure, wasm, beginning, tables } = /** @type {ModuleMessage} */ (event.data.module);
      const begun = new simulation.Beginning(structure, new WebAssembly.Module(beginning), tables);
      const car = new simulation.Car(structure, new WebAssembly.Module(wasm), begun, tables);
      cars.set(`${structure.law} ${structure.chassis}`, car);
      return;
    }
    scope.postMessage(answer(event.data.run));
  };
}
