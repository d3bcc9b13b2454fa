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
    caption.textContent = "This browser has no WebGL, which shows the tools.";
    return;
  }

  const GRID = 500;  // 50 mm
  const VERTEX = `
    attribute vec3 at; attribute vec3 normal; attribute vec3 color;
    uniform mat4 view; uniform mat4 turn; varying vec3 shade;
    void main() {
      gl_Position = view * vec4(at, 1.0);
      float light = normal == vec3(0.0) ? 1.0 : 0.55 + 0.45 * abs(dot(mat3(turn) * normal, normalize(vec3(-0.3, 0.5, 0.8))));
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
  gl.enable(gl.DEPTH_TEST);
  gl.enable(gl.POLYGON_OFFSET_FILL);  // edges lie on faces, and must stay visible
  gl.polygonOffset(1, 1);

  const STRIDE = 9;  // numbers per vertex: place, normal, colour
  const buffers = [gl.LINES, gl.TRIANGLES].map((mode) => ({ mode, buffer: gl.createBuffer(), count: 0 }));
  let center = [0, 0, 0], radius = 1000;
  let azimuth, elevation, zoom;  // degrees

  const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => { const l = Math.hypot(...a) || 1; return a.map((x) => x / l); };
  const dark = () => matchMedia("(prefers-color-scheme: dark)").matches;

  const show = (tool) => {
    const faces = [], lines = [];
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const solid of tool.solids) {
      const corner = (i) => solid.vertices.slice(3 * i, 3 * i + 3);
      for (let i = 0; i < solid.faces.length; i += 3) {
        const [a, b, c] = [0, 1, 2].map((k) => corner(solid.faces[i + k]));
        const normal = unit(cross(minus(b, a), minus(c, a)));
        for (const at of [a, b, c]) faces.push(...at, ...normal, ...solid.color);
      }
      const line = solid.color.map((x) => (dark() ? 0.45 + 0.55 * x : 0.35 * x));
      for (const i of solid.edges) lines.push(...corner(i), 0, 0, 0, ...line);
      solid.vertices.forEach((x, i) => { low[i % 3] = Math.min(low[i % 3], x); high[i % 3] = Math.max(high[i % 3], x); });
    }
    center = low.map((x, i) => (x + high[i]) / 2);
    radius = Math.max(1, Math.hypot(...minus(high, low)) / 2);
    lines.push(...grid(low, high));
    [lines, faces].forEach((numbers, i) => {
      buffers[i].count = numbers.length / STRIDE;
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[i].buffer);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
    });
    caption.textContent = tool.caption;
    draw();
  };

  const grid = (low, high) => {
    const tint = dark() ? [0.32, 0.35, 0.4] : [0.72, 0.75, 0.79];
    const [x0, y0] = [0, 1].map((i) => GRID * Math.floor(low[i] / GRID - 1));
    const [x1, y1] = [0, 1].map((i) => GRID * Math.ceil(high[i] / GRID + 1));
    const lines = [];
    const add = (x, y) => lines.push(x, y, low[2], 0, 0, 0, ...tint);
    for (let x = x0; x <= x1; x += GRID) { add(x, y0); add(x, y1); }
    for (let y = y0; y <= y1; y += GRID) { add(x0, y); add(x1, y); }
    return lines;
  };

  const render = () => {
    const scale = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [Math.round(canvas.clientWidth * scale), Math.round(canvas.clientHeight * scale)];
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);

    const away = 3.2 * radius / zoom;  // of the eye from the middle
    const near = Math.max(away - 2.5 * radius, radius * 0.05), far = away + 4 * radius;
    const focal = 1 / Math.tan(0.33) * Math.min(1, width / height);
    const [p, q] = [(far + near) / (near - far), 2 * far * near / (near - far)];
    const lens = new DOMMatrix([focal * height / width, 0, 0, 0, 0, focal, 0, 0, 0, 0, p, -1, 0, 0, q, 0]);
    const turned = new DOMMatrix().rotateAxisAngle(1, 0, 0, elevation - 90).rotateAxisAngle(0, 0, 1, -90 - azimuth);
    const view = lens.translate(0, 0, -away).multiply(turned).translate(...center.map((x) => -x));
    for (const [name, matrix] of [["view", view], ["turn", turned]]) {
      gl.uniformMatrix4fv(gl.getUniformLocation(program, name), false, matrix.toFloat32Array());
    }
    for (const { mode, buffer, count } of buffers) {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      ["at", "normal", "color"].forEach((attribute, i) => {
        const place = gl.getAttribLocation(program, attribute);
        gl.enableVertexAttribArray(place);
        gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 4 * STRIDE, 12 * i);
      });
      gl.drawArrays(mode, 0, count);
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
    elevation = Math.max(-86, Math.min(86, elevation + dy));
    draw();
  };
  const closer = (factor) => { zoom = Math.max(0.3, Math.min(8, zoom * factor)); draw(); };
  const reset = () => { [azimuth, elevation, zoom] = [-55, 25, 1]; draw(); };

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
    if (fingers.size === 1) turn((event.clientX - before[0]) * 0.46, (event.clientY - before[1]) * 0.46);
    else if (apart > 0) closer(distance() / apart);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas) return;  // else the page scrolls
    event.preventDefault();
    closer(Math.exp(-event.deltaY * 0.001));
  }, { passive: false });
  const KEYS = {
    ArrowLeft: () => turn(-6, 0), ArrowRight: () => turn(6, 0), ArrowUp: () => turn(0, -6),
    ArrowDown: () => turn(0, 6), "+": () => closer(1.2), "=": () => closer(1.2), "-": () => closer(1 / 1.2),
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
  new ResizeObserver(draw).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", chosen);
  reset();
  chosen();
})();
