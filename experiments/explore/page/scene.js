/* The drive as the driver sees it, by WebGL 2: the ground is computed for every pixel, cones and posts are bodies. */

"use strict";

const STEER_CAMERA = `
uniform vec3 eye; uniform vec3 ahead; uniform vec3 left; uniform vec3 up; uniform vec2 tangent; uniform vec3 haze;
vec3 hazed(vec3 colour, float far) { return mix(colour, haze, 1.0 - exp(-far * far / 90000.0)); }
`;

const STEER_GROUND = [`#version 300 es
in vec2 at; out vec2 place;
void main() { place = at; gl_Position = vec4(at, 0.0, 1.0); }`, `#version 300 es
precision highp float;
${STEER_CAMERA}
uniform vec3 sky; uniform vec3 verge; uniform vec3 tarmac; uniform vec3 marking; uniform vec3 hills;
uniform float lane; uniform float lanes;
in vec2 place; out vec4 colour;
float random(vec2 p) { return fract(sin(dot(p, vec2(127.1, 311.7))) * 43758.5453); }
float noise(vec2 p) {
  vec2 i = floor(p), f = fract(p), s = f * f * (3.0 - 2.0 * f);
  return mix(mix(random(i), random(i + vec2(1, 0)), s.x), mix(random(i + vec2(0, 1)), random(i + 1.0), s.x), s.y);
}
float line(float y, float middle, float wide, float blur) {
  return clamp((0.5 * wide - abs(y - middle)) / blur + 0.5, 0.0, 1.0) * min(1.0, wide / blur);
}
void main() {
  vec3 d = ahead - place.x * tangent.x * left + place.y * tangent.y * up;
  float rise = d.z / length(d.xy), turn = atan(d.y, d.x);
  vec2 to = eye.xy + d.xy * (eye.z / max(-d.z, 1e-4));
  vec2 blur = max(fwidth(to), vec2(1e-4));
  float hill = 0.016 + 0.011 * sin(7.0 * turn + 1.0) + 0.007 * sin(17.0 * turn) + 0.003 * sin(41.0 * turn);
  if (rise >= 0.0) {
    vec3 above = mix(haze, sky, smoothstep(0.0, 0.45, rise));
    float edge = fwidth(rise);
    colour = vec4(mix(mix(haze, hills, 0.2 + 0.6 * clamp(rise / 0.02, 0.0, 1.0)), above, smoothstep(hill - edge, hill + edge, rise)), 1.0);
    return;
  }
  float half_ = 0.5 * lanes * lane, far = length(to - eye.xy), fine = max(blur.x, blur.y);
  float grass = noise(0.7 * to) * exp(-0.9 * fine) + 0.6 * noise(4.0 * to) * exp(-4.0 * fine) + noise(0.09 * to);
  vec3 seen = verge * (0.74 + 0.24 * grass);
  float grain = noise(vec2(9.0, 14.0) * to) * exp(-9.0 * fine) + noise(vec2(0.15, 1.6) * to) * exp(-0.6 * blur.y);
  vec3 road = tarmac * (0.9 + 0.11 * grain);
  float edge = line(to.y, half_, 0.16, blur.y) + line(to.y, -half_, 0.16, blur.y), dashes = 0.0;
  for (float k = 1.0; k < 8.0; k += 1.0) {
    if (k >= lanes) break;
    dashes += line(to.y, k * lane - half_, 0.13, blur.y);
  }
  float along = abs(mod(to.x, 8.0) - 2.0), dash = clamp((2.0 - min(along, 8.0 - along)) / blur.x + 0.5, 0.0, 1.0);
  dash = mix(dash, 0.5, clamp(blur.x / 8.0, 0.0, 1.0));
  road = mix(road, marking, clamp(edge + dashes * dash, 0.0, 1.0));
  seen = mix(seen, road, clamp((half_ + 0.5 - abs(to.y)) / blur.y + 0.5, 0.0, 1.0));
  colour = vec4(hazed(seen, far), 1.0);
}`];

const STEER_BODIES = [`#version 300 es
${STEER_CAMERA}
in vec3 point; in vec3 normal; in vec4 body;
out vec3 tone; out float far; out float high; out float kind;
void main() {
  vec3 scaled = body.z > 1.5 ? point * vec3(0.06, 0.06, 1.0) : point * vec3(0.19, 0.19, 0.5);
  vec3 v = vec3(body.xy, 0.0) + scaled - eye;
  float depth = dot(v, ahead);
  gl_Position = vec4(-dot(v, left) / tangent.x, dot(v, up) / tangent.y, (depth / 400.0 - 1.0) * depth, depth);
  tone = vec3(0.72 + 0.28 * dot(normal, normalize(vec3(-0.5, 0.7, 0.5))));
  far = length(v); high = point.z; kind = body.z;
}`, `#version 300 es
precision highp float;
${STEER_CAMERA}
uniform vec3 cone; uniform vec3 touched; uniform vec3 marking; uniform vec3 ink;
in vec3 tone; in float far; in float high; in float kind; out vec4 colour;
void main() {
  bool band = kind > 1.5 ? high > 0.72 && high < 0.88 : high > 0.42 && high < 0.68;
  vec3 own = kind > 1.5 ? (band ? ink : marking) : (band ? marking : kind > 0.5 ? touched : cone);
  colour = vec4(hazed(own * tone, far), 1.0);
}`];

/** Draw a drive as its driver sees it; null where there is no WebGL 2. @param {HTMLCanvasElement} canvas
    @param {any} declared the part "drive" of what Python declares @param {(name: string) => string} style */
function steerScene(canvas, declared, style) {
  const found = canvas.getContext("webgl2", { antialias: true });
  if (found === null) return null;
  const gl = found;  // not null in what follows
  const { lane, lanes } = declared.road;
  const EYE = { ahead: -0.1, left: 0.36, high: 1.2, down: 0.045 }, FIELD = 0.46;  // [m], [rad]; tangent of half the height
  const POSTS = { spacing: 25, beside: 0.5 * lanes * lane + 1.6, ahead: 300 }, SIDES = 14;

  /** @param {string[]} sources */
  function program(sources) {
    const made = gl.createProgram();
    [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].forEach((kind, k) => {
      const shader = /** @type {WebGLShader} */ (gl.createShader(kind));
      gl.shaderSource(shader, sources[k]);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    });
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(`The driver's view could not be made: ${gl.getProgramInfoLog(made)}`);
    }
    return made;
  }

  /** @param {WebGLProgram} of @param {string} name @param {number} size @param {number} stride @param {number} offset
      @param {number} [divisor] */
  function attribute(of, name, size, stride, offset, divisor = 0) {
    const at = gl.getAttribLocation(of, name);
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, size, gl.FLOAT, false, 4 * stride, 4 * offset);
    gl.vertexAttribDivisor(at, divisor);
  }

  const ground = program(STEER_GROUND), bodies = program(STEER_BODIES);
  const [groundShape, bodyShape] = [gl.createVertexArray(), gl.createVertexArray()];
  gl.bindVertexArray(groundShape);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 3, -1, -1, 3]), gl.STATIC_DRAW);
  attribute(ground, "at", 2, 2, 0);
  const points = [];
  for (let k = 0; k < SIDES; k++) {  // a cone with a blunt top
    const [a, b] = [k, k + 1].map((i) => (2 * Math.PI * i) / SIDES);
    const corner = (/** @type {number} */ t, /** @type {number} */ z, /** @type {number} */ r) =>
      [r * Math.cos(t), r * Math.sin(t), z, Math.cos(t), Math.sin(t), 0.3];
    const [p, q, u, v] = [corner(a, 0, 1), corner(b, 0, 1), corner(a, 1, 0.22), corner(b, 1, 0.22)];
    points.push(...p, ...q, ...u, ...u, ...q, ...v);
  }
  gl.bindVertexArray(bodyShape);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(points), gl.STATIC_DRAW);
  attribute(bodies, "point", 3, 6, 0);
  attribute(bodies, "normal", 3, 6, 3);
  const placed = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, placed);
  attribute(bodies, "body", 4, 4, 0, 1);

  /** @param {string} name */
  function rgb(name) {
    const text = style(name), wide = text.length === 4 ? [...text.slice(1)].map((c) => c + c).join("") : text.slice(1);
    return [0, 2, 4].map((i) => parseInt(wide.slice(i, i + 2), 16) / 255);
  }

  /** @param {Moment} now @param {CourseDriven["cones"]} cones */
  return function draw(now, cones) {
    const { ratio, width, height } = steerSized(canvas);
    const [cy, sy, cr, sr, cd, sd] = [now.yaw, now.roll, EYE.down].flatMap((t) => [Math.cos(t), Math.sin(t)]);
    const ahead = [cy * cd, sy * cd, -sd], flat = [-sy, cy, 0];
    const over = [cy * sd, sy * sd, cd];
    const left = flat.map((v, k) => cr * v + sr * over[k]), up = over.map((v, k) => cr * v - sr * flat[k]);
    const eye = [now.x + EYE.ahead * cy - EYE.left * sy, now.y + EYE.ahead * sy + EYE.left * cy, EYE.high];
    gl.viewport(0, 0, Math.round(width * ratio), Math.round(height * ratio));
    const shared = { eye, ahead, left, up, haze: rgb("--haze"), marking: rgb("--marking") };
    for (const [which, own] of /** @type {[WebGLProgram, Record<string, number[]>][]} */ ([
      [ground, { sky: rgb("--sky"), verge: rgb("--verge"), tarmac: rgb("--tarmac"), hills: rgb("--hills") }],
      [bodies, { cone: rgb("--cone"), touched: rgb("--warn"), ink: rgb("--post") }],
    ])) {
      gl.useProgram(which);
      gl.uniform2f(gl.getUniformLocation(which, "tangent"), (FIELD * width) / height, FIELD);
      for (const [name, value] of Object.entries({ ...shared, ...own })) {
        gl.uniform3fv(gl.getUniformLocation(which, name), value);
      }
    }
    gl.useProgram(ground);
    gl.uniform1f(gl.getUniformLocation(ground, "lane"), lane);
    gl.uniform1f(gl.getUniformLocation(ground, "lanes"), lanes);
    gl.disable(gl.DEPTH_TEST);
    gl.bindVertexArray(groundShape);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    const all = cones.flatMap((each) => [each.x, each.y, Number(each.touched), 0]);
    const first = Math.floor((now.x - POSTS.ahead) / POSTS.spacing) * POSTS.spacing;
    for (let x = first; x < now.x + POSTS.ahead; x += POSTS.spacing) {
      for (const side of [-1, 1]) all.push(x, side * POSTS.beside, 2, 0);
    }
    gl.useProgram(bodies);
    gl.enable(gl.DEPTH_TEST);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.bindVertexArray(bodyShape);
    gl.bindBuffer(gl.ARRAY_BUFFER, placed);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(all), gl.DYNAMIC_DRAW);
    gl.drawArraysInstanced(gl.TRIANGLES, 0, points.length / 6, all.length / 4);
  };
}
