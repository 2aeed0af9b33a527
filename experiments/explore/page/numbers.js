/* Numbers as Python's float reads them, which takes neither 0x10 nor an empty text, and as people type them. */

"use strict";

const steerNumbers = (() => {
  const DIGITS = "\\d+(?:_\\d+)*";
  const NUMBER = new RegExp(`^[+-]?(?:${DIGITS}\\.?(?:${DIGITS})?|\\.${DIGITS})(?:e[+-]?${DIGITS})?$`, "i");

  /** The number that a text is for Python; NaN where it is none, and for "nan". @param {string} text */
  function read(text) {
    const plain = text.trim();
    if (NUMBER.test(plain)) return Number(plain.replaceAll("_", ""));
    const infinite = /^([+-]?)inf(?:inity)?$/i.exec(plain);
    return infinite ? (infinite[1] === "-" ? -Infinity : Infinity) : NaN;
  }

  /** A number as typed: a comma may stand for the point, and a typographic minus for the hyphen. @param {string} text */
  function typed(text) {
    const plain = text.replace("\u2212", "-");
    return read(/^[^.,]*,[^.,]*$/.test(plain) ? plain.replace(",", ".") : plain);
  }

  return { read, typed };
})();
