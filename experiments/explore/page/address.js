/* The state of the page as the part of its address behind #, so that a link repeats it. */

"use strict";

/** @typedef {{law: string, chassis: string, values: Record<string, string | number>}} Shown what is driven; values as changed,
 *  which are texts where an address gives them, since a refusal repeats what was given */

function steerAddress() {
  const PINS = ["A", "B", "C"];

  /** @param {Shown} shown */
  function written(shown) {
    const found = new URLSearchParams({ law: shown.law, chassis: shown.chassis });
    for (const [name, value] of Object.entries(shown.values)) found.set(name, String(value));
    return found.toString();
  }

  /** What a text names, and sentences about what it names that there is not.
      @param {string} text @param {{law: string, chassis: string}} usual @param {{laws: string[], chassis: string[]}} known
      @returns {{shown: Shown, pins: Record<string, string>, remarks: string[]}} */
  function read(text, usual, known) {
    const given = new URLSearchParams(text), remarks = [];
    const shown = { law: usual.law, chassis: usual.chassis, values: /** @type {Record<string, string | number>} */ ({}) };
    /** @type {Record<string, string>} */
    const pins = {};
    for (const [name, value] of given) {
      if (name === "law" || name === "chassis") {
        const allowed = name === "law" ? known.laws : known.chassis;
        if (allowed.includes(value)) shown[name] = value;
        else remarks.push(`This page has no ${name} ${value}; it has ${allowed.join(", ")}.`);
      } else if (PINS.includes(name)) pins[name] = value;
      else shown.values[name] = value;
    }
    return { shown, pins, remarks };
  }

  /** @param {Shown} shown @param {Record<string, Shown>} pins */
  function whole(shown, pins) {
    const found = new URLSearchParams(written(shown));
    for (const [name, pin] of Object.entries(pins)) found.set(name, written(pin));
    return found.toString();
  }

  return { PINS, written, read, whole };
}
