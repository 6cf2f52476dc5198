/*!
 * A live session of truespring in a notebook. It holds parts of three.js:
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

const HEADER = 32, REACH = 9.9; // see docs/live.md
const limited = (place) => place.map((one) => Math.min(REACH, Math.max(-REACH, one)));
const plus = (a, b, factor = 1) => a.map((one, k) => one + factor * b[k]);

function render({ model, el }) {
  const canvas = document.createElement("canvas"), picture = document.createElement("div"), bar = document.createElement("div");
  const words = document.createElement("span");
  el.classList.add("truespring-live");
  picture.style.position = "relative";
  canvas.tabIndex = 0;
  canvas.style.cssText = "display: block; width: 100%; touch-action: none;";
  words.style.cssText = "margin-left: 0.6em; font: 12px system-ui, sans-serif;";
  picture.append(canvas);
  el.append(picture, bar);

  const button = (text, pressed) => {
    const made = document.createElement("button");
    made.textContent = text;
    made.style.marginRight = "0.4em";
    made.addEventListener("click", pressed);
    bar.append(made);
    return made;
  };
  const say = (message) => model.send(JSON.stringify(message));
  const run = button("Play", () => say({ kind: model.get("running") ? "pause" : "play" }));
  button("Restart", () => { hands.clear(); say({ kind: "restart" }); });
  const blade = button("Cut", () => { cutting = !cutting; blade.style.fontWeight = cutting ? "bold" : ""; });
  bar.append(words);

  let scene = null, body = null, cutting = false;
  const hands = new Map(); // by pointer: { hand, through, offset } or { line }
  const free = () => [0, 1, 2, 3, 4, 5, 6, 7, 8].find((hand) => ![...hands.values()].some((one) => one.hand === hand));

  function press(event, at) {
    canvas.focus({ preventScroll: true });
    if (event.button > 0 || event.shiftKey) return false;
    if (cutting) {
      hands.set(event.pointerId, { line: [at, at] });
      return true;
    }
    const node = scene.node(at), hand = free();
    if (node < 0 || hand === undefined) return false;
    const through = scene.place(node);
    hands.set(event.pointerId, { hand, through, offset: plus(through, scene.view.point(at, through), -1) });
    say({ kind: "pull", hand, node });
    return true;
  }

  function drag(event, at) {
    const held = hands.get(event.pointerId);
    if (!held) return;
    if (held.line) {
      held.line[1] = at;
      scene.line(held.line);
    } else say({ kind: "move", hand: held.hand, place: limited(plus(scene.view.point(at, held.through), held.offset)) });
  }

  function drop(event) {
    const held = hands.get(event.pointerId);
    hands.delete(event.pointerId);
    if (!held) return;
    if (!held.line) {
      say({ kind: "let-go", hand: held.hand });
      return;
    }
    scene.line(null);
    const [from, to] = held.line;
    if (Math.hypot(to[0] - from[0], to[1] - from[1]) < 8) return;
    const { towards } = scene.view.axes(), near = body.dim === 2 ? [0, 0, 0] : towards.map((one) => 3 * one);
    const [start, end] = [from, to].map((at) => limited(scene.view.point(at, near)));
    say({ kind: "cut", start, end, depth: towards.map((one) => -6 * one) });
  }

  const height = (width) => Math.max(240, Math.round(0.6 * width));

  function describe() {
    if (!model.get("body")) return;
    const from = scene && body.dim === JSON.parse(model.get("body")).dim ? scene.view.view() : undefined;
    if (scene) scene.dispose();
    body = unpackBody(JSON.parse(model.get("body")));
    scene = createLiveScene(canvas, body, { press, drag, drop, keys: {}, height, from });
    if (!scene) picture.textContent = "This browser has no WebGL: the body is not drawn.";
    see();
  }

  function see() {
    const data = model.get("frame");
    if (!scene || !data || data.byteLength < HEADER) return;
    const copied = new Uint8Array(data.buffer, data.byteOffset, data.byteLength).slice().buffer; // aligned
    const head = new DataView(copied), nodes = head.getUint32(12, true);
    if (head.getUint32(4, true) !== body.number) return;
    scene.paint(new Float32Array(copied, HEADER, 3 * nodes), new Float32Array(copied, HEADER + 12 * nodes));
    words.textContent = `${head.getFloat64(16, true).toFixed(2)} s ${model.get("message")}`;
  }

  function state() {
    run.textContent = model.get("running") ? "Pause" : "Play";
    see();
  }

  const watched = [["change:body", describe], ["change:frame", see], ["change:running", state], ["change:message", state]];
  for (const [name, seen] of watched) model.on(name, seen);
  const sized = new ResizeObserver(() => { if (scene) scene.view.again(); });
  sized.observe(picture);
  describe();
  state();
  return () => {
    sized.disconnect();
    for (const [name, seen] of watched) model.off(name, seen);
    if (scene) scene.dispose();
  };
}

export default { render };
