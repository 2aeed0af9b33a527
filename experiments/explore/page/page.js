/* The page: it loads what it needs, asks the worker for a weave at every change, and shows what comes back.

   While values change, the worker drives a short weave with an amplitude that follows from the run before, one at a
   time. Once they rest, the amplitude is found anew and the whole weave is driven, as Python drives it; where a value
   changes meanwhile, it is left. */

"use strict";

const REST = 250;  // time without a change after which the whole weave is driven [ms]
const FIRST = 0.2, MOST = 6;  // amplitude of the first weave, and the largest [rad]
const DEGREES = 180 / Math.PI;

/** What is shown, for tests and for the console. @type {any} */
const steerShown = { structures: new Map(), answer: null, pins: {}, recording: null };

/** @param {any} declared */
async function steerDeclared(declared) {
  const find = (/** @type {string} */ id) => /** @type {any} */ (document.getElementById(id));
  const status = find("status"), main = /** @type {HTMLElement} */ (document.querySelector("main"));
  const lacking = steerLacking();
  if (lacking) {
    status.textContent = lacking;
    status.classList.add("refusal");
    return;
  }
  const sentence = (/** @type {string} */ words) => `${words[0].toUpperCase()}${words.slice(1)}.`;
  const spaced = (/** @type {string} */ name) => name.replaceAll("_", " ");
  const address = steerAddress(), pictures = steerPictures();
  const table = steerTable(find("metrics"), declared.metrics, declared.noticed);
  const fields = steerFields(find("fields"), changed);
  const settings = { weave: declared.weave, metrics: declared.metrics };
  const text = [
    ...[steerMetrics, steerSimulation, steerStability, steerWorker].map(String),
    `const settings = ${JSON.stringify(settings)}, metrics = steerMetrics(${JSON.stringify(declared.loops)});`,
    "steerWorker(self, settings, steerSimulation(), metrics, steerStability());",
  ].join("\n");
  const worker = new Worker(URL.createObjectURL(new Blob([`"use strict";\n${text}`], { type: "text/javascript" })));

  const { structures, pins } = steerShown, load = steerLoading(declared);
  const known = { laws: declared.laws.map((/** @type {any} */ law) => law.name), chassis: declared.chassis };
  const start = address.read(location.hash.slice(1), { law: known.laws[0], chassis: known.chassis[0] }, known);
  let shown = start.shown;
  /** @type {any} */
  let latest = null;
  /** @type {{resolve: (answer: any) => void, reject: (error: Error) => void}[]} */
  const answered = [];
  let notice = "", amplitude = FIRST, runs = 0, wanted = false, busy = false, settling = false, rest = 0;

  /** Tell an error of work that runs on by itself. @param {Promise<any>} work */
  const told = (work) => work.catch((/** @type {Error} */ error) => {
    status.textContent = error.message;
    status.classList.add("refusal");
  });

  worker.onmessage = ({ data }) => {
    const { resolve, reject } = /** @type {any} */ (answered.shift());
    if (data.error) reject(new Error(`The car could not be run: ${data.error}`));
    else resolve(data);
  };
  worker.onerror = ({ message }) => told(Promise.reject(new Error(`The car could not be run: ${message}`)));

  /** The structure of a law on a chassis, which the worker then has too. @param {string} law @param {string} chassis */
  async function structure(law, chassis) {
    const key = `${law} ${chassis}`;
    if (!structures.has(key)) {
      const module = await load(law, chassis);
      worker.postMessage({ module });
      structures.set(key, module.structure);
    }
    return structures.get(key);
  }

  /** Every value of a car: those that were changed, and the car's own. @param {any} of */
  function values(of) {
    const { parameters } = structures.get(`${of.law} ${of.chassis}`);
    return Object.fromEntries(parameters.map((/** @type {Field} */ q) => [q.name, of.values[q.name] ?? q.value]));
  }

  /** @param {any} of @param {boolean} exact @param {boolean} kept whether nothing stops it
      @param {boolean} whole whether the answer has every sample @returns {Promise<any>} */
  function driven(of, exact, kept, whole = false) {
    return new Promise((resolve, reject) => {
      answered.push({ resolve, reject });
      const key = `${of.law} ${of.chassis}`;
      worker.postMessage({ run: { id: ++runs, key, values: values(of), amplitude, exact, kept, whole } });
    });
  }

  /** Drive what is shown now, in place of what is under way. */
  async function redraw() {
    wanted = true;
    clearTimeout(rest);
    if (settling) worker.postMessage({ stop: true });
    await update();
  }

  async function update() {
    if (busy) return;
    busy = true;
    try {
      while (wanted) {
        wanted = false;
        show(await driven(shown, false, true));
      }
    } finally {
      busy = false;
    }
    clearTimeout(rest);
    rest = setTimeout(() => told(settle()), REST);
  }

  async function settle() {
    if (busy) return;
    busy = settling = true;
    try {
      const answer = await driven(shown, true, false);
      if (!answer.stopped) show(answer);
    } finally {
      busy = settling = false;
    }
    if (wanted) await update();
    else remember();
  }

  /** Why a car cannot be driven. @param {any} answer */
  const why = (answer) => sentence(answer.unstable ||
    `no handwheel amplitude reaches ${declared.weave.target} m/s² with these values`);

  /** @param {any} answer */
  function show(answer) {
    main.dataset.exact = String(answer.exact);
    main.classList.toggle("stale", Boolean(answer.failed));
    if (answer.failed) {
      amplitude = FIRST;
      status.textContent = `${notice} ${why(answer)}${latest ? " The car before is shown." : ""}`.trim();
      status.classList.add("refusal");
      return;
    }
    status.textContent = answer.unstable
      ? `${notice} ${sentence(answer.unstable)} No metric is read from such a weave.`.trim() : notice;
    status.classList.toggle("refusal", answer.unstable !== "");
    if (answer.next > 0 && answer.next < MOST) amplitude = answer.exact ? answer.amplitude : answer.next;
    latest = answer;
    steerShown.answer = answer;
    draw();
  }

  const loops = [
    { draw: pictures.picture(find("torque-angle"), "handwheel angle [deg]", "hand torque [N m]", 0.68),
      x: "handwheel_angle", y: "handwheel_torque", scale: [DEGREES, 1] },
    { draw: pictures.picture(find("torque-acceleration"), "lateral acceleration [m/s²]", "hand torque [N m]", 0.68),
      x: "lateral_acceleration", y: "handwheel_torque", scale: [1, 1] },
  ];
  const histories = [
    { draw: pictures.picture(find("torque-time"), "time [s]", "hand torque [N m]", 0.5),
      y: "handwheel_torque", scale: 1 },
    { draw: pictures.picture(find("acceleration-time"), "time [s]", "acceleration [m/s²]", 0.5),
      y: "lateral_acceleration", scale: 1 },
    { draw: pictures.picture(find("rack-time"), "time [s]", "rack force [kN]", 0.5), y: "rack_force", scale: 1e-3 },
  ];

  const { evaluate } = steerMetrics(declared.loops), { weave } = declared;
  const recording = steerRecording(find("recording"), { ...declared.recording, rate: weave.rate },
    (channels) => evaluate(channels, weave.frequency, weave.fewest, declared.metrics), draw);
  steerShown.recording = recording;

  function draw() {
    if (!latest) return;
    const laid = recording.laid((latest.shown.handwheel_torque.length * latest.thin) / weave.rate);
    const over = (/** @type {any} */ of) => (of ? [{ of, colour: pictures.style("--recording"), wide: false }] : []);
    const colours = ["--pin-a", "--pin-b", "--pin-c"].map(pictures.style);
    const all = [
      ...Object.entries(pins).map(([name, pin]) =>
        ({ of: pin.answer, colour: colours[address.PINS.indexOf(name)], wide: false })),
      { of: latest, colour: pictures.style("--accent"), wide: true },
    ];
    const scaled = (/** @type {number[]} */ list, /** @type {number} */ by) => list.map((v) => v * by);
    for (const loop of loops) {
      loop.draw([...over(laid?.over), ...all].map(({ of, colour, wide }) => ({
        x: scaled(of.shown[loop.x], loop.scale[0]), y: scaled(of.shown[loop.y], loop.scale[1]), colour, wide,
      })));
    }
    for (const history of histories) {
      history.draw([...over(laid?.early), ...all].map(({ of, colour, wide }) => ({
        x: of.shown[history.y].map((/** @type {number} */ _, /** @type {number} */ i) => (i * of.thin) / declared.weave.rate),
        y: scaled(of.shown[history.y], history.scale), colour, wide,
      })));
    }
    table.show(latest, {
      ...Object.fromEntries(Object.entries(pins).map(([name, pin]) => [name, pin.answer])),
      ...(laid?.over.measured ? { R: laid.over } : {}),
    });
    legend();
    main.dataset.run = String(latest.id);
  }

  /** The whole drive of what is shown, with every sample. */
  async function drive() {
    const answer = await driven(shown, true, true, true);
    if (answer.failed) throw new Error(`There is no drive to save. ${why(answer)}`);
    return { manoeuvre: "weave", ...answer };
  }
  steerDownloads(find("downloads"), declared, () => /** @type {any} */ (shown),
    () => values(shown)[declared.weave.speed], drive, pictures.visible, told);

  /** What is pinned, by what differs from the car. */
  function legend() {
    find("pinned").replaceChildren(...Object.entries(pins).map(([name, { shown: of }]) => {
      const line = document.createElement("li");
      line.dataset.pin = name;
      const { parameters } = structures.get(`${of.law} ${of.chassis}`);
      const label = (/** @type {string} */ key) =>
        parameters.find((/** @type {Field} */ q) => q.name === key).label.split(",")[0];
      const changed = Object.entries(of.values).map(([key, value]) => `${label(key)} ${value}`);
      line.textContent = [`${name}: ${spaced(of.law)}`, spaced(of.chassis), ...changed].join(", ");
      return line;
    }));
    for (const button of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll("button.pin"))) {
      button.setAttribute("aria-pressed", String((button.dataset.pin ?? "") in pins));
    }
  }

  let remembered = location.hash;
  addEventListener("hashchange", () => {  // a link to this page was opened in it
    if (location.hash !== remembered) location.reload();
  });

  function remember() {
    const text = address.whole(shown, Object.fromEntries(Object.entries(pins).map(([name, pin]) => [name, pin.shown])));
    remembered = `#${text}`;
    history.replaceState(null, "", remembered);
  }

  /** @param {string} name @param {number} value */
  function changed(name, value) {
    shown.values[name] = value;
    notice = "";
    told(redraw());
  }

  /** What the page takes of a law, a chassis and values, and sentences about what it refuses. @param {any} to */
  async function taken(to) {
    const { parameters } = await structure(to.law, to.chassis), remarks = [];
    /** @type {Record<string, number>} */
    const kept = {};
    for (const [name, value] of Object.entries(to.values)) {
      const field = parameters.find((/** @type {Field} */ q) => q.name === name);
      const why = field ? fields.refusal(field, steerNumbers.read(String(value)), String(value)) : `this page has no ${name} here`;
      if (why) remarks.push(`${why}; left as the car has it.`);
      else kept[name] = steerNumbers.read(String(value));
    }
    return { of: { law: to.law, chassis: to.chassis, values: kept }, remarks };
  }

  /** Show another car, without driving it. @param {any} of */
  function choose(of) {
    shown = of;
    find("law").value = shown.law;
    find("chassis").value = shown.chassis;
    find("about").textContent = declared.laws.find((/** @type {any} */ law) => law.name === shown.law).about;
    fields.show(structures.get(`${shown.law} ${shown.chassis}`).parameters, values(shown));
  }

  for (const law of known.laws) find("law").append(new Option(spaced(law), law));
  for (const chassis of known.chassis) find("chassis").append(new Option(spaced(chassis), chassis));
  for (const id of /** @type {("law" | "chassis")[]} */ (["law", "chassis"])) {
    find(id).addEventListener("change", () => told(another()));
  }

  /** Take the law and the chassis that were chosen. */
  async function another() {
    const law = find("law").value, chassis = find("chassis").value;
    const left = () => find("law").value !== law || find("chassis").value !== chassis;
    try {
      await structure(law, chassis);
    } catch (error) {
      if (!left()) choose(shown);
      throw error;
    }
    if (left()) return;  // another one was chosen while this was loaded
    const { parameters } = structures.get(`${law} ${chassis}`);
    const names = new Set(parameters.map((/** @type {Field} */ q) => q.name));
    // A parameter of the same name keeps its value; others belong to the law or the chassis of before.
    const kept = Object.fromEntries(Object.entries(shown.values).filter(([name]) => names.has(name)));
    const { of, remarks } = await taken({ law, chassis, values: kept });
    choose(of);
    notice = remarks.join(" ");
    await redraw();
  }

  for (const button of document.querySelectorAll("button.pin")) {
    const name = /** @type {HTMLElement} */ (button).dataset.pin ?? "";
    button.addEventListener("click", () => told(pin(name, { ...shown, values: { ...shown.values } })));
  }
  find("unpin").addEventListener("click", () => {
    for (const name of Object.keys(pins)) delete pins[name];
    draw();
    remember();
  });
  find("reset").addEventListener("click", () => {
    choose({ law: shown.law, chassis: shown.chassis, values: {} });
    notice = "";
    told(redraw());
  });

  /** @param {string} name @param {any} of */
  async function pin(name, of) {
    const answer = await driven(of, true, true);
    if (answer.failed) throw new Error(`${name} is not pinned. ${why(answer)}`);
    pins[name] = { shown: of, answer };
    draw();
    remember();
  }

  find("lead").textContent = `On-centre weave of ${declared.car.name}, simulated: ${declared.weave.target} m/s² at ` +
    `${declared.weave.frequency} Hz. Move a slider: the car is driven anew and redrawn.`;
  await told((async () => {
    const first = await taken(start.shown), remarks = [...start.remarks, ...first.remarks];
    choose(first.of);
    main.hidden = false;
    notice = remarks.join(" ");
    const { next } = await driven(shown, false, true);  // for an amplitude with which the first picture is nearly right
    if (next > 0 && next < MOST) amplitude = next;
    show(await driven(shown, false, true));
    show(await driven(shown, true, true));
    for (const [name, given] of Object.entries(start.pins)) {
      const read = address.read(given, shown, known), { of, remarks: more } = await taken(read.shown);
      const refused = await pin(name, of).then(() => [], (/** @type {Error} */ error) => [error.message]);
      notice = [notice, ...[...read.remarks, ...more].map((remark) => `${name}: ${remark}`), ...refused].join(" ").trim();
      status.textContent = notice;
    }
  })());
}
