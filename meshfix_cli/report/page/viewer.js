"use strict";
// Draws the scene: elements, their facets and edges with an orthographic camera that turns around a point.
(() => {
  const FILL = `#version 300 es
    uniform mat4 camera;
    layout(location = 0) in vec3 position;
    out vec3 seen;
    void main() {
      gl_Position = camera * vec4(position, 1);
      seen = gl_Position.xyz;
    }`;
  const SHADE = `#version 300 es
    precision highp float;
    uniform vec4 colour;
    uniform float rim, light;
    uniform vec3 extent;
    in vec3 seen;
    out vec4 pixel;
    void main() {
      vec3 p = seen * extent;
      vec3 normal = cross(dFdx(p), dFdy(p));
      float facing = abs(normal.z) / max(length(normal), 1e-30);
      float alpha = min(colour.a + rim * pow(1.0 - facing, 2.0), 1.0);
      pixel = vec4(colour.rgb * mix(1.0, 0.6 + 0.4 * facing, light) * alpha, alpha);
    }`;
  // An edge is a strip of four corners: `corner` tells which end and which side.
  const EDGE = `#version 300 es
    uniform mat4 camera;
    uniform vec2 pixels;
    uniform float width;
    layout(location = 0) in vec2 corner;
    layout(location = 1) in vec3 start;
    layout(location = 2) in vec3 end;
    void main() {
      vec4 a = camera * vec4(start, 1), b = camera * vec4(end, 1);
      vec2 along = (b.xy - a.xy) * pixels;
      float size = length(along);
      vec2 across = size > 0.0 ? vec2(-along.y, along.x) / size : vec2(0);
      gl_Position = mix(a, b, corner.x);
      gl_Position.xy += across * corner.y * width / pixels;
      gl_Position.z -= 1e-5;
    }`;
  const RING = `#version 300 es
    uniform mat4 camera;
    uniform float size;
    layout(location = 0) in vec3 position;
    void main() {
      gl_Position = vec4((camera * vec4(position, 1)).xy, 0, 1);
      gl_PointSize = size;
    }`;
  const CIRCLE = `#version 300 es
    precision highp float;
    uniform vec4 colour;
    out vec4 pixel;
    void main() {
      float r = length(gl_PointCoord - 0.5) * 2.0;
      float alpha = smoothstep(1.0, 0.9, r) * smoothstep(0.75, 0.85, r);
      pixel = vec4(colour.rgb, 1) * alpha;
    }`;
  const PLAIN = `#version 300 es
    precision highp float;
    uniform vec4 colour;
    out vec4 pixel;
    void main() { pixel = vec4(colour.rgb * colour.a, colour.a); }`;

  const MOST_OUTLINED = 5000; // solids: the edges of more would hide their colour
  const MOST_EDGES = 30000; // of a boundary in space, for the same reason
  const OFF = ["near", "off", "beyond"]; // the shape
  const STEP = Math.PI / 24;
  const NEAREST = 1e5;
  const START = { yaw: -0.6, pitch: 0.45, zoom: 1, centre: [0, 0, 0] };

  const canvas = document.getElementById("canvas");
  const scene = JSON.parse(document.getElementById("scene").textContent);
  const flat = scene.dimension === 2;
  const radios = [...document.querySelectorAll("input[name=stage]")];
  const pointers = new Map();
  let gl, programs, layers, strip, frame = 0;
  let view = { ...START };
  let radius = 1; // of all that is drawn; the mesh has the radius 1

  // What the numbers are: the page holds them as base64.

  function decoded(text) {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
    return bytes.buffer;
  }

  function points(number) {
    const flatOnes = new Float32Array(decoded(scene.points[number]));
    if (!flat) return flatOnes;
    const result = new Float32Array(flatOnes.length / 2 * 3);
    for (let i = 0; i < flatOnes.length / 2; i++) result.set([flatOnes[2 * i], flatOnes[2 * i + 1], 0], 3 * i);
    return result;
  }

  // Corners in pairs or triples of all elements; `once` takes one of the two directions in which the edges of an
  // oriented surface occur.
  function picked(rows, corners, groups, once = false) {
    const result = [];
    for (let i = 0; i < rows.length; i += corners)
      for (const group of groups)
        if (!once || rows[i + group[0]] < rows[i + group[1]]) for (const corner of group) result.push(rows[i + corner]);
    return result;
  }

  // The triangles of an element's sides.
  function halves({ sides }) {
    return sides.flatMap((side) => side.slice(2).map((corner, i) => [side[0], side[i + 1], corner]));
  }

  // Pairs of corners, each once; a polygon's go round it.
  function edges({ sides, edges }) {
    if (edges) return edges;
    const around = sides.flatMap((side) => side.map((corner, i) => [corner, side[(i + 1) % side.length]]));
    if (sides.length > 1) return around.filter(([a, b]) => a < b);
    return sides[0].length > 2 ? around : around.slice(0, 1);
  }

  function edgesOf(layer, rows) {
    const { role } = layer, shape = scene.shapes[layer.shape], count = rows.length / shape.corners;
    const shared = role === "cells" || (role === "boundary" && shape.corners > 2);
    if (role === "boundary" && !flat && count * shape.corners / 2 > MOST_EDGES) return [];
    if (shape.sides.length > 1 && count > MOST_OUTLINED) return [];
    return picked(rows, shape.corners, edges(shape), shared);
  }

  // What the graphics card is given.

  function compiled(vertex, fragment) {
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost())
      throw new Error(gl.getProgramInfoLog(program));
    return program;
  }

  function attribute(place, data, size, divisor = 0) {
    gl.bindBuffer(gl.ARRAY_BUFFER, data);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, gl.FLOAT, false, 0, 0);
    gl.vertexAttribDivisor(place, divisor);
  }

  function buffer(values, target = gl.ARRAY_BUFFER) {
    const made = gl.createBuffer();
    gl.bindBuffer(target, made);
    gl.bufferData(target, values, gl.STATIC_DRAW);
    return made;
  }

  function filled(data, rows) {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    attribute(0, data, 3);
    buffer(new Uint32Array(rows), gl.ELEMENT_ARRAY_BUFFER);
    return { array, count: rows.length };
  }

  function outlined(coordinates, rows) {
    const ends = [new Float32Array(rows.length / 2 * 3), new Float32Array(rows.length / 2 * 3)];
    rows.forEach((row, i) => ends[i % 2].set(coordinates.subarray(3 * row, 3 * row + 3), 3 * (i >> 1)));
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    attribute(0, strip, 2);
    ends.forEach((values, end) => attribute(end + 1, buffer(values), 3, 1));
    return { array, count: rows.length / 2 };
  }

  function ringed(coordinates, rows, corners) {
    const centres = new Float32Array(rows.length / corners * 3);
    rows.forEach((row, i) => {
      for (let k = 0; k < 3; k++) centres[3 * Math.floor(i / corners) + k] += coordinates[3 * row + k] / corners;
    });
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    attribute(0, buffer(centres), 3);
    return { array, count: centres.length / 3 };
  }

  function farthest(values) {
    let most = 0;
    for (let i = 0; i < values.length; i += 3)
      most = Math.max(most, Math.hypot(values[i], values[i + 1], values[i + 2]));
    return most;
  }

  function loaded() {
    const coordinates = scene.points.map((_, number) => points(number));
    radius = coordinates.reduce((most, values) => Math.max(most, farthest(values)), 1);
    const buffers = coordinates.map((values) => buffer(values));
    return scene.layers.map((layer) => {
      const { wide, data } = scene.rows[layer.rows];
      const rows = new (wide ? Uint32Array : Uint16Array)(decoded(data)), here = coordinates[layer.points];
      const shape = scene.shapes[layer.shape];
      return {
        ...layer,
        fill: filled(buffers[layer.points], picked(rows, shape.corners, halves(shape))),
        lines: outlined(here, edgesOf(layer, rows)),
        rings: layer.role === "worst" ? ringed(here, rows, shape.corners) : { count: 0 },
      };
    });
  }

  // The camera.

  function size() {
    const ratio = Math.min(devicePixelRatio || 1, 2);
    return [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio), ratio];
  }

  // To the right, up, and towards the viewer.
  function axes({ yaw, pitch } = view) {
    const [cy, sy] = [Math.cos(yaw), Math.sin(yaw)], [cp, sp] = [Math.cos(pitch), Math.sin(pitch)];
    return flat ? [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
      : [[cy, sy, 0], [-sy * sp, cy * sp, cp], [sy * cp, -cy * cp, sp]];
  }

  // Half the picture's width and height, in sizes of the mesh; at first its box fills it.
  function extent() {
    const tall = canvas.clientHeight / canvas.clientWidth, box = [...scene.extent, 0];
    const [w, h] = axes(START).map((axis) =>
      1.08 / view.zoom * axis.reduce((sum, x, k) => sum + Math.abs(x) * box[k], 0));
    return h / w > tall ? [h / tall, h] : [w, w * tall];
  }

  // Half of what is seen in front and behind: all of it.
  function depth() {
    return 2 * radius + Math.hypot(...view.centre);
  }

  function camera() {
    const [right, up, back] = axes(), [w, h] = extent();
    const rows = [right.map((x) => x / w), up.map((x) => x / h), back.map((x) => -x / depth())];
    const matrix = [];
    for (let k = 0; k < 3; k++) matrix.push(rows[0][k], rows[1][k], rows[2][k], 0);
    const moved = rows.map((row) => -row.reduce((sum, x, k) => sum + x * view.centre[k], 0));
    return new Float32Array([...matrix, ...moved, 1]);
  }

  // The picture.

  function colours() {
    const style = getComputedStyle(document.documentElement);
    return (name, alpha = 1) => {
      const hex = parseInt(style.getPropertyValue(`--${name}`).trim().slice(1), 16);
      return [(hex >> 16) / 255, (hex >> 8 & 255) / 255, (hex & 255) / 255, alpha];
    };
  }

  function use(program, colour, values = {}) {
    gl.useProgram(program);
    gl.uniform4fv(gl.getUniformLocation(program, "colour"), colour);
    gl.uniformMatrix4fv(gl.getUniformLocation(program, "camera"), false, camera());
    for (const [name, value] of Object.entries(values))
      gl[`uniform${[].concat(value).length}fv`](gl.getUniformLocation(program, name), [].concat(value));
  }

  function drawFill(layer, colour, rim, light) {
    if (!layer.fill.count) return;
    use(programs.fill, colour, { rim, light, extent: [...extent(), depth()] });
    gl.bindVertexArray(layer.fill.array);
    gl.drawElements(gl.TRIANGLES, layer.fill.count, gl.UNSIGNED_INT, 0);
  }

  function drawLines(layer, colour, width) {
    if (!layer.lines.count) return;
    const [wide, tall, ratio] = size();
    use(programs.edge, colour, { width: width * ratio, pixels: [wide, tall] });
    gl.bindVertexArray(layer.lines.array);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, layer.lines.count);
  }

  function drawRings(layer, colour) {
    if (!layer.rings.count) return;
    use(programs.ring, colour, { size: 22 * size()[2] });
    gl.bindVertexArray(layer.rings.array);
    gl.drawArrays(gl.POINTS, 0, layer.rings.count);
  }

  function shown() {
    const stage = Number(radios.find((radio) => radio.checked).value);
    const here = layers.filter((layer) => layer.stage === null || layer.stage === stage);
    return (role) => here.filter((layer) => layer.role === role);
  }

  function drawFlat(of, colour) {
    gl.disable(gl.DEPTH_TEST);
    for (const layer of of("cells")) {
      drawFill(layer, colour("cell"), 0, 0);
      drawLines(layer, colour("body", 0.9), 1);
    }
    for (const layer of of("worst")) {
      drawFill(layer, colour("worst", 0.6), 0, 0);
      drawLines(layer, colour("ink"), 1.2);
    }
    for (const layer of of("inverted")) {
      drawFill(layer, colour("inverted", 0.55), 0, 0);
      drawLines(layer, colour("inverted"), 1.2);
    }
    for (const layer of of("boundary")) drawLines(layer, colour("ink"), 1.6);
    for (const role of OFF) for (const layer of of(role)) drawLines(layer, colour(role), 4);
  }

  function drawSolid(of, colour) {
    gl.enable(gl.DEPTH_TEST);
    for (const layer of [...of("worst"), ...of("inverted")]) drawFill(layer, colour(layer.role), 0, 1);
    for (const layer of [...of("inverted"), ...of("worst")]) drawLines(layer, colour("ink", 0.7), 1);
    gl.depthMask(false);
    for (const layer of of("creases")) drawLines(layer, colour("ink", 0.55), 1.3);
    for (const role of OFF) for (const layer of of(role)) drawFill(layer, colour(role, 0.35), 0, 1);
    for (const layer of of("boundary")) {
      drawLines(layer, colour("body", 0.16), 1);
      drawFill(layer, colour("body", 0.1), 0.45, 0);
    }
    gl.depthMask(true);
    gl.disable(gl.DEPTH_TEST);
  }

  function draw() {
    frame = 0;
    [canvas.width, canvas.height] = size();
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const of = shown(), colour = colours();
    (flat ? drawFlat : drawSolid)(of, colour);
    for (const layer of of("worst")) drawRings(layer, colour("ink"));
    canvas.dataset.drawn = Number(canvas.dataset.drawn || 0) + 1;
  }

  function redraw() {
    if (gl && !frame) frame = requestAnimationFrame(draw);
  }

  // What moves the camera.

  function turn(across, down) {
    view.yaw -= across;
    view.pitch = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, view.pitch + down));
  }

  // By a share of the half width and half height.
  function shift(across, down) {
    const [right, up] = axes(), [w, h] = extent();
    view.centre = view.centre.map((x, k) => x - right[k] * across * w + up[k] * down * h);
  }

  function within(factor) {
    return Math.max(0.2 / radius, Math.min(NEAREST, factor));
  }

  // The point under (x, y), from -1 to 1, stays where it is.
  function zoom(factor, x = 0, y = 0) {
    const next = within(view.zoom * factor), change = view.zoom / next;
    shift(x * (change - 1), y * (change - 1));
    view.zoom = next;
  }

  function place(event) {
    const box = canvas.getBoundingClientRect();
    return [2 * (event.clientX - box.left) / box.width - 1, 2 * (event.clientY - box.top) / box.height - 1];
  }

  function pressed(key) {
    const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[key];
    if (arrow && flat) shift(-arrow[0] / 8, -arrow[1] / 8);
    else if (arrow) turn(arrow[0] * STEP, arrow[1] * STEP);
    else if (key === "+" || key === "=") zoom(1.25);
    else if (key === "-" || key === "_") zoom(0.8);
    else if (key === "0" || key === "Home") view = { ...START };
    else return false;
    redraw();
    return true;
  }

  function drag(event) {
    const before = [...pointers.values()];
    if (!pointers.has(event.pointerId)) return;
    pointers.set(event.pointerId, place(event));
    const after = [...pointers.values()];
    const middle = (ends) => [0, 1].map((k) => ends.reduce((sum, end) => sum + end[k], 0) / ends.length);
    const apart = (ends) => Math.hypot((ends[0][0] - ends[1][0]) * canvas.clientWidth,
      (ends[0][1] - ends[1][1]) * canvas.clientHeight);
    const [from, to] = [middle(before), middle(after)], [across, down] = [to[0] - from[0], to[1] - from[1]];
    if (flat || after.length > 1 || event.shiftKey || event.buttons > 1) shift(across, down);
    else turn(across * 2, down * 2);
    if (after.length === 2 && apart(before) > 0) zoom(apart(after) / apart(before), ...to);
    redraw();
  }

  function hold(event) {
    pointers.set(event.pointerId, place(event));
    canvas.setPointerCapture(event.pointerId);
    canvas.classList.add("dragged");
  }

  function release(event) {
    pointers.delete(event.pointerId);
    if (!pointers.size) canvas.classList.remove("dragged");
  }

  function choose(radio, more = "") {
    radio.checked = true;
    document.getElementById("drawn").textContent = radio.dataset.drawn + more;
    redraw();
  }

  function show(button) {
    const [x, y, z, reach] = button.dataset.place.split(" ").map(Number);
    view.centre = [x, y, z];
    view.zoom = within(0.25 / reach);
    choose(radios[radios.length - 1], `; in the middle ${button.dataset.element}`);
    canvas.scrollIntoView({ block: "center" });
    canvas.focus({ preventScroll: true });
  }

  function listen() {
    canvas.addEventListener("pointerdown", hold);
    canvas.addEventListener("pointermove", drag);
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      zoom(Math.exp(-Math.max(-100, Math.min(100, event.deltaY)) / 400), ...place(event));
      redraw();
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      if (!event.ctrlKey && !event.metaKey && !event.altKey && pressed(event.key)) event.preventDefault();
    });
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", prepare);
    for (const button of document.querySelectorAll("[data-key]"))
      button.addEventListener("click", () => pressed(button.dataset.key));
    for (const button of document.querySelectorAll("[data-place]"))
      button.addEventListener("click", () => show(button));
    for (const radio of radios) radio.addEventListener("change", () => choose(radio));
    new ResizeObserver(redraw).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  }

  function prepare() {
    programs = { fill: compiled(FILL, SHADE), edge: compiled(EDGE, PLAIN), ring: compiled(RING, CIRCLE) };
    strip = buffer(new Float32Array([0, -1, 0, 1, 1, -1, 1, 1]));
    layers = loaded();
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    redraw();
  }

  gl = canvas.getContext("webgl2", { antialias: true });
  document.getElementById("viewer").hidden = !gl;
  document.getElementById("no-picture").hidden = Boolean(gl);
  for (const button of document.querySelectorAll("[data-place]")) button.hidden = !gl;
  if (gl) {
    listen();
    prepare();
    choose(radios[0]);
  }
})();
