/* The recording of a drive, as steer_env.live.drive.log keeps it: a row is the mean of five samples, at their middle. */

"use strict";

/** @param {any} declared the part "drive" of what Python declares */
function steerLog(declared) {
  const { samples: SAMPLES, kept, own, sums, last, inputs, channels, units } = declared.recording;
  /** @type {[string, string][]} */
  const columns = [...own, ...inputs.map((/** @type {string} */ name) => [name, name === "target_speed" ? "m/s" : "1"]),
    ...channels];
  const names = columns.map(([name]) => name), width = columns.length;
  const [x, y, yaw] = ["x", "y", "yaw_angle"].map((name) => names.indexOf(name));
  const summed = sums.map((/** @type {string} */ name) => names.indexOf(name));
  const atEnd = last.map((/** @type {string} */ name) => names.indexOf(name));
  const spacing = SAMPLES * declared.sampleTime, most = Math.round(kept / spacing);
  const size = (/** @type {string} */ unit) => units[unit][1];

  /** Forward speed from the way between two rows, along the heading of one: not every chassis reports its speed [m/s].
      @param {Float64Array} a @param {Float64Array} b @param {Float64Array} along */
  function forward(a, b, along) {
    const heading = along[1 + yaw];
    return ((b[1 + x] - a[1 + x]) * Math.cos(heading) + (b[1 + y] - a[1 + y]) * Math.sin(heading)) / spacing;
  }

  class Log {
    constructor() {
      /** @type {Float64Array[]} */
      this.rows = [];  // each with its time first and the forward speed last
      this.samples = 0;
      this.sum = new Float64Array(width);
    }

    /** Begin anew. */
    begin() {
      this.rows = [];
      this.samples = 0;
      this.sum.fill(0);
    }

    /** Take samples, one after another. @param {Float64Array} given */
    add(given) {
      for (let from = 0; from < given.length; from += width) {
        const sample = given.subarray(from, from + width);
        for (let k = 0; k < width; k++) this.sum[k] += sample[k];
        this.samples += 1;
        if (this.samples % SAMPLES === 0) this.row(sample);
      }
    }

    /** Close a row with its last sample. @param {Float64Array} sample */
    row(sample) {
      const row = new Float64Array(width + 2), values = row.subarray(1, width + 1);
      row[0] = declared.sampleTime * (this.samples - (SAMPLES - 1) / 2);
      values.set(this.sum.map((value) => value / SAMPLES));
      for (const k of summed) values[k] = this.sum[k];
      for (const k of atEnd) values[k] = sample[k];
      const before = this.rows.at(-1) ?? null;
      row[width + 1] = before === null ? NaN : forward(before, row, row);
      if (this.rows.length === 1 && before) before[width + 1] = forward(before, row, before);
      this.rows.push(row);
      if (this.rows.length > most) this.rows = this.rows.slice(most >> 3);
      this.sum.fill(0);
    }

    /** Forward speed at the last row [m/s]; NaN before the second. */
    speed() {
      return this.rows.at(-1)?.[width + 1] ?? NaN;
    }

    /** The recording as a CSV file. @param {Record<string, any>} meta @param {boolean} held whether inputs of a speed that
        is held are left out, as no car has them */
    text(meta, held) {
      const left = (/** @type {string} */ name) => held && inputs.includes(name);
      const places = columns.map((_, k) => k).filter((k) => !left(names[k])), all = [...columns, ["vehicle_speed", "m/s"]];
      places.push(width);
      const head = Object.entries(meta).map(([key, value]) => `# ${key}: ${JSON.stringify(value)}\n`);
      const header = ["time_s", ...places.map((k) => `${all[k][0]}_${units[all[k][1]][0]}`)];
      const scales = places.map((k) => size(all[k][1]));
      const lines = this.rows.map((row) =>
        [row[0].toFixed(6), ...places.map((k, j) => String(Number((row[k + 1] / scales[j]).toPrecision(7))))].join(","));
      return `${head.join("")}${header.join(",")}\n${lines.join("\n")}\n`;
    }
  }

  return { Log, width, names, place: (/** @type {string} */ name) => names.indexOf(name) };
}
