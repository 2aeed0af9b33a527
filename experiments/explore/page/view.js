/* The drive from above, and the instruments that lie over every view: speed, handwheel, hand torque. */

"use strict";

/** @typedef {{time: number, x: number, y: number, yaw: number, roll: number, angle: number, torque: number, left: number,
 *             right: number, speed: number, held: number, acceleration: number, wanted: number, hold: boolean, hands: string}} Moment
 *             of a drive, on the road; SI units */
/** @typedef {{at: (x: number) => number, cones: {x: number, y: number, touched: boolean}[]}} CourseDriven */

/** Size a canvas to its place on the screen. @param {HTMLCanvasElement} canvas */
function steerSized(canvas) {
  const ratio = devicePixelRatio || 1, width = Math.max(canvas.clientWidth, 1), height = Math.max(canvas.clientHeight, 1);
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  return { ratio, width, height };
}

/** @param {any} declared the part "drive" of what Python declares */
function steerView(declared) {
  const { lane, lanes } = declared.road, { size, axles, tracks } = declared;
  const AT = 0.68, NARROW_AT = 0.58;  // place of the car, as a part of the height
  const NARROW = 560, BAND = 10;  // width below which it is a phone [px]; of the grass [m]
  const DASH = 4, SPAN = [14, 1.35, 90];  // dashes as long as gaps [m]; way ahead that is shown, as in steer-env drive
  const style = (/** @type {string} */ name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  /** @param {HTMLCanvasElement} canvas @param {Moment} now @param {{x: number, y: number}[]} trace
      @param {CourseDriven["cones"]} cones */
  function above(canvas, now, trace, cones) {
    const { ratio, width, height } = steerSized(canvas);
    const g = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    const at = width < NARROW ? NARROW_AT : AT, span = Math.min(SPAN[0] + SPAN[1] * Math.max(now.speed, 0), SPAN[2]), scale = (at * height) / span;
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.fillStyle = style("--verge");
    g.fillRect(0, 0, width, height);
    // Along the road is upward, and left is left: a metre ahead is a step up.
    g.setTransform(0, -scale * ratio, -scale * ratio, 0, 0.5 * width * ratio, at * height * ratio);
    if (Math.cos(now.yaw) <= 0.5) g.rotate(-now.yaw);  // the car turns in the picture where it leaves the road
    g.translate(-now.x, -now.y);
    const reach = Math.hypot(width, height) / scale, from = now.x - reach, length = 2 * reach, half = 0.5 * lanes * lane;
    g.fillStyle = style("--band");  // mown in bands, by which the motion is seen
    g.globalAlpha = 0.22;
    for (let x = Math.floor(from / (2 * BAND)) * 2 * BAND; x < from + length; x += 2 * BAND) {
      g.fillRect(x, now.y - reach, BAND, 2 * reach);
    }
    g.globalAlpha = 1;
    g.fillStyle = style("--tarmac");
    g.fillRect(from, -half - 0.5, length, 2 * half + 1);
    g.fillStyle = style("--marking");
    for (const side of [-half, half]) g.fillRect(from, side - 0.08, length, 0.16);
    const first = Math.floor(from / (2 * DASH)) * 2 * DASH;
    for (let k = 1; k < lanes; k++) {
      for (let x = first; x < from + length; x += 2 * DASH) g.fillRect(x, -half + k * lane - 0.06, DASH, 0.12);
    }
    g.strokeStyle = style("--accent");
    g.lineWidth = 0.12;
    g.beginPath();
    for (const { x, y } of trace) g.lineTo(x, y);
    g.stroke();
    for (const cone of cones) {
      g.fillStyle = style(cone.touched ? "--warn" : "--cone");
      g.beginPath();
      g.arc(cone.x, cone.y, cone.touched ? 0.35 : 0.25, 0, 2 * Math.PI);
      g.fill();
    }
    car(g, now);
    instruments(canvas, now, true);
  }

  /** @param {CanvasRenderingContext2D} g @param {Moment} now */
  function car(g, now) {
    g.translate(now.x, now.y);
    g.rotate(now.yaw);
    g.fillStyle = style("--ink");
    for (const [x, angles, track] of [[axles[0], [now.left, now.right], tracks[0]], [-axles[1], [0, 0], tracks[1]]]) {
      for (const side of [0, 1]) {
        g.save();
        g.translate(x, (0.5 - side) * track);
        g.rotate(angles[side]);
        g.fillRect(-0.34, -0.12, 0.68, 0.24);
        g.restore();
      }
    }
    const back = size.centre - 0.5 * size.length, w = size.width - 0.16;
    g.fillStyle = style("--body");
    g.beginPath();
    g.roundRect(back, -0.5 * w, size.length, w, 0.55);
    g.fill();
    g.fillStyle = style("--glass");
    for (const [at, deep, wide] of [[0.56, 0.17, 0.8], [0.12, 0.12, 0.74]]) {  // shares of length and width
      g.beginPath();
      g.roundRect(back + at * size.length, -0.5 * wide * w, deep * size.length, wide * w, 0.2);
      g.fill();
    }
  }

  /** Speed, handwheel and hand torque at the edges. @param {HTMLCanvasElement} canvas @param {Moment} now
      @param {boolean} aside whether the middle is left free */
  function instruments(canvas, now, aside) {
    const { ratio, width, height } = steerSized(canvas);
    const g = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    const narrow = width < NARROW, r = Math.min(0.15 * height, 0.14 * width, aside ? 76 : 92);
    const cx = aside && !narrow ? 138 : 0.5 * width, cy = height - r - 56;
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.fillStyle = style("--plate");
    g.beginPath();
    g.arc(cx, cy, r + 14, 0, 2 * Math.PI);
    g.arc(cx, cy, 0.8 * r, 0, 2 * Math.PI, true);
    g.fill();
    g.beginPath();
    g.roundRect(cx - 120, height - 36, 240, 28, 8);
    g.fill();
    handwheel(g, now, cx, cy, r);
    const full = FULL.find((each) => Math.abs(now.torque) <= each) ?? FULL[FULL.length - 1];
    bar(g, now.torque / full, cx, height - 22, 104);
    const words = (/** @type {string} */ text, /** @type {number} */ x, /** @type {number} */ y, /** @type {number} */ px,
      /** @type {CanvasTextAlign} */ align) => {
      g.font = `${px > 20 ? "bold " : ""}${px}px "Helvetica Neue", Helvetica, Arial, "Liberation Sans", sans-serif`;
      g.textAlign = align;
      g.fillStyle = style("--plate");
      const { width: wide } = g.measureText(text);
      const left = align === "left" ? x : align === "right" ? x - wide : x - 0.5 * wide;
      g.beginPath();
      g.roundRect(left - 6, y - px, wide + 12, 1.32 * px, 5);
      g.fill();
      g.fillStyle = style("--ink");
      g.fillText(text, x, y);
    };
    const large = narrow ? 22 : 30, high = (/** @type {boolean} */ top) => (top ? 18 + large : height - 36);
    words(`${Math.round(3.6 * now.speed)} km/h`, 18, high(aside || narrow), large, "left");
    words(`held at ${Math.round(3.6 * now.held)}`, 18, high(aside || narrow) + 24, 13, "left");
    const torque = `${now.torque < 0 ? "−" : ""}${Math.abs(now.torque).toFixed(1)} N m`;
    words(torque, width - 18, high(narrow), large, "right");
    words(`hand torque, full bar ${full} N m`, width - 18, high(narrow) + 24, 13, "right");
    if (now.hands) words(now.hands, cx, cy - r - 22, 15, "center");
  }
  /** Bonnet and dashboard below a driver's view. @param {HTMLCanvasElement} canvas */
  function inside(canvas) {
    const { width, height } = steerSized(canvas);
    const g = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    for (const [name, rise, over] of /** @type {[string, number, number][]} */ ([["--bonnet", 0.25, 0.62], ["--dash", 0.185, 0.5]])) {
      g.fillStyle = style(name);
      g.beginPath();
      g.moveTo(-0.1 * width, height);
      g.bezierCurveTo(0.05 * width, (1 - rise) * height, (over - 0.1) * width, (1 - 1.06 * rise) * height, 0.8 * width,
        (1 - rise) * height);
      g.quadraticCurveTo(1.02 * width, (1 - 0.94 * rise) * height, 1.1 * width, height);
      g.fill();
    }
  }

  const FULL = [3, 6, 12, 24];  // of the bar [N m]

  /** @param {CanvasRenderingContext2D} g @param {Moment} now @param {number} cx @param {number} cy @param {number} r */
  function handwheel(g, now, cx, cy, r) {
    g.save();
    g.translate(cx, cy);
    if (now.hold) {  // where the hands want it
      g.strokeStyle = style("--accent");
      g.lineWidth = 3;
      g.beginPath();
      g.moveTo(-(r + 4) * Math.sin(now.wanted), -(r + 4) * Math.cos(now.wanted));
      g.lineTo(-(r + 12) * Math.sin(now.wanted), -(r + 12) * Math.cos(now.wanted));
      g.stroke();
    }
    g.rotate(-now.angle);
    g.strokeStyle = style("--ink");
    g.lineWidth = 0.17 * r;
    g.beginPath();
    g.arc(0, 0, 0.9 * r, 0, 2 * Math.PI);
    g.stroke();
    g.lineWidth = 0.15 * r;
    g.beginPath();
    for (const at of [0, 0.5 * Math.PI, Math.PI]) {
      g.moveTo(0, 0.06 * r);
      g.lineTo(0.86 * r * Math.cos(at), 0.86 * r * Math.sin(at));
    }
    g.stroke();
    g.fillStyle = style("--ink");
    g.beginPath();
    g.arc(0, 0.06 * r, 0.27 * r, 0, 2 * Math.PI);
    g.fill();
    g.strokeStyle = style("--accent");
    g.lineWidth = 0.17 * r;
    g.beginPath();
    g.arc(0, 0, 0.9 * r, -0.5 * Math.PI - 0.09, -0.5 * Math.PI + 0.09);
    g.stroke();
    g.restore();
  }

  /** A share from the middle, to the left where it is positive. @param {CanvasRenderingContext2D} g @param {number} share
      @param {number} cx @param {number} cy @param {number} half */
  function bar(g, share, cx, cy, half) {
    const long = half * Math.min(Math.max(share, -1), 1);
    g.fillStyle = style("--line");
    g.fillRect(cx - half, cy - 6, 2 * half, 12);
    g.fillStyle = style("--hand");
    g.fillRect(cx - Math.max(long, 0), cy - 6, Math.abs(long), 12);
    g.fillStyle = style("--ink");
    g.fillRect(cx - 1, cy - 9, 2, 18);
  }

  /** Clear a canvas for instruments that lie over another picture. @param {HTMLCanvasElement} canvas */
  function clear(canvas) {
    const { ratio, width, height } = steerSized(canvas);
    const g = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, width, height);
  }

  return { above, inside, instruments, clear, style };
}

/** The cones of a course, again and again along the road, and which of them the car has touched; as
    steer_env.live.drive.scene. @param {any} declared @param {string} name */
function steerCourse(declared, name) {
  const { first, gap, courses } = declared.road, { size } = declared, { cones, period } = courses[name];
  let shown = -1, last = 0;
  /** @type {{x: number, y: number, touched: boolean}[]} */
  let here = [];

  /** The cones nearest to a pose. @param {number} x @param {number} y @param {number} yaw */
  return function passed(x, y, yaw) {
    const number = Math.max(Math.floor((x - first + 0.5 * gap) / period), 0);
    if (number !== shown || x < last - 0.5 * gap) {  // or the road has begun anew
      shown = number;
      here = cones.map((/** @type {number[]} */ at) => ({ x: at[0] + first + number * period, y: at[1], touched: false }));
    }
    last = x;
    for (const cone of here) {
      const dx = cone.x - x, dy = cone.y - y, c = Math.cos(yaw), s = Math.sin(yaw);
      cone.touched ||= Math.abs(c * dx + s * dy - size.centre) < 0.5 * size.length && Math.abs(c * dy - s * dx) < 0.5 * size.width;
    }
    return here;
  };
}
