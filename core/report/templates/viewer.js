// Tools to turn around: WebGL 1, flat shading, drawn edges, a grid on the ground. Drag turns, wheel or two fingers zoom,
// arrow keys turn, + and - zoom. Lengths in the data are tenths of millimetres; x forward, y left, z up.
"use strict";
(() => {
  const box = document.querySelector(".viewer");
  if (!box) return;
  const canvas = box.querySelector("canvas");
  const choice = box.querySelector("select");
  const caption = box.querySelector("p.caption");
  const tools = JSON.parse(document.getElementById("tools-data").textContent);
  const gl = canvas.getContext("webgl", { antialias: true });
  if (!gl) {
    canvas.hidden = true;
    caption.textContent = "This browser has no WebGL; the pictures of the tools are below.";
    return;
  }

  const GRID = 500;  // 50 mm
  const VERTEX = `
    attribute vec3 at; attribute vec3 normal; attribute vec3 color;
    uniform mat4 view; uniform mat3 turn; varying vec3 shade;
    void main() {
      gl_Position = view * vec4(at, 1.0);
      float light = normal == vec3(0.0) ? 1.0 : 0.55 + 0.45 * abs(dot(turn * normal, normalize(vec3(-0.3, 0.5, 0.8))));
      shade = color * light;
    }`;
  const FRAGMENT = "precision mediump float; varying vec3 shade; void main() { gl_FragColor = vec4(shade, 1.0); }";

  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  gl.useProgram(program);
  const uniform = (name) => gl.getUniformLocation(program, name);
  const places = { view: uniform("view"), turn: uniform("turn") };
  gl.enable(gl.DEPTH_TEST);
  gl.enable(gl.POLYGON_OFFSET_FILL);  // edges lie on faces, and must stay visible
  gl.polygonOffset(1, 1);

  const STRIDE = 9;  // numbers per vertex: place, normal, colour
  const buffers = { faces: null, edges: null, grid: null };
  const counts = { faces: 0, edges: 0, grid: 0 };
  let center = [0, 0, 0], radius = 1000, floor = 0;
  let azimuth = -0.96, elevation = 0.44, zoom = 1;

  const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => { const l = Math.hypot(...a) || 1; return a.map((x) => x / l); };
  const dark = () => matchMedia("(prefers-color-scheme: dark)").matches;

  const upload = (name, numbers) => {
    buffers[name] = buffers[name] || gl.createBuffer();
    counts[name] = numbers.length / STRIDE;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers[name]);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
  };

  const show = (tool) => {
    const faces = [], edges = [];
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const solid of tool.solids) {
      const corner = (i) => solid.vertices.slice(3 * i, 3 * i + 3);
      for (let i = 0; i < solid.faces.length; i += 3) {
        const [a, b, c] = [0, 1, 2].map((k) => corner(solid.faces[i + k]));
        const normal = unit(cross(minus(b, a), minus(c, a)));
        for (const at of [a, b, c]) faces.push(...at, ...normal, ...solid.color);
      }
      const line = solid.color.map((x) => (dark() ? 0.45 + 0.55 * x : 0.35 * x));
      for (const i of solid.edges) edges.push(...corner(i), 0, 0, 0, ...line);
      solid.vertices.forEach((x, i) => { low[i % 3] = Math.min(low[i % 3], x); high[i % 3] = Math.max(high[i % 3], x); });
    }
    center = low.map((x, i) => (x + high[i]) / 2);
    radius = Math.max(1, Math.hypot(...minus(high, low)) / 2);
    floor = low[2];
    upload("faces", faces);
    upload("edges", edges);
    ground(low, high);
    caption.textContent = tool.caption;
    draw();
  };

  const ground = (low, high) => {
    const tint = dark() ? [0.32, 0.35, 0.4] : [0.72, 0.75, 0.79];
    const [x0, y0] = [0, 1].map((i) => GRID * Math.floor(low[i] / GRID - 1));
    const [x1, y1] = [0, 1].map((i) => GRID * Math.ceil(high[i] / GRID + 1));
    const lines = [];
    const add = (...at) => lines.push(...at, 0, 0, 0, ...tint);
    for (let x = x0; x <= x1; x += GRID) { add(x, y0, floor); add(x, y1, floor); }
    for (let y = y0; y <= y1; y += GRID) { add(x0, y, floor); add(x1, y, floor); }
    upload("grid", lines);
  };

  const render = () => {
    const scale = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [Math.round(canvas.clientWidth * scale), Math.round(canvas.clientHeight * scale)];
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);

    const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
    const right = [-sa, ca, 0], up = [-se * ca, -se * sa, ce], toward = [ce * ca, ce * sa, se];
    const away = 3.2 * radius / zoom;  // of the eye from the middle
    const near = Math.max(away - 2.5 * radius, radius * 0.05), far = away + 4 * radius;
    const focal = 1 / Math.tan(0.33) * Math.min(1, width / height);
    const dot = (a) => a[0] * center[0] + a[1] * center[1] + a[2] * center[2];
    const [fx, fy] = [focal * height / width, focal];
    const [p, q] = [(far + near) / (near - far), 2 * far * near / (near - far)];
    const depth = -dot(toward) - away;
    gl.uniformMatrix4fv(places.view, false, [0, 1, 2].flatMap((i) => [
      fx * right[i], fy * up[i], p * toward[i], -toward[i],
    ]).concat([-fx * dot(right), -fy * dot(up), p * depth + q, -depth]));
    gl.uniformMatrix3fv(places.turn, false, [0, 1, 2].flatMap((i) => [right[i], up[i], toward[i]]));

    for (const [name, mode] of [["grid", gl.LINES], ["faces", gl.TRIANGLES], ["edges", gl.LINES]]) {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[name]);
      ["at", "normal", "color"].forEach((attribute, i) => {
        const place = gl.getAttribLocation(program, attribute);
        gl.enableVertexAttribArray(place);
        gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 4 * STRIDE, 12 * i);
      });
      gl.drawArrays(mode, 0, counts[name]);
    }
  };

  let waiting = false;
  const draw = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; render(); });
  };
  const turn = (dx, dy) => {
    azimuth -= dx;
    elevation = Math.max(-1.5, Math.min(1.5, elevation + dy));
    draw();
  };
  const closer = (factor) => { zoom = Math.max(0.3, Math.min(8, zoom * factor)); draw(); };
  const reset = () => { [azimuth, elevation, zoom] = [-0.96, 0.44, 1]; draw(); };

  const fingers = new Map();
  const distance = () => {
    const [a, b] = Array.from(fingers.values());
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const apart = fingers.size === 2 ? distance() : 0;
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (fingers.size === 1) turn((event.clientX - before[0]) * 0.008, (event.clientY - before[1]) * 0.008);
    else if (apart > 0) closer(distance() / apart);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas) return;  // else the page scrolls
    event.preventDefault();
    closer(Math.exp(-event.deltaY * 0.001));
  }, { passive: false });
  const KEYS = {
    ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, -0.1),
    ArrowDown: () => turn(0, 0.1), "+": () => closer(1.2), "=": () => closer(1.2), "-": () => closer(1 / 1.2),
  };
  canvas.addEventListener("keydown", (event) => {
    if (!KEYS[event.key]) return;
    event.preventDefault();
    KEYS[event.key]();
  });
  canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
  canvas.addEventListener("webglcontextrestored", () => location.reload());

  tools.forEach((tool, i) => choice.add(new Option(tool.name, String(i))));
  const chosen = () => show(tools[choice.selectedIndex]);
  choice.addEventListener("change", chosen);
  box.querySelector("button").addEventListener("click", reset);
  for (const card of document.querySelectorAll("[data-tool]")) {
    card.addEventListener("click", () => {
      choice.selectedIndex = Number(card.dataset.tool);
      chosen();
      box.scrollIntoView();
    });
  }
  new ResizeObserver(draw).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", chosen);
  chosen();
})();
