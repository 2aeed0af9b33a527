/* Sliders with number fields, by groups; a refused value is told beside its field and changes nothing. */

"use strict";

/** @typedef {{name: string, group: string, label: string, unit: string, low: number, high: number, value: number,
 *             refusal: string, least: number | null, most: number | null, above: boolean, fixed?: string}} Field fixed: why it cannot be changed */

/** @param {HTMLElement} host @param {(name: string, value: number) => void} onChange */
function steerFields(host, onChange) {
  const STEPS = 200;
  const OPEN = /^(Friction|Drive$|Assist$|Steering$)/;

  /** Why a value is refused; empty where it is not. Python's words, where Python refuses it too.
      @param {Field} field @param {number} value @param {string} text as it was given */
  function refusal(field, value, text) {
    const { least, most, above } = field;
    if (!Number.isFinite(value) || (least !== null && (value < least || (above && value === least))) ||
        (most !== null && value > most)) {
      return field.refusal.replace("{}", text.trim() || "nothing");
    }
    const slack = 1e-12 * (Math.abs(field.low) + Math.abs(field.high));
    if (value < field.low - slack || value > field.high + slack) {
      return `this page goes from ${shortest(field.low)} to ${[shortest(field.high), unit(field)].join(" ").trim()}, got ${text.trim()}`;
    }
    return "";
  }

  /** @param {Field} field */
  const unit = (field) => (field.unit === "1" ? "" : field.unit);

  /** Four digits, as a field shows a value that a slider gave. @param {number} value */
  const shortest = (value) => String(Number(value.toPrecision(4)));

  /** @param {string} tag @param {Record<string, string>} attributes @param {string} [text] */
  function element(tag, attributes, text) {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    if (text !== undefined) made.textContent = text;
    return made;
  }

  /** @param {Field} field @param {number} value @param {HTMLElement} group */
  function add(field, value, group) {
    const id = `field-${field.name}`, row = element("div", { class: "field" });
    const label = element("label", { for: id }, field.label);
    const slider = /** @type {HTMLInputElement} */ (element("input", {
      type: "range", min: "0", max: String(STEPS), step: "1", "aria-label": field.label, "data-name": field.name,
    }));
    const number = /** @type {HTMLInputElement} */ (element("input", {
      type: "text", inputmode: "decimal", id, "data-name": field.name, "aria-describedby": `${id}-refusal`,
    }));
    const told = element("p", { class: "refusal", id: `${id}-refusal`, role: "alert" });
    const span = field.high - field.low;
    const place = (/** @type {number} */ v) => {
      slider.value = String(Math.round(((v - field.low) / span) * STEPS));
      slider.setAttribute("aria-valuetext", `${shortest(v)} ${unit(field)}`.trim());
    };
    number.value = shortest(value);
    place(value);
    slider.disabled = number.disabled = Boolean(field.fixed);
    slider.addEventListener("input", () => {
      const chosen = Number((field.low + (span * Number(slider.value)) / STEPS).toPrecision(4));
      const inside = Math.min(Math.max(chosen, field.low), field.high);
      number.value = shortest(inside);
      slider.setAttribute("aria-valuetext", `${shortest(inside)} ${unit(field)}`.trim());
      tell("");
      onChange(field.name, inside);
    });
    number.addEventListener("input", () => {
      const typed = steerNumbers.typed(number.value), why = refusal(field, typed, number.value);
      tell(why);
      if (why) return;
      place(typed);
      onChange(field.name, typed);
    });
    const tell = (/** @type {string} */ why) => {
      told.textContent = why;
      number.setAttribute("aria-invalid", String(why !== ""));
    };
    row.append(label, slider, number, element("span", { class: "unit" }, unit(field)), told);
    if (field.fixed) row.append(element("p", { class: "fixed" }, field.fixed));
    group.append(row);
  }

  /** Show the fields of a car. @param {Field[]} fields @param {Record<string, number>} values */
  function show(fields, values) {
    const open = new Map([...host.querySelectorAll("details")].map((d) => [d.dataset.group, d.open]));
    host.replaceChildren();
    for (const name of new Set(fields.map((field) => field.group))) {
      const group = /** @type {HTMLDetailsElement} */ (element("details", { "data-group": name }));
      group.open = open.get(name) ?? OPEN.test(name);
      group.append(element("summary", {}, name));
      for (const field of fields.filter((each) => each.group === name)) add(field, values[field.name], group);
      host.append(group);
    }
  }

  /** The values that the fields of a car take, and sentences about those that they refuse.
      @param {Field[]} parameters @param {Record<string, string | number>} values */
  function taken(parameters, values) {
    const remarks = [];
    /** @type {Record<string, number>} */
    const kept = {};
    for (const [name, value] of Object.entries(values)) {
      const field = parameters.find((q) => q.name === name), text = String(value), number = steerNumbers.read(text);
      const why = field ? refusal(field, number, text) : `this page has no ${name} here`;
      if (why) remarks.push(`${why}; left as the car has it.`);
      else kept[name] = number;
    }
    return { kept, remarks };
  }

  return { show, refusal, taken };
}
