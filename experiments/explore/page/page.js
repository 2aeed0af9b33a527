/* The page: it loads what it needs, asks the worker for a drive at every change, and shows what comes back.

   While values change, the worker drives a shorter manoeuvre with an amplitude that follows from the run before, one at a
   time. Once they rest, the amplitude is found anew and the whole manoeuvre is driven, as Python drives it; where a value
   changes meanwhile, it is left. */

"use strict";

const REST = 250;  // time without a change after which the whole manoeuvre is driven [ms]
const FIRST = 0.2, MOST = 6;  // amplitude of the first drive, and the largest that is tried [rad]

/** What is shown, for tests and for the console. @type {any} */
const steerShown = { structures: new Map(), answer: null, pins: {}, laid: null };

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
  const { drives, speed } = declared, { manoeuvres } = drives;
  const address = steerAddress(declared), pictures = steerPictures();
  const table = steerTable(find("metrics"), declared.noticed);
  const fields = steerFields(find("fields"), changed);
  const readers = Object.entries(STEER_READERS);
  const functions = [steerMetrics, steerSimulation, steerStability, steerWorker, ...readers.map(([, reader]) => reader)];
  const text = [
    `const declared = ${JSON.stringify({ drives, speed, characteristics: declared.characteristics })};`,
    "const { drives } = declared, { rate, constants } = drives;",
    ...functions.map(String),
    "const metrics = steerMetrics(drives.filters, rate);",
    `const readers = { ${readers.map(([name, reader]) => `${name}: ${reader.name}(metrics, constants)`)} };`,
    "steerWorker(self, declared, steerSimulation(rate, drives.regrip), metrics, readers,",
    "  steerStability({ ...constants.linear, ...constants.stability }, drives.functions));",
  ].join("\n");
  const worker = new Worker(URL.createObjectURL(new Blob([`"use strict";\n${text}`], { type: "text/javascript" })));

  const { structures, pins } = steerShown, load = steerLoading(declared);
  const { known } = address, start = address.read(location.hash.slice(1) || declared.opening);
  let { shown } = start;
  /** @type {any} */
  let latest = null;
  /** @type {{resolve: (answer: any) => void, reject: (error: Error) => void}[]} */
  const answered = [];
  /** Amplitudes from which the search goes on, by manoeuvre. @type {Record<string, number>} */
  const amplitudes = {};
  let notice = "", runs = 0, wanted = false, busy = false, settling = false, rest = 0, unpinned = 0;

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

  const structure = load.into(worker, structures);

  const manoeuvre = () => manoeuvres[shown.manoeuvre];

  /** The chassis on which a car is driven in the manoeuvre that is shown. @param {any} of */
  const chassisOf = (of) => (manoeuvre().chassis.includes(of.chassis) ? of.chassis : manoeuvre().chassis[0]);

  /** @param {any} of */
  const parametersOf = (of) => structures.get(`${of.law} ${chassisOf(of)}`).parameters;

  /** Every value of a car: those that were changed, the manoeuvre's speed, and the car's own. @param {any} of */
  function values(of) {
    const own = manoeuvre().speed / speed.unit;
    /** @param {Field} q */
    const value = (q) => (q.name !== speed.name ? of.values[q.name] ?? q.value : own && (of.values[q.name] ?? own));
    return Object.fromEntries(parametersOf(of).map((/** @type {Field} */ q) => [q.name, value(q)]));
  }

  /** @param {any} of @param {boolean} exact @param {boolean} kept whether nothing stops it
      @param {boolean} whole whether the answer has every sample @returns {Promise<any>} */
  function driven(of, exact, kept, whole = false) {
    return new Promise((resolve, reject) => {
      answered.push({ resolve, reject });
      const key = `${of.law} ${chassisOf(of)}`, amplitude = amplitudes[shown.manoeuvre] ?? FIRST;
      const run = { id: ++runs, key, manoeuvre: shown.manoeuvre, values: values(of), amplitude, exact, kept, whole };
      worker.postMessage({ run });
    });
  }

  /** The amplitude for the next run is that which the last one suggests. @param {any} answer */
  function follow(answer) {
    const next = answer.exact ? answer.amplitude : answer.next;
    if (answer.failed) delete amplitudes[answer.manoeuvre];
    else if (manoeuvres[answer.manoeuvre].target === null || (next > 0 && next < MOST)) amplitudes[answer.manoeuvre] = next;
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
        // The first run of a manoeuvre tells with which amplitude its picture is nearly right.
        if (!(shown.manoeuvre in amplitudes)) follow(await driven(shown, false, true));
        show(await driven(shown, false, true));
      }
    } finally {
      busy = false;
    }
    clearTimeout(rest);
    rest = setTimeout(() => {
      remember();
      told(settle());
    }, REST);
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
  }

  /** Why a car cannot be driven. @param {any} answer */
  const why = (answer) => sentence(answer.refused || (manoeuvre().target === null ? "the car does not stay finite"
    : `no handwheel amplitude reaches ${manoeuvre().target} m/s² with these values`));

  /** @param {any} answer */
  function show(answer) {
    if (answer.manoeuvre !== shown.manoeuvre) return;  // another one was chosen meanwhile
    follow(answer);
    main.dataset.exact = String(answer.exact);
    main.classList.toggle("stale", Boolean(answer.failed));
    status.classList.toggle("refusal", Boolean(answer.failed || answer.refused));
    if (answer.failed) {
      status.textContent = `${notice} ${why(answer)}${latest ? " The car before is shown." : ""}`.trim();
      return;
    }
    status.textContent = answer.refused
      ? `${notice} ${sentence(answer.refused)} No metric is read from such a drive.`.trim() : notice;
    latest = steerShown.answer = answer;
    draw();
  }

  /** A figure of a quantity over another, with what draws it. @param {string} x @param {string} y @param {boolean} large
      @param {string} [title] */
  function figured(x, y, large, title) {
    const figure = document.createElement("figure"), caption = document.createElement("figcaption");
    const host = document.createElement("div"), [across, up] = [x, y].map((each) => drives.drawn[each]);
    // A small picture has room for the last word; its caption has them all.
    const axis = (/** @type {any} */ each) => `${large ? each.label : each.label.split(" ").at(-1)} [${each.unit}]`;
    caption.textContent = title ?? `${up.label[0].toUpperCase()}${up.label.slice(1)} over ${across.label}`;
    caption.id = `picture-${++figures}`;
    host.setAttribute("role", "img");
    host.setAttribute("aria-labelledby", caption.id);
    figure.className = large ? "loop" : "history";
    figure.append(caption, host);
    const paint = pictures.picture(host, axis(across), axis(up), large ? 0.68 : 0.5);
    const scaled = (/** @type {number[]} */ list, /** @type {number} */ by) => list.map((v) => v * by);
    /** @param {(answer: any) => {x: number[], y: number[]} | null} taken from an answer @param {any} [under] the recording */
    const draw = (taken, under) => paint([...(under ? [under] : []), ...layers()].filter(({ of }) => taken(of)).map(({ of, colour, wide }) => {
      const curve = /** @type {{x: number[], y: number[]}} */ (taken(of));
      return { x: scaled(curve.x, across.scale), y: scaled(curve.y, up.scale), colour, wide };
    }));
    return { figure, large, draw };
  }

  let figures = 0;
  const characteristics = [
    { ...figured("displacement", "friction_torque", false), of: "loop" },
    { ...figured("sliding_speed", "friction_torque", false), of: "sliding" },
  ];
  const responses = [
    { ...figured("frequency", "yaw_gain", false, "Gain of the yaw rate"), of: "yaw_gain" },
    { ...figured("frequency", "yaw_phase", false, "Phase of the yaw rate"), of: "yaw_phase" },
    { ...figured("frequency", "torque_gain", false, "Gain of the hand torque"), of: "torque_gain" },
  ];
  const swing = Math.round(declared.characteristics.amplitude * drives.drawn.handwheel_angle.scale);
  find("of-frequency").querySelector("h2").textContent = `Response to sines of ${swing} deg of the handwheel`;
  find("responses").append(...responses.map(({ figure }) => figure));
  find("characteristics").append(...characteristics.map(({ figure }) => figure));

  /** The pictures of each manoeuvre, made when it is first shown. @type {Map<string, any[]>} */
  const shownPictures = new Map();

  /** Put the pictures of the manoeuvre on the page. */
  function lay() {
    const name = shown.manoeuvre, { pictures: pairs } = manoeuvre();
    if (!shownPictures.has(name)) {
      shownPictures.set(name, pairs.map((/** @type {[string, string]} */ [x, y], /** @type {number} */ k) =>
        ({ x, y, ...figured(x, y, k < 2) })));
    }
    const all = shownPictures.get(name) ?? [];
    find("large").replaceChildren(...all.filter(({ large }) => large).map(({ figure }) => figure));
    find("small").replaceChildren(...all.filter(({ large }) => !large).map(({ figure }) => figure));
    find("of-frequency").hidden = !manoeuvre().speed;
    find("metrics-title").textContent = `Metrics: ${manoeuvre().title}`;
    find("lead").textContent = `${sentence(`${manoeuvre().title} of ${declared.car.name}, simulated`)} ` +
      `${sentence(manoeuvre().hands)} Move a slider: the car is driven anew and redrawn.`;
  }

  /** Pinned cars as they are in the manoeuvre that is shown. @returns {[string, any][]} */
  const overlaid = () => Object.entries(pins).map(([name, pin]) => /** @type {[string, any]} */ ([name, pin.answer]))
    .filter(([, answer]) => answer.manoeuvre === shown.manoeuvre);

  /** What is laid over one another: the pinned cars, and the one that is changed. */
  function layers() {
    const colours = ["--pin-a", "--pin-b", "--pin-c"].map(pictures.style);
    return [
      ...overlaid().map(([name, of]) => ({ of, colour: colours[address.PINS.indexOf(name)], wide: false })),
      { of: latest, colour: pictures.style("--accent"), wide: true },
    ];
  }

  const recording = steerRecording(find("recording"), declared.recording, drives, draw);
  steerShown.laid = () => recording.laid(manoeuvre());

  function draw() {
    legend();
    if (!latest) return;
    const laid = recording.laid(manoeuvre());
    for (const { x, y, draw: paint } of shownPictures.get(shown.manoeuvre) ?? []) {
      const of = x === "time" ? laid?.early : laid?.over, there = of?.shown[x].length && of.shown[y].length;
      const under = there ? { of, colour: pictures.style("--recording"), wide: false } : null;
      paint((/** @type {any} */ answer) => ({ x: answer.shown[x], y: answer.shown[y] }), under);
    }
    for (const { draw: paint, of } of characteristics) paint((answer) => answer.friction[of]);
    // The responses are of the car at rest of its values; while these change, the last ones stay.
    find("responses").classList.toggle("old", !latest.response);
    for (const { draw: paint, of } of latest.response ? responses : []) {
      paint((answer) => answer.response && { x: answer.response.frequency, y: answer.response[of] });
    }
    const others = laid?.measured ? [...overlaid(), ["R", laid.measured]] : overlaid();
    table.show(manoeuvre().metrics, latest, Object.fromEntries(others));
    main.dataset.run = String(latest.id);
  }

  /** The whole drive of what is shown, with every sample. */
  async function drive() {
    const answer = await driven(shown, true, true, true);
    if (answer.failed) throw new Error(`There is no drive to save. ${why(answer)}`);
    return answer;
  }
  steerDownloads(find("downloads"), declared, () => /** @type {any} */ ({ ...shown, chassis: chassisOf(shown) }),
    () => values(shown)[speed.name], drive, pictures.visible, told);

  /** What is pinned, by what differs from the car. */
  function legend() {
    find("pinned").replaceChildren(...Object.entries(pins).map(([name, { shown: of }]) => {
      const line = document.createElement("li");
      line.dataset.pin = name;
      const label = (/** @type {string} */ key) =>
        parametersOf(of).find((/** @type {Field} */ q) => q.name === key).label.split(",")[0];
      const changed = Object.entries(of.values).map(([key, value]) => `${label(key)} ${value}`);
      line.textContent = [`${name}: ${address.labels[of.law]}`, spaced(chassisOf(of)), ...changed].join(", ");
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
    const { parameters } = await structure(to.law, chassisOf(to)), { kept, remarks } = fields.taken(parameters, to.values);
    return { of: { ...to, values: kept }, remarks };
  }

  /** Show another car or manoeuvre, without driving it. @param {any} to */
  function choose(to) {
    shown = to;
    find("law").value = shown.law;
    find("manoeuvre").value = shown.manoeuvre;
    find("chassis").value = chassisOf(shown);
    for (const option of find("chassis").options) option.disabled = !manoeuvre().chassis.includes(option.value);
    find("about").textContent = declared.laws.find((/** @type {any} */ law) => law.name === shown.law).about;
    const fixed = manoeuvre().speed ? {} : { fixed: `The car stands in ${manoeuvre().title}.` };
    fields.show(parametersOf(shown).map((/** @type {Field} */ q) => (q.name === speed.name ? { ...q, ...fixed } : q)), values(shown));
  }

  for (const name of known.law) find("law").append(new Option(address.labels[name], name));
  for (const name of known.chassis) find("chassis").append(new Option(spaced(name), name));
  for (const name of known.manoeuvre) find("manoeuvre").append(new Option(manoeuvres[name].title, name));
  for (const id of ["law", "chassis"]) find(id).addEventListener("change", () => told(another()));
  find("manoeuvre").addEventListener("change", () => told(turn()));

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
    const { of, remarks } = await taken({ ...shown, law, chassis, values: kept });
    choose(of);
    notice = remarks.join(" ");
    await redraw();
  }

  /** Take the manoeuvre that was chosen; pinned cars are driven in it too. */
  async function turn() {
    const name = find("manoeuvre").value, before = shown;
    const [body] = manoeuvres[name].chassis, cars = [shown, ...Object.values(pins).map((pin) => pin.shown)];
    try {
      for (const of of cars) await structure(of.law, manoeuvres[name].chassis.includes(of.chassis) ? of.chassis : body);
    } catch (error) {
      if (find("manoeuvre").value === name) choose(shown);
      throw error;
    }
    if (find("manoeuvre").value !== name || shown !== before) return;
    latest = null;
    notice = "";
    choose({ ...shown, manoeuvre: name });
    lay();
    main.classList.add("stale");
    await redraw();
    for (const [of, pinned] of Object.entries(pins)) {
      if (shown.manoeuvre === name) await pin(of, pinned.shown);
    }
  }

  for (const button of document.querySelectorAll("button.pin")) {
    const name = /** @type {HTMLElement} */ (button).dataset.pin ?? "";
    button.addEventListener("click", () => told(pin(name, { ...shown, values: { ...shown.values } })));
  }
  find("unpin").addEventListener("click", () => {
    unpinned++;
    for (const name of Object.keys(pins)) delete pins[name];
    draw();
    remember();
  });
  find("reset").addEventListener("click", () => {
    choose({ ...shown, values: {} });
    notice = "";
    told(redraw());
  });

  /** @param {string} name @param {any} of */
  async function pin(name, of) {
    const before = unpinned, answer = await driven(of, true, true);
    if (before !== unpinned) return;  // all pins were removed meanwhile
    if (answer.failed) throw new Error(`${name} is not pinned. ${why(answer)}`);
    pins[name] = { shown: of, answer };
    draw();
    remember();
  }

  await told((async () => {
    const first = await taken(start.shown), remarks = [...start.remarks, ...first.remarks];
    choose(first.of);
    lay();
    main.hidden = false;
    notice = remarks.join(" ");
    follow(await driven(shown, false, true));  // for an amplitude with which the first picture is nearly right
    show(await driven(shown, false, true));
    show(await driven(shown, true, true));
    for (const [name, given] of Object.entries(start.pins)) {
      const read = address.read(given, shown), { of, remarks: more } = await taken(read.shown);
      const missing = !given || read.remarks.length > 0;  // another car in its place would be a wrong comparison
      const refused = missing ? [`${name} is not pinned.`] : await pin(name, of).then(() => [], (/** @type {Error} */ error) => [error.message]);
      notice = [notice, ...[...read.remarks, ...more].map((remark) => `${name}: ${remark}`), ...refused].join(" ").trim();
      status.textContent = notice;
    }
  })());
}
