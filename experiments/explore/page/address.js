/* The state of the page as the part of its address behind #, so that a link repeats it. */

"use strict";

/** @typedef {{law: string, chassis: string, values: Record<string, string | number>}} CarShown a car; values as changed,
 *  which are texts where an address gives them, since a refusal repeats what was given */
/** @typedef {CarShown & {manoeuvre: string}} Shown what is driven */
/** @typedef {{law: string, chassis: string, manoeuvre: string}} Choices */

/** @param {any} declared */
function steerAddress(declared) {
  const PINS = ["A", "B", "C"];
  /** What there is to choose from; a page begins with the first. @type {Record<keyof Choices, string[]>} */
  const known = {
    law: declared.laws.map((/** @type {any} */ law) => law.name), chassis: declared.chassis,
    manoeuvre: Object.keys(declared.drives.manoeuvres),
  };
  /** What the page calls a law. @type {Record<string, string>} */
  const labels = Object.fromEntries(declared.laws.map((/** @type {any} */ law) => [law.name, law.label]));
  const usual = { law: known.law[0], chassis: known.chassis[0], manoeuvre: known.manoeuvre[0] };

  /** @param {CarShown} shown @param {Record<string, string>} more */
  function written(shown, more = {}) {
    const found = new URLSearchParams({ law: shown.law, chassis: shown.chassis, ...more });
    for (const [name, value] of Object.entries(shown.values)) found.set(name, String(value));
    return found;
  }

  /** What a text names, and sentences about what it names that there is not.
      @param {string} text @param {Choices} otherwise @returns {{shown: Shown, pins: Record<string, string>, remarks: string[]}} */
  function read(text, otherwise = usual) {
    const given = new URLSearchParams(text), remarks = [], { law, chassis, manoeuvre } = otherwise;
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

  return { PINS, known, labels, written, read, whole };
}
