/* What the page hands on: the car as a car file, lines of Python that make an environment of it, the drive as a
   recording, and the pictures. Each is a file that is made here; nothing is asked of a network. */

"use strict";

/** @typedef {{name: string, file: string, bySpeed: Record<string, number[]>, factor: string}} DeclaredCar */
/** @typedef {{law: string, chassis: string, values: Record<string, number>}} Chosen the values that differ from the car */
/** @typedef {{manoeuvre: string, amplitude: number, channels: Record<string, Float64Array>}} Drive */

/** @param {any} declared */
function steerFiles(declared) {
  const DIGITS = 9;  // of a recorded value
  const car = /** @type {DeclaredCar} */ (declared.car), { recording, rate, environment } = declared.files;

  /** Keys of the car file and their values, of the parameters that are keys. @param {Record<string, number>} values */
  function keys(values) {
    /** @type {Record<string, number | number[]>} */
    const found = {}, { bySpeed, factor } = car;
    for (const [name, value] of Object.entries(values)) {
      const [section, key, place] = name.split(".");
      if (!key || section === "friction" || place) continue;
      if (!(name in bySpeed)) found[name] = value;
      else {  // in the proportions of the car: the parameter is the largest
        const most = Math.max(...bySpeed[name]);
        found[name] = bySpeed[name].map((own) => (most > 0 ? own * (value / most) : value));
      }
    }
    bySpeed[factor].forEach((_, i) => {
      if (!(`${factor}.${i}` in values)) return;
      const profile = /** @type {number[]} */ (found[factor] ??= [...bySpeed[factor]]);
      profile[i] *= values[`${factor}.${i}`];
    });
    return found;
  }

  /** The car file of the car with other values. @param {Record<string, number>} values */
  function carFile(values) {
    const changed = keys(values);
    let section = "";
    return car.file.split("\n").map((line) => {
      section = /^\[(.*)\]$/.exec(line)?.[1] ?? section;
      const key = /^(\w+) = /.exec(line)?.[1], name = `${section}.${key}`;
      if (name === ".name" && Object.keys(changed).length) return `name = ${JSON.stringify(`${car.name}, changed`)}`;
      return name in changed ? `${key} = ${JSON.stringify(changed[name])}` : line;
    }).join("\n");
  }

  /** Values of a law by its own names, of sites SITE.NAME. @param {Record<string, number>} values @returns {[string, number][]} */
  const ofLaw = (values) => Object.entries(values).flatMap(([name, value]) =>
    name.startsWith("friction.") ? [/** @type {[string, number]} */ ([name.slice("friction.".length), value])] : []);

  /** What `friction=` takes for a law, or for sites, with the values of the page. @param {Chosen} of */
  function friction(of) {
    const { given } = declared.laws.find((/** @type {any} */ law) => law.name === of.law);
    const found = JSON.parse(JSON.stringify(given));
    for (const [name, value] of ofLaw(of.values)) {
      const [key, site] = name.split(".").reverse();
      (site ? found[site] : found)[key] = value;
    }
    return found;
  }

  /** A value in Python's words. @param {any} value @returns {string} */
  const python = (value) => (typeof value !== "object" || Array.isArray(value) ? JSON.stringify(value)
    : `{${Object.entries(value).map(([key, own]) => `"${key}": ${python(own)}`).join(", ")}}`);

  /** Lines of Python that make an environment of the car. @param {Chosen} of @param {string} file of the car
      @param {number} kph */
  function environmentLines(of, file, kph) {
    const options = Object.entries(environment.options).flatMap(([name, option]) =>
      name in of.values ? [`"${option}": ${of.values[name]}`] : []);
    return [
      "import gymnasium as gym", "", "import steer_env  # registers the environments", "", "env = gym.make(", `    "${kph ? environment.driven : environment.standing}",`,
      `    vehicle=${JSON.stringify(file)},  # the car file of the same page, in this folder`,
      `    friction=${python(friction(of))},`, `    chassis="${of.chassis}",`, ...(kph ? [`    speed=${kph} / 3.6,`] : []), ")",
      `observation, info = env.reset(seed=0${options.length ? `, options={${options.join(", ")}}` : ""})`, "",
    ].join("\n");
  }

  /** A drive as the CSV file of a recording. @param {Chosen} of @param {Drive} drive @param {number} kph */
  function recordingText(of, drive, kph) {
    const parameters = ofLaw(of.values).map(([key, value]) => `${key}=${value}`).join(",");
    const meta = {
      manoeuvre: declared.drives.manoeuvres[drive.manoeuvre].name, vehicle: car.name, chassis: of.chassis, friction: of.law,
      ...(parameters ? { friction_parameters: parameters } : {}), speed_m_s: kph / 3.6, amplitude_rad: drive.amplitude,
      changed: JSON.stringify(of.values),
    };
    const names = Object.keys(drive.channels).filter((name) => name in recording.columns);
    const columns = names.map((name) => recording.columns[name]);
    const rows = [["time_s", ...columns.map(([label]) => label)].join(",")];
    for (let i = 0; i < drive.channels[names[0]].length; i++) {
      const cells = names.map((name, k) => Number((drive.channels[name][i] / columns[k][1]).toPrecision(DIGITS)));
      rows.push(`${(i + 1) / rate},${cells.join(",")}`);
    }
    return [...Object.entries(meta).map(([key, value]) => `# ${key}: ${value}`), ...rows, ""].join("\n");
  }

  return { carFile, environmentLines, recordingText };
}

/** Pictures as one SVG, below each other. @param {Picture[]} pictures */
function steerSvg(pictures) {
  const WIDTH = 640, HEIGHT = 380, LEFT = 62, RIGHT = 14, TOP = 30, BOTTOM = 48, TICKS = 6;
  const style = (/** @type {string} */ name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const safe = (/** @type {string} */ text) => text.replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);

  /** Round values between two. @param {number} low @param {number} high */
  function ticks(low, high) {
    const rough = (high - low) / TICKS, size = 10 ** Math.floor(Math.log10(rough));
    const step = ([1, 2, 5].find((k) => k * size >= rough) ?? 10) * size, first = Math.ceil(low / step);
    return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, k) => Number(((first + k) * step).toPrecision(12)));
  }

  const parts = pictures.map(({ caption, xLabel, yLabel, curves, range }, k) => {
    const [[x0, x1], [y0, y1]] = [range("x"), range("y")], right = WIDTH - RIGHT, bottom = HEIGHT - BOTTOM;
    const x = (/** @type {number} */ v) => (LEFT + ((v - x0) / (x1 - x0)) * (right - LEFT)).toFixed(1);
    const y = (/** @type {number} */ v) => (bottom - ((v - y0) / (y1 - y0)) * (bottom - TOP)).toFixed(1);
    const grid = [
      ...ticks(x0, x1).map((v) => `<path d="M${x(v)} ${TOP}V${bottom}"/><text x="${x(v)}" y="${bottom + 16}">${v}</text>`),
      ...ticks(y0, y1).map((v) => `<path d="M${LEFT} ${y(v)}H${right}"/><text class="y" x="${LEFT - 6}" y="${y(v)}" dy="4">${v}</text>`),
    ];
    const lines = curves.map((curve) => `<polyline stroke="${curve.colour}" stroke-width="${curve.wide ? 2 : 1.4}" points="${
      curve.x.map((v, i) => `${x(v)},${y(curve.y[i])}`).join(" ")}"/>`);
    return `<g transform="translate(0 ${k * HEIGHT})"><text x="${(LEFT + right) / 2}" y="18">${safe(caption)}</text>${grid.join("")}` +
      `<text x="${(LEFT + right) / 2}" y="${bottom + 36}">${safe(xLabel)}</text>` +
      `<text transform="translate(14 ${(TOP + bottom) / 2}) rotate(-90)">${safe(yLabel)}</text>${lines.join("")}</g>`;
  });
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${WIDTH} ${HEIGHT * pictures.length}" width="${WIDTH}">` +
    `<style>text{font:12px sans-serif;text-anchor:middle;fill:${style("--ink")}}.y{text-anchor:end}path{stroke:${style("--line")}}` +
    `polyline{fill:none;stroke-linejoin:round}</style><rect width="100%" height="100%" fill="${style("--paper")}"/>${parts.join("")}</svg>\n`;
}

/** The buttons. @param {HTMLElement} host @param {any} declared @param {() => Chosen} chosen what is shown
    @param {() => number} kph @param {() => Promise<Drive>} drive it as a whole @param {() => Picture[]} pictures
    @param {(work: Promise<any>) => void} told */
function steerDownloads(host, declared, chosen, kph, drive, pictures, told) {
  const files = steerFiles(declared);

  /** Hand a file to the browser. @param {string} name @param {string} text @param {string} type */
  function save(name, text, type) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type }));
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60e3);
  }

  const stem = () => `${declared.car.name}_${chosen().law}`.replace(/[^\w-]+/g, "_");
  const carName = () => `${stem()}.toml`;
  /** @type {Record<string, () => Promise<void> | void>} */
  const kinds = {
    car: () => save(carName(), files.carFile(chosen().values), "application/toml"),
    environment: () => save(`${stem()}.py`, files.environmentLines(chosen(), carName(), kph()), "text/x-python"),
    recording: async () => {
      const of = chosen(), held = kph(), name = `${stem()}.csv`, whole = await drive();
      save(name, files.recordingText(of, whole, held), "text/csv");
    },
    pictures: () => save(`${stem()}.svg`, steerSvg(pictures()), "image/svg+xml"),
  };
  for (const button of /** @type {NodeListOf<HTMLElement>} */ (host.querySelectorAll("button"))) {
    button.addEventListener("click", () => told(Promise.resolve().then(kinds[button.dataset.file ?? ""])));
  }
}
