/* The table of metrics: this car, the usual range, and the pinned cars with the differences from them. */

"use strict";

/** @typedef {{name: string, label: string, unit: string, scale: number, definition: string,
 *             usual: [number, number] | null, validity: [number, number] | null}} MetricEntry */
/** @typedef {{values: Record<string, number>, reasons: Record<string, string>}} Measured */

/** @param {HTMLTableElement} host
    @param {{share: number, least: Record<string, number>, sustained: string[], words: string[]}} noticed */
function steerTable(host, noticed) {
  const [PERCEPTIBLE, IMPERCEPTIBLE, UNKNOWN] = noticed.words;

  /** Three digits; of a bound as few as it takes. @param {number} value @param {boolean} [bound] */
  function written(value, bound) {
    if (!Number.isFinite(value)) return "–";
    const text = Math.abs(value) >= 100 ? value.toFixed(0) : value.toPrecision(3);
    return (bound ? String(Number(text)) : text).replace("-", "\u2212");
  }

  /** Whether a driver notices a difference: as perception of steer_env.metrics.common.just_noticeable, without an
      interval. @param {MetricEntry} entry @param {number} base @param {number} value */
  function perceived(entry, base, value) {
    const least = noticed.least[entry.unit], large = Math.max(Math.abs(base), Math.abs(value));
    if (!noticed.sustained.includes(entry.name) || !(large >= least)) return UNKNOWN;
    const threshold = (1 - 1e-9) * noticed.share * Math.max(Math.min(Math.abs(base), Math.abs(value)), least);
    return Math.abs(value - base) >= threshold ? PERCEPTIBLE : IMPERCEPTIBLE;
  }

  /** @param {string} tag @param {string} text @param {string} [kind] */
  function cell(tag, text, kind) {
    const made = document.createElement(tag);
    made.textContent = text;
    if (kind) made.className = kind;
    return made;
  }

  /** A bar with the usual range in its middle half and a mark at the value. @param {MetricEntry} entry
      @param {number} value */
  function bar(entry, value) {
    const made = cell("td", "", "range");
    if (!entry.usual) return made;
    const [low, high] = entry.usual, place = 0.25 + (0.5 * (value - low)) / (high - low);
    const inside = value >= low && value <= high, line = cell("span", "", "bar"), mark = cell("span", "", "mark");
    mark.style.left = `${100 * Math.min(Math.max(place, 0), 1)}%`;
    if (!inside) mark.classList.add("outside");
    line.append(mark);
    const told = Number.isFinite(value) ? (inside ? "within" : value < low ? "below" : "above") : "no value; usual is";
    line.setAttribute("role", "img");
    line.setAttribute("aria-label", `${told} ${written(low, true)} to ${written(high, true)}`);
    made.append(cell("small", `${written(low, true)} to ${written(high, true)}`), line);
    if (!Number.isFinite(value)) mark.remove();
    return made;
  }

  /** A pinned value, with the difference from it and whether a driver notices. @param {MetricEntry} entry
      @param {number} base @param {number} value */
  function compared(entry, base, value) {
    const made = cell("td", written(base), "value"), verdict = perceived(entry, base, value);
    if (!Number.isFinite(base) || !Number.isFinite(value)) return made;
    // Two drives of one car differ by the tolerance of the search for the amplitude.
    if (Math.abs(value - base) < 1e-4 * Math.abs(base)) return made;
    const sign = value >= base ? "+" : "\u2212", share = Math.abs((100 * (value - base)) / base);
    const gap = `${sign}${written(Math.abs(value - base))}`;
    made.append(cell("small", base ? `${gap}, ${sign}${share.toFixed(1)}\u00a0%` : gap));
    if (verdict !== UNKNOWN) made.append(cell("small", verdict, verdict === PERCEPTIBLE ? "noticed" : "unnoticed"));
    return made;
  }

  /** Why metrics have no value, as the caption below the table. @param {MetricEntry[]} entries
      @param {Record<string, Measured>} columns this car by an empty name, and the others */
  function missing(entries, columns) {
    const caption = cell("caption", "");
    for (const [name, { reasons }] of Object.entries(columns)) {
      for (const reason of new Set(Object.values(reasons))) {
        const labels = entries.filter((entry) => reasons[entry.name] === reason).map(({ label }) => label);
        const what = labels.length === entries.length ? "no metric" : labels.join(", ");
        caption.append(cell("p", `${[name, what].filter(Boolean).join(", ")}: ${reason}.`));
      }
    }
    return caption;
  }

  /** @param {MetricEntry[]} entries @param {Measured} measured @param {Record<string, Measured>} pins */
  function show(entries, measured, pins) {
    const names = Object.keys(pins), head = document.createElement("tr");
    head.append(cell("th", "Metric"), cell("th", "This car"), cell("th", "Usual", "range"),
      ...names.map((name) => cell("th", `${name}, this − ${name}`)));
    const rows = entries.map((entry) => {
      const row = document.createElement("tr"), value = measured.values[entry.name];
      const label = cell("th", entry.label);
      label.setAttribute("scope", "row");
      label.title = entry.definition;
      const unit = entry.unit === "1" || !Number.isFinite(value) ? "" : ` ${entry.unit}`, shown = cell("td", `${written(value)}${unit}`, "value");
      if (!Number.isFinite(value)) shown.title = measured.reasons[entry.name] ?? "";
      row.append(label, shown, bar(entry, value));
      for (const name of names) row.append(compared(entry, pins[name].values[entry.name], value));
      return row;
    });
    const heading = document.createElement("thead"), body = document.createElement("tbody");
    heading.append(head);
    body.append(...rows);
    host.replaceChildren(missing(entries, { "": measured, ...pins }), heading, body);
  }

  return { show, perceived, written };
}
