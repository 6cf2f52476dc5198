/*!
 * The page of a live session of truespring. It holds parts of three.js:
 *
 * The MIT License
 *
 * Copyright © 2010-2026 three.js authors
 *
 * Permission is hereby granted, free of charge, to any person obtaining a copy
 * of this software and associated documentation files (the "Software"), to deal
 * in the Software without restriction, including without limitation the rights
 * to use, copy, modify, merge, publish, distribute, sublicense, and/or sell
 * copies of the Software, and to permit persons to whom the Software is
 * furnished to do so, subject to the following conditions:
 *
 * The above copyright notice and this permission notice shall be included in
 * all copies or substantial portions of the Software.
 *
 * THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR
 * IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY,
 * FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE
 * AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER
 * LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM,
 * OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN
 * THE SOFTWARE.
 */
import { createLiveScene, unpackBody } from "./live_scene.js";

const HEADER = 32, MARK = 8, FRAME = 1, MOVING = 1; // see docs/live.md
const THROTTLE = 60; // ms between values of a slider
const REACH = 9.9;

const find = (id) => document.getElementById(id);
const canvas = find("scene"), wide = matchMedia("(min-width: 52rem)");
let socket = null, scene = null, body = null, owner = false, readout = null, lastFrame = null, lastGhost = null;
let tries = 0, ended = false, lag = null, drawn = false, from = undefined;
const counts = { frames: 0, lags: [] };

// --- the connection -------------------------------------------------------------------------------------------------

function connect() {
  socket = new WebSocket(`ws://${location.host}/session${location.search}`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { tries = 0; state(""); };
  socket.onmessage = (event) => (typeof event.data === "string" ? hear(JSON.parse(event.data)) : see(event.data));
  socket.onclose = () => {
    hands.clear();
    if (ended) return;
    state(tries < 5 ? "The connection is lost; trying again." : "The session has ended, or cannot be reached.");
    if (tries++ < 5) setTimeout(connect, 400 * tries);
  };
}

function say(message) {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

const ask = (message) => { if (owner) say({ ...message, clock: performance.now() }); };

function see(data) {
  const head = new DataView(data), number = head.getUint32(8, true), nodes = head.getUint32(12, true);
  const places = new Float32Array(data, HEADER, 3 * nodes), rest = new Float32Array(data, HEADER + 12 * nodes);
  const time = head.getFloat64(16, true), echo = head.getFloat64(24, true), flags = head.getUint8(1);
  const current = body && head.getUint32(4, true) === body.number;
  if (head.getUint8(0) === FRAME) {
    say({ kind: "seen", number });
    counts.frames++;
    if (!current) return;
    if (owner && !Number.isNaN(echo)) counts.lags.push(lag = performance.now() - echo);
    lastFrame = { number, time, places, marks: rest };
    if (!drawn) picture(places);
    if (scene) scene.paint(places, rest);
  } else if (current) {
    lastGhost = { number, time, places, distances: rest, moving: flags === MOVING };
    if (scene) compare();
  }
}

const LATE = 0.1; // s
function behind() {
  return Math.max(0, (lastFrame ? lastFrame.time : lastGhost.time) - lastGhost.time);
}

function title() {
  if (!lastGhost.moving) return "distance from FEM at rest";
  return behind() > LATE ? `distance from FEM, ${behind().toFixed(1)} s ago` : "distance from FEM in motion";
}

function compare() {
  scene.compare(lastGhost.number, lastGhost.places, lastGhost.distances, title());
  scene.call(title(), lastGhost.moving && behind() > LATE);
}

function hear(message) {
  if (message.kind === "body") describe(unpackBody(message));
  else if (message.kind === "readout") write(message);
  else if (message.kind === "wrong") alertOf(message.text);
}

// --- the picture ----------------------------------------------------------------------------------------------------

function height(width) {
  if (!body) return 0;
  const rect = canvas.parentElement.getBoundingClientRect();
  return wide.matches ? Math.max(300, innerHeight - rect.top - scrollY - find("below").offsetHeight - 12) : Math.round(Math.min(1.02 * width, 0.56 * innerHeight));
}

function describe(described) {
  from = scene && body.dim === described.dim ? scene.view.view() : undefined;
  if (scene) scene.dispose();
  body = described;
  lastGhost = scene = null;
  drawn = false;
  const counted = `${body.meshNodes} nodes, ${body.elements} elements`;
  find("size").textContent = counted;
  canvas.setAttribute("aria-label", `The body in motion: ${counted}`);
}

// Begins the picture with the first frame of a body.
function picture(places) {
  drawn = true;
  scene = createLiveScene(canvas, body, { begin: [places], press, drag, drop, keys, height, from });
  find("missing").hidden = scene !== null;
  canvas.hidden = scene === null;
  if (scene) scene.show(find("compared").checked);
}

new ResizeObserver(() => { if (scene) scene.view.again(); }).observe(canvas.parentElement);
addEventListener("resize", () => { if (scene) scene.view.again(); });

// --- hands ----------------------------------------------------------------------------------------------------------

const hands = new Map(); // by pointer: { hand, through, offset } or { line }
const free = () => [0, 1, 2, 3, 4, 5, 6, 7, 8].find((hand) => ![...hands.values()].some((one) => one.hand === hand));
const limited = (place) => place.map((one) => Math.min(REACH, Math.max(-REACH, one)));
const mode = () => document.querySelector("input[name=mode]:checked").value;
const minus = (a, b) => a.map((one, k) => one - b[k]);
const plus = (a, b, factor = 1) => a.map((one, k) => one + factor * b[k]);

const actions = {
  pull(event, at) {
    const node = scene.node(at), hand = free();
    if (node < 0 || hand === undefined) return false;
    const through = scene.place(node);
    hands.set(event.pointerId, { hand, through, offset: minus(through, scene.view.point(at, through)) });
    ask({ kind: "pull", hand, node });
    return true;
  },
  push(event, at) {
    const near = scene.node(at, 60), hand = free(), radius = Number(find("radius").value) / 100;
    if (near < 0 || hand === undefined) return false;
    const held = { hand, offset: [0, 0, 0], began: performance.now(), ...(body.dim === 2 ? beside(at, radius) : before(near, radius)) };
    hands.set(event.pointerId, held);
    ask({ kind: "push", hand, place: limited(held.from), radius });
    held.goal = scene.view.point(at, held.through);
    approach(held);
    return true;
  },
  pin(event, at) {
    const node = scene.node(at);
    if (node < 0) return false;
    ask({ kind: "pin", node });
    hands.set(event.pointerId, {});
    return true;
  },
  cut(event, at) {
    hands.set(event.pointerId, { line: [at, at] });
    return true;
  },
};

// A sphere begins where it does not touch, and comes in over some frames. In space from the eye:
function before(node, radius) {
  const { towards } = scene.view.axes(), surface = scene.place(node);
  return { from: plus(surface, towards, 1.05 * radius), through: plus(surface, towards, 0.4 * radius) };
}

// In the plane from the boundary, unless it is outside already.
function beside(at, radius) {
  const place = scene.view.point(at, [0, 0, 0]);
  let nearest = [0, 0, 0], far = Infinity;
  for (const node of body.outline) {
    const one = scene.place(node), away = Math.hypot(...minus(one, place));
    if (away < far) [nearest, far] = [one, away];
  }
  const outward = Math.hypot(...nearest) || 1;
  return { from: far > radius ? place : plus(nearest, nearest, (1.05 * radius) / outward), through: [0, 0, 0] };
}

const IN = 300; // ms until a sphere is where the pointer is
function approach(held) {
  if (![...hands.values()].includes(held)) return;
  const share = Math.min(1, (performance.now() - held.began) / IN);
  ask({ kind: "move", hand: held.hand, place: limited(plus(held.from, minus(held.goal, held.from), share)) });
  if (share < 1) setTimeout(() => approach(held), 16);
}

function press(event, at) {
  canvas.focus({ preventScroll: true });
  if (!owner || event.button > 0 || event.shiftKey) return false;
  return actions[mode()](event, at);
}

function drag(event, at) {
  const held = hands.get(event.pointerId);
  if (!held) return;
  if (held.line) {
    held.line[1] = at;
    scene.line(held.line);
  } else if (held.from) {
    held.goal = scene.view.point(at, held.through);
    if (performance.now() > held.began + IN) approach(held);
  } else if (held.hand !== undefined) {
    ask({ kind: "move", hand: held.hand, place: limited(plus(scene.view.point(at, held.through), held.offset)) });
  }
}

function drop(event) {
  const held = hands.get(event.pointerId);
  hands.delete(event.pointerId);
  if (!held) return;
  if (held.hand !== undefined) ask({ kind: "let-go", hand: held.hand });
  if (held.line) {
    scene.line(null);
    cut(...held.line);
  }
}

// A blade through all of the body: along a line on the screen, and away from the eye.
function cut(from, to) {
  if (Math.hypot(to[0] - from[0], to[1] - from[1]) < 8) return;
  const { towards } = scene.view.axes(), near = body.dim === 2 ? [0, 0, 0] : towards.map((one) => 3 * one);
  const [start, end] = [from, to].map((at) => limited(scene.view.point(at, near)));
  ask({ kind: "cut", start, end, depth: towards.map((one) => -6 * one) });
}

// --- keys -----------------------------------------------------------------------------------------------------------

const KEYBOARD = "keyboard"; // the pointer of what is grasped by keys
const step = (x, y) => (event) => {
  const held = hands.get(KEYBOARD);
  if (!held) return body.dim === 2 ? scene.view.move(-24 * x, -24 * y) : scene.view.turn(0.12 * x, 0.12 * y);
  const { right, up } = scene.view.axes(), far = event.altKey ? 0.005 : 0.02;
  held.at = limited(plus(plus(held.at, right, far * x), up, -far * y));
  return ask({ kind: "move", hand: held.hand, place: held.at });
};

function grasp() {
  if (hands.has(KEYBOARD)) return drop({ pointerId: KEYBOARD });
  const at = [canvas.clientWidth / 2, canvas.clientHeight / 2], node = scene.node(at, Infinity), hand = free();
  if (!owner || node < 0 || hand === undefined) return undefined;
  hands.set(KEYBOARD, { hand, at: scene.place(node) });
  return ask({ kind: "pull", hand, node });
}

const keys = {
  ArrowLeft: step(-1, 0), ArrowRight: step(1, 0), ArrowUp: step(0, -1), ArrowDown: step(0, 1),
  " ": () => toggle(), ".": () => ask({ kind: "step" }), Enter: grasp, Escape: releaseAll,
  1: () => choose("pull"), 2: () => choose("push"), 3: () => choose("pin"), 4: () => choose("cut"),
};
const choose = (name) => { find(`mode-${name}`).checked = true; modes(); };

function releaseAll() {
  hands.clear();
  ask({ kind: "release-all" });
}

function toggle() {
  ask({ kind: readout && readout.running ? "pause" : "play" });
}

// --- controls -------------------------------------------------------------------------------------------------------

function modes() {
  canvas.dataset.mode = mode();
  find("sphere-size").hidden = mode() !== "push";
}

for (const one of document.querySelectorAll("input[name=mode]")) one.addEventListener("change", modes);
find("run").addEventListener("click", toggle);
find("step").addEventListener("click", () => ask({ kind: "step" }));
find("restart").addEventListener("click", () => { hands.clear(); ask({ kind: "restart" }); });
find("release").addEventListener("click", releaseAll);
find("save").addEventListener("click", () => ask({ kind: "save" }));
find("gravity").addEventListener("change", (event) => ask({ kind: "gravity", value: event.target.checked ? 1 : 0 }));
find("speed").addEventListener("change", (event) => ask({ kind: "speed", value: Number(event.target.value) }));
find("model").addEventListener("change", (event) => ask({ kind: "model", name: event.target.value }));
find("compared").addEventListener("change", (event) => scene && scene.show(event.target.checked));
find("view").addEventListener("click", () => scene && scene.view.reset());

// Sliders: what the position means, and how it is written.
const sliders = {
  young: { value: (at) => 10 ** at, at: Math.log10, text: (value) => `× ${+value.toPrecision(3)}` },
  poisson: { value: (at) => at, at: (value) => value, text: (value) => `${+value.toPrecision(3)}` },
  damping: { value: (at) => at, at: (value) => value, text: (value) => `${+value.toPrecision(3)} 1/s` },
};
const touched = new Map(); // when a slider was moved last
for (const [name, { value, text }] of Object.entries(sliders)) {
  const slider = find(name);
  let waiting = 0;
  slider.addEventListener("input", () => {
    touched.set(name, performance.now());
    label(name, text(value(Number(slider.value))));
    if (waiting) return;
    waiting = setTimeout(() => {
      waiting = 0;
      ask({ kind: name, value: value(Number(slider.value)) });
    }, THROTTLE);
  });
}

function label(name, words) {
  find(`${name}-value`).textContent = words;
  find(name).setAttribute("aria-valuetext", words);
}

// --- words ----------------------------------------------------------------------------------------------------------

function state(words) {
  find("state").textContent = words;
  find("state").hidden = !words;
}

let gone = 0;
function alertOf(words) {
  find("alert").textContent = words;
  find("alert").hidden = !words;
  clearTimeout(gone);
  if (words) gone = setTimeout(() => alertOf(""), 6000);
}

function item(name, words, quiet = false) {
  const part = document.createElement("span"), bold = document.createElement("b");
  const [, figure, more] = /^(.*? %)(?=[ ,])(.*)$/.exec(words) || [null, words, ""];
  bold.textContent = figure;
  part.append(`${name} `, bold, more);
  if (quiet) part.className = "quiet";
  return part;
}

function list(place, lines) {
  if (place.dataset.shown === JSON.stringify(lines)) return; // so that a screen reader says a line once
  place.dataset.shown = JSON.stringify(lines);
  place.replaceChildren(...lines.map((line) => Object.assign(document.createElement("li"), { textContent: line })));
  place.parentElement.hidden = lines.length === 0;
}

function write(message) {
  const began = readout === null;
  readout = message;
  owner = message.owner;
  document.body.classList.toggle("watching", !owner);
  find("watching").hidden = owner;
  for (const one of document.querySelectorAll(".asks")) one.disabled = !owner;
  find("run").textContent = message.running ? "Pause" : "Continue";
  const rate = message.rate === null || !message.running ? "–" : message.rate.toFixed(0);
  const factor = message.factor === null || !message.running ? "–" : message.factor.toFixed(2);
  const figures = [item("frames/s", rate), item("real time ×", factor)];
  if (message.running && message.factor !== null && message.factor < 0.95 * message.speed) figures[1].className = "slow";
  if (lag !== null) figures.push(item("response", `${lag.toFixed(0)} ms`));
  const running = lastFrame ? lastFrame.time : 0;
  figures.push(item("time", `${running.toFixed(running < 100 ? 1 : 0)} s`));
  find("figures").replaceChildren(...figures);
  const names = { model: "error of model", time: "of time step", solver: "of solver" };
  const errors = Object.entries(message.errors).map(([name, words]) => item(names[name], words === null ? "measuring …" : words, words === null));
  if (message.ghost) {
    const { kind, behind, farthest } = message.ghost;
    errors.push(item("FEM", kind === "rest" ? `at rest, at most ${farthest} away` : `${behind.toFixed(1)} s behind, at most ${farthest} away`));
  }
  find("errors").replaceChildren(...errors);
  if (scene && lastGhost) scene.call(title(), lastGhost.moving && behind() > LATE);
  list(find("warnings"), message.warnings);
  list(find("notes"), [message.scheme, ...message.notes]);
  list(find("held"), message.marks.map((one) => `${one.name}${one.force ? `: ${one.force}` : ""}`));
  find("save").hidden = !message.saves;
  settings(message, began);
  if (!message.ghost && lastGhost && scene) {
    lastGhost = null;
    scene.forget();
  }
}

function settings(message, began) {
  const { gravity, ...values } = message.settings, now = performance.now();
  find("gravity").checked = gravity !== 0;
  for (const [name, value] of Object.entries(values)) {
    if (!sliders[name]) continue;
    find(name).closest("label").hidden = value === null;
    if (value === null || (owner && now - (touched.get(name) || 0) < 1500)) continue;
    find(name).value = sliders[name].at(value);
    label(name, sliders[name].text(value));
  }
  const model = find("model");
  if (began || model.options.length !== message.models.length) {
    model.replaceChildren(...message.models.map((name) => new Option(name, name)));
    model.closest("label").hidden = message.models.length < 2;
  }
  model.value = message.model;
  if (document.activeElement !== find("speed")) find("speed").value = String(message.speed);
}

addEventListener("pagehide", () => { ended = true; });
modes();
connect();

// For tests, and for those who try things in the console of a browser.
window.truespringLive = {
  counts,
  get readout() { return readout; },
  get frame() { return lastFrame; },
  get ghost() { return lastGhost; },
  get body() { return body; },
  pixel: (node) => scene.view.pixel(scene.place(node)),
  node: (at) => scene.node(at),
};
