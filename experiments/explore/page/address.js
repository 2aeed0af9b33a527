/* The state of the page as the part of its address behind #, so that a link repeats it. */

"use strict";

/** @typedef {{law: string, chassis: string, values: Record<string, string | number>}} CarShown a car; values as changed,
 *  which are texts where an address gives them, since a refusal repeats what was given */
/** @typedef {CarShown & {manoeuvre: string}} Shown what is driven */
/** @typedef {{law: string, chassis: string, manoeuvre: string}} Choices */

function steerAddress() {
  const PINS = ["A", "B", "C"];

  /** @param {CarShown} shown @param {Record<string, string>} more */
  function written(shown, more = {}) {
    const found = new URLSearchParams({ law: shown.law, chassis: shown.chassis, ...more });
    for (const [name, value] of Object.entries(shown.values)) found.set(name, String(value));
    return found;
  }

  /** What a text names, and sentences about what it names that there is not.
      @param {string} text @param {Choices} usual @param {Record<keyof Choices, string[]>} known
      @returns {{shown: Shown, pins: Record<string, string>, remarks: string[]}} */
  function read(text, usual, known) {
    const given = new URLSearchParams(text), remarks = [], { law, chassis, manoeuvre } = usual;
    const shown = { law, chassis, manoeuvre, values: /** @type {Record<string, string | number>} */ ({}) };
    /** @type {Record<string, string>} */
    const pins = {};
    for (const [name, value] of given) {
      if (name === "law" || name === "chassis" || name === "manoeuvre") {
        const allowed = known[name];
        if (allowed.includes(value)) shown[name] = value;
        else remarks.push(`This page has no ${name} ${value}; it has ${allowed.join(", ")}.`);
      } else if (PINS.includes(name)) pins[name] = value;
      else shown.values[name] = value;
    }
    return { shown, pins, remarks };
  }

  /** @param {Shown} shown @param {Record<string, CarShown>} pins */
  function whole(shown, pins) {
    const found = written(shown, { manoeuvre: shown.manoeuvre });
    for (const [name, pin] of Object.entries(pins)) found.set(name, written(pin).toString());
    return found.toString();
  }

  return { PINS, written, read, whole };
}
