/* What the page loads: scripts that hand over modules and tables, which zlib has packed, and whether a browser can. */

"use strict";

// A module with one instruction of vectors, by which a browser tells whether it knows them.
const STEER_VECTORS = [0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15,
  253, 98, 11];

/** What keeps this browser from running the page, in a sentence; empty if nothing does. */
function steerLacking() {
  const { damaged } = document.documentElement.dataset;
  if (damaged) return damaged;
  if (typeof WebAssembly !== "object" || !WebAssembly.validate(new Uint8Array(STEER_VECTORS))) {
    return "This page runs the car as WebAssembly with vectors (SIMD), which this browser lacks: take Chromium 91, " +
      "Firefox 113 or Safari 16.4, or a newer one.";
  }
  if (typeof DecompressionStream !== "function" || typeof Worker !== "function") {
    return "This page needs DecompressionStream and workers, which this browser lacks: take Chromium 91, Firefox 113 " +
      "or Safari 16.4, or a newer one.";
  }
  return "";
}

/** Bytes of a text in base64 that zlib has packed. @param {string} text */
async function steerUnpacked(text) {
  try {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  } catch {
    throw new Error("A file of modules, or tables.js, is damaged: write the folder anew.");
  }
}

/** Scripts that hand over data call these; each is set while its file loads. */
/** @type {(data: any) => void} */
let steerModule = () => {};
/** @type {(data: any) => void} */
let steerTables = () => {};

/** @param {string} file */
function steerScript(file) {
  return new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = file;
    script.onload = resolve;
    script.onerror = () => reject(new Error(`${file} could not be loaded: is the folder complete?`));
    document.head.append(script);
  });
}

/** Loads one after the other, as a script tells only what it hands over, not to whom. @param {any} declared */
function steerLoading(declared) {
  /** @type {Promise<any>} */
  let last = Promise.resolve();
  /** @type {Map<string, Promise<any>>} */
  const asked = new Map();

  /** What a script hands over, asked for once. @param {string} file @returns {Promise<any>} */
  function handed(file) {
    if (!asked.has(file)) {
      const found = last.then(async () => {
        /** @type {any} */
        let data = null;
        steerModule = steerTables = (given) => { data = given; };
        await steerScript(file);
        if (data === null) throw new Error(`${file} is damaged: write the folder anew.`);
        return data;
      });
      asked.set(file, found);
      last = found.catch(() => asked.delete(file));
    }
    return /** @type {Promise<any>} */ (asked.get(file));
  }

  /** Tables of a module, which name those that all modules share. @param {(string | number[])[]} lists */
  async function joined(lists) {
    const shared = await handed("tables.js");
    const found = await Promise.all(lists.map(async (each) => typeof each === "string"
      ? new Float64Array((await steerUnpacked(shared[each])).buffer) : Float64Array.from(each)));
    const tables = new Float64Array(found.reduce((size, list) => size + list.length, 0));
    let at = 0;
    for (const list of found) {
      tables.set(list, at);
      at += list.length;
    }
    return tables;
  }

  /** A law on a chassis: its structure, and its modules and tables for the worker. @param {string} law
      @param {string} chassis */
  async function module(law, chassis) {
    const data = await handed(declared.modules[`${law} ${chassis}`]);
    const begun = await handed(declared.beginnings[chassis]);
    const [wasm, beginning] = await Promise.all([data.wasm, begun].map(steerUnpacked));
    return { structure: data.structure, wasm, beginning, tables: await joined(data.tables) };
  }

  /** A policy for the worker, with its weights, and the paths of the courses by their names if it follows one; policy.js
      says what they are. @param {string} file of declared.policies */
  async function policy(file) {
    const data = await handed(file);
    const bytes = async (/** @type {string} */ text) => (await steerUnpacked(text)).buffer;
    const courses = await Promise.all(Object.entries(data.courses).map(async ([name, text]) =>
      [name, new Float64Array(await bytes(text))]));
    return { data, weights: new Float32Array(await bytes(data.weights)), courses: Object.fromEntries(courses) };
  }

  /** What gives the structure of a law on a chassis, which a worker then has too. @param {Worker} worker
      @param {Map<string, any>} structures those that it has, by law and chassis */
  const into = (worker, structures) => async (/** @type {string} */ law, /** @type {string} */ chassis) => {
    const key = `${law} ${chassis}`;
    if (!structures.has(key)) {
      const found = await module(law, chassis);
      worker.postMessage({ module: found });
      structures.set(key, found.structure);
    }
    return structures.get(key);
  };

  return Object.assign(module, { policy, into });
}
