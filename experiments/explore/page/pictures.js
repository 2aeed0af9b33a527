/* Pictures: curves over one another, by uPlot. */

"use strict";

/** @typedef {{x: number[], y: number[], colour: string, wide: boolean}} Curve */
/** @typedef {{caption: string, xLabel: string, yLabel: string, curves: Curve[], range: (scale: "x" | "y") => [number, number]}} Picture */

function steerPictures() {
  /** @param {string} name */
  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  /** @type {(() => Picture | null)[]} */
  const made = [];

  /** The pictures that are shown now. */
  const visible = () => made.flatMap((one) => one() ?? []);

  /** A picture of curves y(x) that may turn back. @param {HTMLElement} host @param {string} xLabel @param {string} yLabel
      @param {number} aspect height over width */
  function picture(host, xLabel, yLabel, aspect) {
    /** @type {any} */
    let plot = null;
    /** @type {Curve[]} */
    let shown = [];

    /** @param {any} u @param {number} k */
    function path(u, k) {
      const { x, y, colour, wide } = shown[k - 1], { ctx } = u;
      ctx.save();
      ctx.beginPath();
      ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
      ctx.clip();
      ctx.beginPath();
      for (let i = 0; i < x.length; i++) {
        const at = [u.valToPos(x[i], "x", true), u.valToPos(y[i], "y", true)];
        if (i) ctx.lineTo(at[0], at[1]);
        else ctx.moveTo(at[0], at[1]);
      }
      ctx.strokeStyle = colour;
      ctx.lineWidth = (wide ? 2 : 1.4) * devicePixelRatio;
      ctx.lineJoin = "round";
      ctx.stroke();
      ctx.restore();
      return null;
    }

    function size() {
      const width = Math.max(host.clientWidth, 160), most = innerWidth > 760 ? 420 : 210;  // a phone shows sliders below
      return { width, height: Math.round(Math.min(Math.max(width * aspect, 170), most)) };
    }

    /** @param {string} label @param {number} room */
    const axis = (label, room) => ({
      label, labelSize: 20, size: room, font: "12px sans-serif", labelFont: "12px sans-serif", stroke: style("--ink"),
      grid: { stroke: style("--line"), width: 1 }, ticks: { show: false }, space: label === xLabel ? 56 : 24,
    });

    /** @param {string} scale @returns {() => [number, number]} */
    const range = (scale) => () => {
      const all = shown.flatMap((curve) => curve[/** @type {"x" | "y"} */ (scale)]);
      const low = Math.min(...all), high = Math.max(...all), room = 0.04 * (high - low) || 1;
      return scale === "x" && xLabel.startsWith("time") ? [low, high] : [low - room, high + room];
    };

    function make() {
      plot?.destroy();
      plot = new (/** @type {any} */ (globalThis).uPlot)({
        mode: 2, ...size(), legend: { show: false }, cursor: { show: false },
        scales: { x: { time: false, range: range("x") }, y: { range: range("y") } },
        axes: [axis(xLabel, 32), axis(yLabel, 44)],
        series: [null, ...shown.map(() => ({ paths: path, facets: ["x", "y"].map((scale) => ({ scale, auto: true })) }))],
      }, data(), host);
    }

    const data = () => [null, ...shown.map(({ x, y }) => [x, y])];

    made.push(() => (host.offsetParent === null || !plot ? null : {
      caption: document.getElementById(host.getAttribute("aria-labelledby") ?? "")?.textContent ?? "",
      xLabel, yLabel, curves: shown, range: (scale) => range(scale)(),
    }));
    new ResizeObserver(() => {
      if (plot && Math.abs(plot.width - host.clientWidth) > 1) plot.setSize(size());
    }).observe(host);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => plot && make());

    /** @param {Curve[]} curves */
    return function draw(curves) {
      const same = plot && curves.length === shown.length;
      shown = curves;
      if (same) plot.setData(data());
      else make();
    };
  }

  return { picture, visible, style };
}
