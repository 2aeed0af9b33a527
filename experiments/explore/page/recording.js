/* A recording that is dropped on the page: a CSV file in the form that steer_env.recording writes, or that of another
   program whose columns have the names of the channels and a unit. It is read in slices, so that the page stays awake,
   and what cannot be shown is refused in a sentence. It stays in the page: the address does not hold it. */

"use strict";

/** @typedef {{channels: Record<string, string>, units: Record<string, [string, number]>, plausible: Record<string, number>,
 *             gap: number, largest: number, longest: number, points: number, rate: number}} RecordingSettings */
/** @typedef {{name: string, meta: Record<string, string>, channels: Record<string, Float64Array>}} Recorded */

/** @param {RecordingSettings} settings */
function steerRecordingReader(settings) {
  const SLICE = 1 << 18;  // bytes that are read at a time
  const LONGEST_LINE = 1 << 16;  // characters; a longer one is no row
  const { rate } = settings, units = new Map(Object.entries(settings.units));

  /** The unit in memory of a spelling, and the size of one: as parse_unit of steer_env.recording.units. @param {string} text */
  const unitOf = (text) => units.get(text.replace("²", "2").replace("º", "°").replaceAll("_", "/")
    .replace(/[\s^*·.]/g, "").replace("/s/s", "/s2"));

  /** Name and unit of a column such as "handwheel_angle [deg]" or "handwheel_angle_deg". @param {string} label */
  function column(label) {
    const text = label.trim().replace(/^"(.*)"$/, "$1").trim(), bracketed = /^(.*\S)\s*[[(]([^[\]()]*)[\])]$/.exec(text);
    if (bracketed) return { name: bracketed[1], unit: bracketed[2] };
    for (let at = text.indexOf("_"); at > 0; at = text.indexOf("_", at + 1)) {
      if (unitOf(text.slice(at + 1))) return { name: text.slice(0, at), unit: text.slice(at + 1) };
    }
    return { name: text, unit: "" };
  }

  /** How a file encodes its text; refused where it begins with bytes that are none. @param {File} file */
  async function encoding(file) {
    const bytes = new Uint8Array(await file.slice(0, SLICE).arrayBuffer());
    const mark = (bytes[0] << 8) | bytes[1];
    const name = mark === 0xfffe ? "utf-16le" : mark === 0xfeff ? "utf-16be" : "utf-8";
    const decoded = (/** @type {string} */ label) => new TextDecoder(label, { fatal: true }).decode(bytes, { stream: true });
    let text, found = name;
    try {
      text = decoded(name);
    } catch {
      text = decoded(found = "windows-1252");  // degree signs of older tools
    }
    if (/[\x00-\x08\x0e-\x1f]/.test(text)) throw new Error("it begins with bytes that are no text, so it is no CSV file");
    return found;
  }

  /** Hand over the lines of a file one by one. @param {File} file @param {(line: string) => void} take */
  async function lines(file, take) {
    const decoder = new TextDecoder(await encoding(file));
    let rest = "";
    for (let at = 0; at < file.size; at += SLICE) {
      const slice = await file.slice(at, at + SLICE).arrayBuffer();
      const found = (rest + decoder.decode(slice, { stream: true })).split("\n");
      rest = /** @type {string} */ (found.pop());
      if (rest.length > LONGEST_LINE) throw new Error("it has a line that is too long for a row of a table");
      found.forEach(take);
    }
    if (rest) take(rest);
  }

  /** Places of the time and of the channels in a header. @param {string} line */
  function header(line) {
    const separator = [";", "\t"].find((one) => line.includes(one)) ?? ",";
    const columns = line.split(separator).map(column), time = { place: 0, size: 1 };
    time.place = columns.findIndex(({ name }) => ["time", "t"].includes(name.toLowerCase()));
    if (time.place < 0 && unitOf(columns[0].unit)?.[0] === "s") time.place = 0;
    if (time.place < 0) throw new Error(`its first line names no column time_s; it begins with ${line.trim().slice(0, 60)}`);
    const { unit } = columns[time.place], inSeconds = unit ? unitOf(unit) : ["s", 1];
    if (inSeconds?.[0] !== "s") throw new Error(`its time is in ${unit}, which is no unit of time`);
    time.size = Number(inSeconds[1]);
    /** @type {{name: string, place: number, size: number, time: number[], values: number[]}[]} */
    const wanted = [];
    for (const [name, inMemory] of Object.entries(settings.channels)) {
      const place = columns.findIndex((one) => one.name === name);
      if (place < 0) continue;
      const known = unitOf(columns[place].unit);
      if (known?.[0] !== inMemory) {
        throw new Error(`its column ${name} has ${columns[place].unit ? `the unit ${columns[place].unit}` : "no unit"}, ` +
          `and one of ${inMemory} is needed, as in ${name} [${inMemory}]`);
      }
      wanted.push({ name, place, size: known[1], time: [], values: [] });
    }
    if (!wanted.length) throw new Error(`none of its columns is one of ${Object.keys(settings.channels).join(", ")}`);
    return { separator, count: columns.length, time, wanted };
  }

  /** A text of the head, which may be quoted as JSON quotes it. @param {string} text */
  function plain(text) {
    try {
      const found = text.startsWith('"') ? JSON.parse(text) : text;
      return String(found);
    } catch {
      return text;
    }
  }

  /** The channels of a file at the rate of the page; an error says why there are none. @param {File} file
      @returns {Promise<Recorded>} */
  async function read(file) {
    if (file.size > settings.largest) {
      throw new Error(`it has ${(file.size / 1e6).toFixed(0)} MB, and this page reads at most ${settings.largest / 1e6} MB`);
    }
    /** @type {Record<string, string>} */
    const meta = {};
    /** @type {ReturnType<typeof header> | null} */
    let table = null;
    let number = 0, first = NaN, last = NaN;
    await lines(file, (line) => {
      number++;
      if (!line.trim()) return;
      if (!table) {
        const [, key, value] = /^#\s*([^:]*\S)\s*:(.*)$/.exec(line) ?? [];
        if (key) meta[key] = plain(value.trim());
        else if (!line.startsWith("#")) table = header(line);
        return;
      }
      const { separator, count, time, wanted } = table, cells = line.split(separator);
      if (cells.length === count + 1 && !cells[count].trim()) cells.pop();
      if (cells.length !== count) throw new Error(`line ${number} has ${cells.length} cells, the header has ${count}`);
      const cell = (/** @type {number} */ place) => {
        const text = (separator === "," ? cells[place] : cells[place].replace(",", ".")).trim();
        const value = steerNumbers.read(text);
        if (!Number.isFinite(value) && text && !/^[+-]?nan$/i.test(text)) {
          throw new Error(`line ${number} has ${text.slice(0, 40)} where a finite number is needed`);
        }
        return value;
      };
      const t = cell(time.place) * time.size;
      if (!Number.isFinite(t) || t <= last) throw new Error(`line ${number} has no time after that of the line before`);
      if (Number.isNaN(first)) first = t;
      last = t;
      if (t - first > settings.longest) throw new Error(`it lasts longer than ${settings.longest} s, the most that this page shows`);
      for (const one of wanted) {
        const value = cell(one.place) * one.size;
        if (Number.isNaN(value)) continue;  // a gap, as an empty cell is
        one.time.push(t);
        one.values.push(value);
      }
    });
    if (!table) throw new Error("it has no line that names its columns");
    const { wanted } = /** @type {ReturnType<typeof header>} */ (table);
    if (!(last > first)) throw new Error("it has fewer than two rows of numbers");
    const some = wanted.filter((one) => one.values.length);
    if (!some.length) throw new Error(`no number is in its columns ${wanted.map((one) => one.name).join(", ")}`);
    for (const one of some) require(one, first, last);
    const size = Math.floor((last - first) * rate + 1e-6) + 1;
    return { name: file.name, meta, channels: Object.fromEntries(some.map((one) => [one.name, sampled(one, first, size)])) };
  }

  /** Refuse a channel with a gap, or with values that its unit cannot mean. @param {{name: string, time: number[],
      values: number[]}} of @param {number} first @param {number} last */
  function require({ name, time, values }, first, last) {
    let before = first;
    for (const t of [...time, last]) {
      if (t - before > settings.gap * (1 + 1e-9)) {
        throw new Error(`${name} has no value between ${before.toPrecision(4)} and ${t.toPrecision(4)} s`);
      }
      before = t;
    }
    const most = values.reduce((found, value) => Math.max(found, Math.abs(value)), 0), plausible = settings.plausible[name];
    if (most > plausible) {
      throw new Error(`${name} reaches ${most.toPrecision(3)} ${settings.channels[name]}: its unit cannot be right`);
    }
  }

  /** Linear between the samples, at the rate of the page. @param {{time: number[], values: number[]}} of
      @param {number} first @param {number} size */
  function sampled({ time, values }, first, size) {
    const found = new Float64Array(size), end = time.length - 1;
    for (let i = 0, k = 0; i < size; i++) {
      const t = first + i / rate;
      while (k < end - 1 && time[k + 1] < t) k++;
      const share = end ? Math.min(Math.max((t - time[k]) / (time[k + 1] - time[k]), 0), 1) : 0;
      found[i] = values[k] + (share ? share * (values[k + 1] - values[k]) : 0);
    }
    return found;
  }

  return { read, column };
}

/** The button and the drop of a recording, and what is laid over. @param {HTMLElement} host
    @param {RecordingSettings} settings @param {any} drives @param {() => void} onChange */
function steerRecording(host, settings, drives, onChange) {
  const reader = steerRecordingReader(settings), { rate } = settings;
  const tools = steerMetrics(drives.filters, rate);
  const find = (/** @type {string} */ kind) => /** @type {any} */ (host.querySelector(kind));
  const input = /** @type {HTMLInputElement} */ (find("input")), told = find("p"), entry = find("span"), remove = find("button");
  /** @type {Recorded | null} */
  let kept = null;
  /** @type {Map<string, ReturnType<typeof evaluated>>} */
  const found = new Map();
  let asked = 0;

  /** Metrics of a recording in a manoeuvre, or why there are none. One that is no weave must name its manoeuvre, as its
      script reads the hands at given instants. @param {Recorded} of @param {any} manoeuvre */
  function evaluated(of, manoeuvre) {
    const { name, whole, metrics } = manoeuvre, own = of.meta.manoeuvre, loops = manoeuvre.reader === "loops";
    const other = own && own !== name ? `its manoeuvre is ${own}` : own || loops ? "" : `it does not name its manoeuvre, ${name}`;
    const channels = new Proxy(of.channels, { get(all, channel) {
      if (!(channel in all)) throw new tools.Refused(`there is no channel ${String(channel)}`);
      return all[String(channel)];
    } });
    const reader = STEER_READERS[/** @type {keyof typeof STEER_READERS} */ (manoeuvre.reader)](tools, drives.constants);
    /** @type {any[]} */
    const readings = [];
    const keeping = { ...reader, read: (/** @type {any} */ given, /** @type {any} */ course) => {
      readings.push(reader.read(given, course));
      return readings[0];
    } };
    const { values, reasons } = tools.evaluate(keeping, channels, whole, metrics, other);
    const read = readings.length > 0, cycles = loops && read ? readings[0] : null;
    return { values, reasons, read, cycles, why: read ? "" : other || Object.values(reasons)[0] };
  }

  /** @param {File} file */
  async function lay(file) {
    const own = ++asked;
    told.textContent = `${file.name} is being read.`;
    told.className = "note";
    try {
      const of = await reader.read(file);
      if (own !== asked) return;  // another one was dropped meanwhile
      kept = of;
      told.textContent = "";
      found.clear();
    } catch (error) {
      if (own !== asked) return;
      told.textContent = `${file.name} is not shown: ${/** @type {Error} */ (error).message}.`;
      told.className = "refusal";
    }
    show();
  }

  function show() {
    entry.textContent = kept ? `R: ${kept.name}${kept.meta.vehicle ? `, ${kept.meta.vehicle}` : ""}` : "";
    remove.hidden = !kept;
    onChange();
  }

  input.addEventListener("change", () => {
    if (input.files?.length) lay(input.files[0]);
    input.value = "";  // the same file may be chosen again
  });
  remove.addEventListener("click", () => {
    asked++;
    kept = null;
    told.textContent = "";
    show();
    input.focus();
  });
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", (event) => {
    event.preventDefault();
    const files = event.dataTransfer?.files;
    if (files?.length) lay(files[0]);
  });

  /** Points of a stretch of a recording, few enough for a picture. @param {Recorded} of @param {number} from
      @param {number} to samples @param {number} start of its time [s] */
  function stretch({ channels }, from, to, start) {
    const end = Math.min(to, Object.values(channels)[0].length - 1), places = [];
    const thin = Math.max(Math.ceil((end - from) / settings.points), 1);
    for (let i = from; i <= end; i += thin) places.push(i);
    /** @type {Record<string, number[]>} */
    const shown = { time: places.map((i) => start + (i - from) / rate) };
    for (const name of Object.keys(settings.channels)) {
      shown[name] = name in channels ? places.map((i) => channels[name][i]) : [];
    }
    return { shown };
  }

  /** The recording in the pictures of a manoeuvre: in the large ones, and in the others where they differ; null without
      one. A weave is shown by its last settled cycle, another drive by the section of the manoeuvre, or else as a whole,
      and by its beginning over time. @param {any} manoeuvre */
  function laid(manoeuvre) {
    if (!kept) return null;
    const of = kept, own = found.get(manoeuvre.name) ?? evaluated(of, manoeuvre), { cycles, why } = own;
    const measured = own.read ? own : null;
    found.set(manoeuvre.name, own);
    if (told.className !== "refusal") told.textContent = why && `The curves alone are shown: ${why}.`;
    if (cycles) {
      const samples = cycles.time.length / (cycles.count + 2), first = cycles.count * samples;
      const [from, to] = [first, first + samples].map((k) => Math.round(cycles.time[k] * rate - 1));
      const cycle = stretch(of, from, to, 0);
      return { over: cycle, early: cycle, measured };
    }
    if (manoeuvre.section) {
      const [from, to] = manoeuvre.section.map((/** @type {number} */ t) => Math.round(t * rate));
      const section = stretch(of, from, to, from / rate);
      return { over: section, early: section, measured };
    }
    const period = Math.round(rate / manoeuvre.whole.frequency);
    return { over: stretch(of, 0, Infinity, 0), early: stretch(of, 0, period, 0), measured };
  }

  return { laid };
}
