#pragma once

namespace jacket::demo {

/// The page of ViewPage; @TITLE@ (twice) and @SCENE@ are replaced.
inline constexpr const char* kViewTemplate = R"html(<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>@TITLE@</title>
<style>
html, body { margin: 0; height: 100%; background: #eef0f2; font: 14px system-ui, "DejaVu Sans", sans-serif; color: #1d2125; }
body { display: flex; flex-direction: column; }
canvas { flex: 1; min-height: 0; width: 100%; display: block; touch-action: none; cursor: grab; }
footer { display: flex; flex-wrap: wrap; gap: .4rem .9rem; align-items: center; padding: .5rem .9rem; background: #fff;
         border-top: 1px solid #d9dcdf; }
footer b { margin-right: .4rem; }
#time { flex: 1; min-width: 8rem; }
output { font-variant-numeric: tabular-nums; min-width: 5.5rem; }
.hint { color: #62686e; font-size: 12px; width: 100%; }
</style>
</head>
<body>
<canvas id="view"></canvas>
<footer>
<b>@TITLE@</b>
<button id="play" title="space bar">Pause</button>
<input id="time" type="range" min="0" max="1" step="any" value="0" aria-label="time">
<output id="now"></output>
<label>Speed <select id="speed"><option value="1">1</option><option value=".5">1/2</option><option value=".25">1/4</option>
<option value=".1">1/10</option></select></label>
<label><input id="edges" type="checkbox"> Edges</label>
<span class="hint">Drag to turn, right button or two fingers to move, wheel to zoom, double click to go back.</span>
</footer>
<script>
"use strict";
const scene = @SCENE@;
const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;
const canvas = document.getElementById("view");
const gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
if (!gl) canvas.insertAdjacentHTML("beforebegin", "<p style='padding:1rem'>This page needs WebGL 2, which this browser does not offer.</p>");

// --- vectors and 4 x 4 matrices, column by column -------------------------------------------------------------------
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => { const l = Math.hypot(...a) || 1; return [a[0] / l, a[1] / l, a[2] / l]; };
function times(a, b) {
  const c = new Float32Array(16);
  for (let i = 0; i < 4; ++i) for (let j = 0; j < 4; ++j) for (let k = 0; k < 4; ++k) c[4 * j + i] += a[4 * k + i] * b[4 * j + k];
  return c;
}
function lookAt(eye, target) {
  const z = unit(sub(eye, target)), x = unit(cross(Math.abs(z[1]) > .999 ? [0, 0, 1] : [0, 1, 0], z)), y = cross(z, x);
  return new Float32Array([x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1]);
}
function perspective(fov, aspect, near, far) {
  const f = 1 / Math.tan(fov * Math.PI / 360);
  return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0]);
}
function pose(p) {  // position and quaternion x y z w
  const [x, y, z, w] = p.subarray(3);
  return new Float32Array([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w), 0,
    2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w), 0,
    2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y), 0, p[0], p[1], p[2], 1]);
}

// --- shaders --------------------------------------------------------------------------------------------------------
function program(vertex, fragment) {
  const p = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const s = gl.createShader(kind);
    gl.shaderSource(s, "#version 300 es\nprecision highp float;\n" + text);
    gl.compileShader(s);
    if (!gl.getShaderParameter(s, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(s));
    gl.attachShader(p, s);
  }
  ["position", "normal", "tint"].forEach((name, i) => gl.bindAttribLocation(p, i, name));
  gl.linkProgram(p);
  return new Proxy({ p }, { get: (t, k) => k === "p" ? t.p : gl.getUniformLocation(p, k) });
}
const VERTEX = `in vec3 position, normal; in float tint; uniform mat4 camera, model; uniform float nearer;
  out vec3 at, n; out float shade;
  void main() { vec4 p = model * vec4(position, 1.0); at = p.xyz; n = mat3(model) * normal; shade = tint;
    gl_Position = camera * p; gl_Position.z -= nearer * gl_Position.w; }`;
const surfaces = gl && program(VERTEX, `in vec3 at, n; in float shade; uniform vec3 eye, front, back; out vec4 colour;
  void main() { vec3 m = normalize(gl_FrontFacing ? n : -n), l = normalize(vec3(.45, 1.0, .6)), v = normalize(eye - at);
    float light = .38 + .62 * max(dot(m, l), 0.0) + .12 * max(dot(m, v), 0.0);
    float gloss = .12 * pow(max(dot(m, normalize(l + v)), 0.0), 40.0);
    colour = vec4(pow(shade * light * (gl_FrontFacing ? front : back) + gloss, vec3(1.0 / 2.2)), 1.0); }`);
const lines = gl && program(VERTEX, `in vec3 at, n; in float shade; out vec4 colour; void main() { colour = vec4(0, 0, 0, .28); }`);
const grounds = gl && program(VERTEX, `in vec3 at, n; in float shade; uniform vec3 eye, front, u, w, centre; uniform float radius; out vec4 colour;
  void main() { vec2 g = vec2(dot(at, u), dot(at, w)) / (.25 * radius); float d = length(at - centre) / (8.0 * radius);
    float c = mod(floor(g.x) + floor(g.y), 2.0) * .12 + .88;
    colour = vec4(pow(front * c, vec3(1.0 / 2.2)), 1.0 - smoothstep(.35, 1.0, d)); }`);

// --- what is drawn --------------------------------------------------------------------------------------------------
function buffer(target, data, use) { const b = gl.createBuffer(); gl.bindBuffer(target, b); gl.bufferData(target, data, use); return b; }
function attribute(index, data, size, use = gl.STATIC_DRAW) {
  const b = buffer(gl.ARRAY_BUFFER, data, use);
  gl.enableVertexAttribArray(index);
  gl.vertexAttribPointer(index, size, gl.FLOAT, false, 0, 0);
  return b;
}
function makeShell(s) {
  const triangles = new Uint32Array(bytes(s.triangles)), motion = new Uint16Array(bytes(s.positions));
  const count = motion.length / scene.times.length, seen = new Set(), edges = [];
  for (let t = 0; t < triangles.length; t += 3)
    for (let k = 0; k < 3; ++k) {
      const a = triangles[t + k], b = triangles[t + (k + 1) % 3], key = Math.min(a, b) * count + Math.max(a, b);
      if (!seen.has(key)) { seen.add(key); edges.push(a, b); }
    }
  const vao = gl.createVertexArray();
  gl.bindVertexArray(vao);
  const x = new Float32Array(count), n = new Float32Array(count);
  const xb = attribute(0, x, 3, gl.DYNAMIC_DRAW), nb = attribute(1, n, 3, gl.DYNAMIC_DRAW);
  gl.vertexAttrib1f(2, 1);
  const index = buffer(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
  gl.bindVertexArray(null);
  const edgeIndex = buffer(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(edges), gl.STATIC_DRAW);
  return { s, triangles, motion, count, vao, x, n, xb, nb, index, edgeIndex, edges: edges.length };
}
function placeShell(o, i, part) {
  const from = o.count * i, to = o.count * Math.min(i + 1, scene.times.length - 1), { x, n, motion, triangles } = o;
  for (let k = 0; k < o.count; ++k)
    x[k] = o.s.low[k % 3] + o.s.step[k % 3] * ((1 - part) * motion[from + k] + part * motion[to + k]);
  n.fill(0);
  for (let t = 0; t < triangles.length; t += 3) {
    const a = 3 * triangles[t], b = 3 * triangles[t + 1], c = 3 * triangles[t + 2];
    const ux = x[b] - x[a], uy = x[b + 1] - x[a + 1], uz = x[b + 2] - x[a + 2];
    const vx = x[c] - x[a], vy = x[c + 1] - x[a + 1], vz = x[c + 2] - x[a + 2];
    const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    for (const v of [a, b, c]) { n[v] += nx; n[v + 1] += ny; n[v + 2] += nz; }
  }
  gl.bindBuffer(gl.ARRAY_BUFFER, o.xb); gl.bufferSubData(gl.ARRAY_BUFFER, 0, x);
  gl.bindBuffer(gl.ARRAY_BUFFER, o.nb); gl.bufferSubData(gl.ARRAY_BUFFER, 0, n);
}
function makeBody(s) {  // corners apart, so that each triangle has its tint
  const x = new Float32Array(bytes(s.positions)), n = new Float32Array(bytes(s.normals));
  const t = new Uint32Array(bytes(s.triangles)), tints = new Float32Array(bytes(s.tints));
  const pick = from => { const all = new Float32Array(3 * t.length); t.forEach((v, i) => all.set(from.subarray(3 * v, 3 * v + 3), 3 * i)); return all; };
  const vao = gl.createVertexArray();
  gl.bindVertexArray(vao);
  attribute(0, pick(x), 3); attribute(1, pick(n), 3);
  attribute(2, Float32Array.from(t, (v, i) => tints[Math.floor(i / 3)]), 1);
  gl.bindVertexArray(null);
  return { s, vao, corners: t.length, poses: new Float32Array(bytes(s.poses)) };
}
function makeGround(s) {
  const n = unit(s.normal), u = unit(cross(Math.abs(n[1]) > .9 ? [1, 0, 0] : [0, 1, 0], n)), w = cross(n, u);
  const centre = add(scene.target, n, s.offset - dot(n, scene.target)), r = 8 * scene.radius;
  const corners = [[-r, -r], [r, -r], [r, r], [-r, -r], [r, r], [-r, r]].map(([a, b]) => add(add(centre, u, a), w, b));
  const vao = gl.createVertexArray();
  gl.bindVertexArray(vao);
  attribute(0, new Float32Array(corners.flat()), 3);
  gl.bindVertexArray(null);
  return { s, vao, u, w, centre };
}

// --- camera ---------------------------------------------------------------------------------------------------------
let view;
function resetView() {
  const d = sub(scene.eye, scene.target), r = Math.hypot(...d);
  view = { target: [...scene.target], distance: r, yaw: Math.atan2(d[0], d[2]), pitch: Math.asin(d[1] / r) };
}
const towards = () => [Math.sin(view.yaw) * Math.cos(view.pitch), Math.sin(view.pitch), Math.cos(view.yaw) * Math.cos(view.pitch)];
resetView();

let time = 0, isPlaying = true, last = null, isDirty = true;
const end = scene.times[scene.times.length - 1] || 1e-9, slider = document.getElementById("time");
slider.max = end;
const identity = pose(new Float32Array([0, 0, 0, 0, 0, 0, 1]));
const shells = gl ? scene.shells.map(makeShell) : [], bodies = gl ? scene.bodies.map(makeBody) : [], floors = gl ? scene.grounds.map(makeGround) : [];

function draw() {
  const ratio = window.devicePixelRatio || 1, w = Math.round(canvas.clientWidth * ratio), h = Math.round(canvas.clientHeight * ratio);
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  gl.viewport(0, 0, w, h);
  gl.clearColor(.933, .941, .949, 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST);
  const eye = add(view.target, towards(), view.distance);
  const camera = times(perspective(scene.fov, w / h, .01 * view.distance, view.distance + 30 * scene.radius), lookAt(eye, view.target));
  let i = scene.times.findLastIndex ? scene.times.findLastIndex(t => t <= time) : scene.times.filter(t => t <= time).length - 1;
  i = Math.max(i, 0);
  const next = scene.times[Math.min(i + 1, scene.times.length - 1)];
  const part = next > scene.times[i] ? (time - scene.times[i]) / (next - scene.times[i]) : 0;
  gl.useProgram(surfaces.p);
  gl.uniformMatrix4fv(surfaces.camera, false, camera);
  gl.uniform3fv(surfaces.eye, eye);
  for (const o of shells) {
    placeShell(o, i, part);
    gl.uniformMatrix4fv(surfaces.model, false, identity);
    gl.uniform3fv(surfaces.front, o.s.front); gl.uniform3fv(surfaces.back, o.s.back);
    gl.bindVertexArray(o.vao);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, o.index);
    gl.vertexAttrib1f(2, 1);
    gl.drawElements(gl.TRIANGLES, o.triangles.length, gl.UNSIGNED_INT, 0);
  }
  for (const o of bodies) {
    const at = k => o.poses.subarray(7 * k, 7 * k + 7), a = at(i), b = at(Math.min(i + 1, scene.times.length - 1));
    const sign = a[3] * b[3] + a[4] * b[4] + a[5] * b[5] + a[6] * b[6] < 0 ? -1 : 1;
    const p = a.map((v, k) => (1 - part) * v + part * (k < 3 ? 1 : sign) * b[k]), l = Math.hypot(p[3], p[4], p[5], p[6]) || 1;
    for (let k = 3; k < 7; ++k) p[k] /= l;
    gl.uniformMatrix4fv(surfaces.model, false, pose(p));
    gl.uniform3fv(surfaces.front, o.s.colour); gl.uniform3fv(surfaces.back, o.s.colour);
    gl.bindVertexArray(o.vao);
    gl.drawArrays(gl.TRIANGLES, 0, o.corners);
  }
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  gl.useProgram(grounds.p);
  for (const o of floors) {
    gl.uniformMatrix4fv(grounds.camera, false, camera); gl.uniformMatrix4fv(grounds.model, false, identity);
    gl.uniform3fv(grounds.front, o.s.colour); gl.uniform3fv(grounds.u, o.u); gl.uniform3fv(grounds.w, o.w);
    gl.uniform3fv(grounds.centre, o.centre); gl.uniform1f(grounds.radius, scene.radius);
    gl.bindVertexArray(o.vao);
    gl.drawArrays(gl.TRIANGLES, 0, 6);
  }
  if (document.getElementById("edges").checked) {
    gl.useProgram(lines.p);
    gl.uniformMatrix4fv(lines.camera, false, camera); gl.uniformMatrix4fv(lines.model, false, identity); gl.uniform1f(lines.nearer, 2e-4);
    for (const o of shells) {
      gl.bindVertexArray(o.vao);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, o.edgeIndex);
      gl.drawElements(gl.LINES, o.edges, gl.UNSIGNED_INT, 0);
    }
  }
  gl.disable(gl.BLEND);
  gl.bindVertexArray(null);
}
function frame(now) {
  if (isPlaying && last !== null) {
    time += (now - last) / 1000 * document.getElementById("speed").value;
    if (time > end) time = 0;
  }
  if (isPlaying || isDirty) {
    slider.value = time;
    document.getElementById("now").textContent = time.toFixed(2) + " / " + end.toFixed(2) + " s";
    draw();
  }
  isDirty = false;
  last = now;
  requestAnimationFrame(frame);
}

// --- controls -------------------------------------------------------------------------------------------------------
const play = document.getElementById("play");
function setPlaying(on) { isPlaying = on; play.textContent = on ? "Pause" : "Play"; }
play.onclick = () => { if (!isPlaying && time >= end) time = 0; setPlaying(!isPlaying); };
slider.oninput = () => { setPlaying(false); time = Number(slider.value); isDirty = true; };
document.getElementById("edges").onchange = () => isDirty = true;
window.addEventListener("resize", () => isDirty = true);
window.addEventListener("keydown", e => { if (e.key === " " && e.target === document.body) { e.preventDefault(); play.onclick(); } });
const pointers = new Map();
function pan(dx, dy) {
  const z = towards(), x = unit(cross([0, 1, 0], z)), y = cross(z, x), s = 2 * view.distance * Math.tan(scene.fov * Math.PI / 360) / canvas.clientHeight;
  view.target = add(add(view.target, x, -dx * s), y, dy * s);
}
canvas.onpointerdown = e => { canvas.setPointerCapture(e.pointerId); pointers.set(e.pointerId, e); };
canvas.onpointerup = canvas.onpointercancel = e => pointers.delete(e.pointerId);
canvas.onpointermove = e => {
  const before = pointers.get(e.pointerId);
  if (!before) return;
  const dx = e.clientX - before.clientX, dy = e.clientY - before.clientY;
  if (pointers.size > 1) {
    const other = [...pointers.values()].find(p => p.pointerId !== e.pointerId);
    const gap = p => Math.hypot(p.clientX - other.clientX, p.clientY - other.clientY) || 1;
    view.distance *= gap(before) / gap(e);
    pan(dx / 2, dy / 2);
  } else if (e.buttons & 2 || e.shiftKey) pan(dx, dy);
  else { view.yaw -= dx * .008; view.pitch = Math.max(-1.55, Math.min(1.55, view.pitch + dy * .008)); }
  pointers.set(e.pointerId, e);
  isDirty = true;
};
canvas.oncontextmenu = e => e.preventDefault();
canvas.addEventListener("wheel", e => { e.preventDefault(); view.distance *= Math.exp(.001 * e.deltaY); isDirty = true; }, { passive: false });
canvas.ondblclick = () => { resetView(); isDirty = true; };
const asked = new URLSearchParams(location.hash.slice(1));  // #t=1.5 shows that moment, standing
if (asked.has("t")) { setPlaying(false); time = Math.min(Math.max(Number(asked.get("t")) || 0, 0), end); }
if (gl) requestAnimationFrame(frame);
</script>
</body>
</html>
)html";

}  // namespace jacket::demo
