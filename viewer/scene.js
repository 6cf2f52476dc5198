/*!
 * The view that turns in a truespring report. It holds parts of three.js:
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
import {
  AmbientLight, BufferAttribute, BufferGeometry, ColorManagement, DirectionalLight, DoubleSide, LinearSRGBColorSpace,
  LineDashedMaterial, LineSegments, Mesh, MeshBasicMaterial, MeshLambertMaterial, OrthographicCamera, Scene,
  WebGLRenderer,
} from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";

ColorManagement.enabled = false; // colours are those of the page's other pictures

const BLUE = "#0072b2", INK = "#16191d", RED = "#d3222a", FAINT = "#a9b0b7", GREY = "#e6e9ec", SOFT = "#3d4248", GREEN = "#00795a", PALE = "#8fc7b4";
const YAW = Math.atan2(0.55, 1), PITCH = Math.atan2(0.5, Math.hypot(0.55, 1)); // where the still pictures look from
const SIDE = 24, ABOVE = 50, BELOW = 34; // pixels around the body
const PUSHED = { polygonOffset: true, polygonOffsetFactor: 1.5, polygonOffsetUnits: 2 }; // behind lines on the surface

// One for all views of a page, since browsers allow few; each view copies what it drew.
let shared;
function sharedRenderer() {
  if (shared === undefined) {
    try {
      shared = new WebGLRenderer({ antialias: true, alpha: true });
      shared.outputColorSpace = LinearSRGBColorSpace;
      shared.autoClear = false;
      shared.setClearColor(0xffffff, 0);
    } catch {
      shared = null;
    }
  }
  return shared;
}

// Lines between nodes, as wide as is asked for on the screen.
class Strokes extends LineSegments2 {
  constructor(lines, color, width, more = {}) {
    super(new LineSegmentsGeometry(), new LineMaterial({ color, transparent: true, depthWrite: false, ...more }));
    const fine = Math.min(1, Math.max(0.35, Math.sqrt(3000 / Math.max(lines.length / 2, 1)))); // fine meshes finer
    this.wanted = width * fine;
    this.full = this.material.opacity;
    this.frustumCulled = false;
    this.join(lines);
  }

  join(lines) {
    this.lines = lines;
    this.visible = lines.length > 0;
    if (this.visible) this.geometry.setPositions(new Float32Array(3 * lines.length));
  }

  place(positions) {
    if (!this.visible) return;
    const buffer = this.geometry.attributes.instanceStart.data, ends = buffer.array;
    for (let i = 0; i < this.lines.length; i++) ends.set(positions.subarray(3 * this.lines[i], 3 * this.lines[i] + 3), 3 * i);
    buffer.needsUpdate = true;
  }

  // Below a pixel a line grows paler instead of thinner.
  dense(pixels) {
    this.material.linewidth = Math.max(1, this.wanted * pixels);
    this.material.opacity = this.full * Math.min(1, this.wanted * pixels);
  }
}

window.truespringScene = (canvas, data, bar) => {
  const renderer = sharedRenderer();
  if (!renderer) return null;
  const context = canvas.getContext("2d"), model = data.paths[0];
  const longest = Math.max(...data.box), middle = data.box.map((extent) => extent / longest / 2);
  const metric = (steps) => Float32Array.from(steps, (value, i) => value / 65535 - middle[i % 3]); // about the middle

  // --- what there is to see: at rest and the reference, the model before them, an outline before all -------------

  const places = () => new BufferAttribute(new Float32Array(3 * data.n_nodes), 3);
  const rest = metric(data.rest), mine = places(), theirs = places();
  const shades = new BufferAttribute(new Float32Array(3 * data.n_nodes), 3);
  const corners = new BufferAttribute(data.triangles, 1);

  function surface(positions, material, colors) {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", positions);
    if (colors) geometry.setAttribute("color", colors);
    geometry.setIndex(corners);
    const mesh = new Mesh(geometry, material);
    mesh.frustumCulled = false;
    mesh.visible = corners.count > 0;
    return mesh;
  }

  // The surface of a tool about the middle; it moves without turning.
  function solid(tool) {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(metric(tool.points), 3));
    geometry.setIndex(new BufferAttribute(tool.triangles, 1));
    geometry.computeVertexNormals();
    const mesh = new Mesh(geometry, new MeshLambertMaterial({ color: PALE, flatShading: true, ...PUSHED }));
    mesh.frustumCulled = false;
    mesh.visible = tool.triangles.length > 0;
    return mesh;
  }

  const hiding = () => new MeshBasicMaterial({ colorWrite: false, side: DoubleSide, ...PUSHED });
  const ghost = surface(
    new BufferAttribute(rest, 3), new MeshBasicMaterial({ color: FAINT, transparent: true, opacity: 0.13, depthWrite: false }),
  );
  const before = new LineSegments(
    new BufferGeometry(), new LineDashedMaterial({ color: FAINT, dashSize: 0.012, gapSize: 0.008, depthWrite: false }),
  );
  before.geometry.setAttribute("position", new BufferAttribute(rest, 3));
  before.geometry.setIndex(new BufferAttribute(data.outline, 1));
  before.geometry = before.geometry.toNonIndexed();
  before.computeLineDistances();
  before.frustumCulled = false;

  const grey = surface(theirs, new MeshLambertMaterial({ color: GREY, flatShading: true, transparent: true, opacity: 0.8, ...PUSHED }));
  const hidesModel = surface(mine, hiding()), hidesOutline = surface(theirs, hiding());
  const coloured = surface(
    mine, new MeshLambertMaterial({ vertexColors: true, flatShading: true, side: DoubleSide, ...PUSHED }), shades,
  );
  const black = new Map(data.paths.map((path) => [path, new Strokes(path.lines.length ? path.lines : data.edges, INK, 1.5)]));
  const blue = new Strokes(model.lines, BLUE, 1.2);
  const inside = new Strokes(model.inside, BLUE, 0.7, { opacity: 0.3, depthTest: false });
  const elements = new Strokes(data.edges, INK, 0.6, { opacity: 0.5 });
  const rim = new Strokes(new Uint32Array(), INK, 1.6);
  const tools = data.tools.map((tool) => ({ mesh: solid(tool), edges: new Strokes(tool.lines, GREEN, 1), at: metric(tool.points) }));
  const strokes = [...black.values(), blue, inside, elements, rim, ...tools.map((tool) => tool.edges)];

  const [back, front, top] = [0, 1, 2].map(() => {
    const scene = new Scene(), sun = new DirectionalLight(0xffffff, 0.2 * Math.PI);
    scene.add(new AmbientLight(0xffffff, 0.8 * Math.PI), sun);
    scene.sun = sun;
    return scene;
  });
  back.add(ghost, before, grey, ...black.values());
  [ghost, before, grey, ...black.values()].forEach((one, order) => { one.renderOrder = order; });
  front.add(hidesModel, coloured, ...tools.flatMap((tool) => [tool.mesh, tool.edges]), elements, inside, blue);
  top.add(hidesOutline, rim);
  const camera = new OrthographicCamera();

  // --- where it is seen from ------------------------------------------------------------------------------------

  const start = () => ({ yaw: YAW, pitch: PITCH, zoom: 1, x: 0, y: 0 });
  let view = start(), shown = null, width = 0, height = 0, half = 1, frame = 0;

  function axes() {
    const [c, s, p, q] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
    return { right: [c, 0, -s], up: [-q * s, p, -q * c], towards: [p * s, q, p * c] };
  }

  const dot = (a, p, i = 0) => a[0] * p[3 * i] + a[1] * p[3 * i + 1] + a[2] * p[3 * i + 2];

  // The half height of the view, and its middle, that hold everything at the start.
  const hold = (() => {
    const { right, up } = axes(), low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    const include = (points) => {
      for (let i = 0; i < points.length / 3; i++) {
        [right, up].forEach((axis, k) => {
          const at = dot(axis, points, i);
          low[k] = Math.min(low[k], at);
          high[k] = Math.max(high[k], at);
        });
      }
    };
    include(rest);
    for (const path of data.paths) {
      if (path.beyond || !path.positions.length) continue;
      const last = path.positions.length - 1;
      for (const level of [Math.min(data.start, last), last]) include(metric(path.positions[level]));
    }
    for (const tool of data.tools) { // not planes, nor tools much larger than the body
      const points = metric(tool.points), far = points.some((value) => Math.abs(value) > 1.5);
      const shift = tool.shifts[data.start];
      if (tool.triangles.length && !far) include(points.map((value, i) => value + shift[i % 3] / 65535));
    }
    return { middle: low.map((one, k) => (one + high[k]) / 2), extent: high.map((one, k) => Math.max(one - low[k], 1e-3) / 2) };
  })();

  function look(dense) {
    const room = [Math.max(width - 2 * SIDE, 50), Math.max(height - ABOVE - BELOW, 50)];
    half = (Math.max(hold.extent[1] / room[1], hold.extent[0] / room[0]) * height) / view.zoom;
    const { right, up, towards } = axes(), across = (half * width) / height, [x, y] = sight();
    Object.assign(camera, { left: x - across, right: x + across, top: y + half, bottom: y - half, near: 0.1, far: 40 });
    camera.up.set(...up);
    camera.position.set(...towards.map((one) => 20 * one));
    camera.lookAt(0, 0, 0);
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    for (const scene of [back, front, top]) {
      scene.sun.position.set(...[0, 1, 2].map((k) => -0.3 * right[k] + 0.6 * up[k] + 0.74 * towards[k]));
    }
    const small = Math.min(1, Math.max(0.6, Math.sqrt(height / 480))); // small pictures in finer lines
    for (const one of strokes) one.dense(small * dense);
  }

  // What is in the middle of the view, to the right and up; words take more above than below.
  const sight = () => [hold.middle[0] + view.x, hold.middle[1] + view.y + (ABOVE - BELOW) / 2 * unit()];

  // Pixels of a point on the page.
  function pixel(points, i = 0) {
    const { right, up } = axes(), [x, y] = sight();
    return [width / 2 + (dot(right, points, i) - x) / unit(), height / 2 - (dot(up, points, i) - y) / unit()];
  }

  // --- drawing --------------------------------------------------------------------------------------------------

  function paint(wanted) {
    shown = wanted;
    const { reference } = shown, known = shown.theirs !== null && reference !== null;
    mine.array.set(metric(shown.mine));
    mine.needsUpdate = true;
    if (known) theirs.array.set(metric(shown.theirs));
    theirs.needsUpdate = true;
    const apart = known && shown.ticked.includes("distance") && corners.count > 0;
    if (apart) shade(reference.farthest);
    for (const [path, lines] of black) {
      lines.visible = known && !apart && path === reference && lines.lines.length > 0;
      if (lines.visible) lines.place(theirs.array);
    }
    grey.visible = known && !apart && corners.count > 0;
    coloured.visible = apart;
    hidesModel.visible = !apart && corners.count > 0;
    blue.visible = !apart && blue.lines.length > 0;
    inside.visible = !apart && shown.ticked.includes("inside") && inside.lines.length > 0;
    elements.visible = apart;
    for (const lines of [blue, inside, elements]) lines.place(mine.array);
    tools.forEach((tool, k) => {
      const moved = shown.shifts[k].map((value) => value / 65535);
      tool.mesh.position.set(...moved);
      tool.edges.place(tool.at.map((value, i) => value + moved[i % 3]));
    });
    shown.apart = apart;
    draw();
  }

  // Colours of the nodes by their distance from the reference.
  function shade(farthest) {
    const last = data.colors.length - 1, a = shown.mine, b = shown.theirs;
    for (let i = 0; i < data.n_nodes; i++) {
      const steps = Math.hypot(a[3 * i] - b[3 * i], a[3 * i + 1] - b[3 * i + 1], a[3 * i + 2] - b[3 * i + 2]);
      const at = farthest ? last * Math.min(1, steps / farthest.steps) : 0, low = Math.min(Math.floor(at), last - 1);
      for (let k = 0; k < 3; k++) {
        const [p, q] = [data.colors[low][k], data.colors[low + 1][k]];
        shades.array[3 * i + k] = (p + (at - low) * (q - p)) / 255;
      }
    }
    shades.needsUpdate = true;
  }

  function draw() {
    frame = 0;
    width = canvas.parentElement.clientWidth;
    if (!shown || !width) return;
    height = Math.round(Math.max(Math.min(width, 340), Math.min(0.6 * width, 0.62 * innerHeight, 540)));
    const dense = devicePixelRatio || 1, pixels = [Math.round(width * dense), Math.round(height * dense)];
    if (canvas.width !== pixels[0] || canvas.height !== pixels[1]) {
      [canvas.width, canvas.height] = pixels;
      canvas.style.height = height + "px";
    }
    const size = renderer.domElement;
    if (size.width !== pixels[0] || size.height !== pixels[1]) renderer.setSize(...pixels, false);
    look(dense);
    renderer.clear();
    renderer.render(back, camera);
    renderer.clearDepth();
    renderer.render(front, camera);
    if (shown.apart) {
      rim.join(turningAway(theirs.array));
      rim.place(theirs.array);
      renderer.clearDepth();
      renderer.render(top, camera);
    }
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, ...pixels);
    context.drawImage(renderer.domElement, 0, 0);
    context.setTransform(dense, 0, 0, dense, 0, 0);
    marks();
  }

  function marks() {
    context.lineJoin = context.lineCap = "round";
    context.beginPath();
    for (let i = 0; i <= shown.level; i++) context.lineTo(...pixel(probe(model.positions[i])));
    context.lineTo(...pixel(probe(shown.mine)));
    context.strokeStyle = RED;
    context.lineWidth = 1;
    context.setLineDash([2, 3]);
    context.stroke();
    context.setLineDash([]);
    if (shown.theirs) spot(pixel(probe(shown.theirs)), "#fff", INK);
    spot(pixel(probe(shown.mine)), RED, "#fff");
    if (view.zoom > 1) { // the body may come this near
      context.fillStyle = "rgba(255, 255, 255, 0.75)";
      context.fillRect(0, height - 26, 170, 26);
      context.fillRect(width - 90, height - 88, 90, 88);
    }
    bar(context, data.unit, height / 2 / half / longest, height - 10, 14);
    triad();
    if (shown.apart) legend();
  }

  const probe = (steps) => metric(steps.slice(3 * data.probe, 3 * data.probe + 3));

  function spot([x, y], fill, edge) {
    context.beginPath();
    context.arc(x, y, 4.5, 0, 2 * Math.PI);
    context.fillStyle = fill;
    context.strokeStyle = edge;
    context.lineWidth = 1.2;
    context.fill();
    context.stroke();
  }

  function triad() {
    const { right, up, towards } = axes(), [x, y] = [width - 46, height - 44], arm = 28;
    context.font = "600 12px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    for (const k of [0, 1, 2].sort((a, b) => towards[a] - towards[b])) { // the nearest last
      const [i, j] = [arm * right[k], -arm * up[k]];
      context.strokeStyle = context.fillStyle = towards[k] < -0.05 ? "#9aa2aa" : SOFT;
      context.lineWidth = 1.6;
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(x + i, y + j);
      context.stroke();
      context.fillText("xyz"[k], x + 1.32 * i, y + 1.32 * j);
    }
    context.textAlign = "start";
    context.textBaseline = "alphabetic";
  }

  function legend() {
    const { reference } = shown, [x, y, long, thick] = [14, 24, Math.min(170, width / 2), 9];
    const words = reference.farthest ? reference.farthest.words : "0";
    const ramp = context.createLinearGradient(x, 0, x + long, 0);
    data.colors.forEach((color, i) => ramp.addColorStop(i / (data.colors.length - 1), `rgb(${color})`));
    context.fillStyle = "rgba(255, 255, 255, 0.75)";
    context.fillRect(0, 0, x + Math.max(long, 210), y + thick + 22);
    context.fillStyle = ramp;
    context.fillRect(x, y, long, thick);
    context.fillStyle = SOFT;
    context.font = "12px system-ui, sans-serif";
    context.fillText(`distance from ${reference.label}`, x, y - 8);
    context.fillText("0", x, y + thick + 14);
    context.textAlign = "end";
    context.fillText(words, x + long, y + thick + 14);
    context.textAlign = "start";
  }

  // The edges of a surface where it is sharp at rest, or turns away from the eye.
  const neighbours = (() => {
    const seen = new Map(), pairs = [];
    for (let t = 0; t < corners.count / 3; t++) {
      for (let k = 0; k < 3; k++) {
        const a = data.triangles[3 * t + k], b = data.triangles[3 * t + ((k + 1) % 3)], key = Math.min(a, b) * data.n_nodes + Math.max(a, b);
        if (seen.has(key)) pairs.push([seen.get(key), t, a, b]);
        else seen.set(key, t);
      }
    }
    return pairs;
  })();

  function turningAway(points) {
    const { right, up } = axes(), ends = [...data.outline], facing = new Uint8Array(corners.count / 3);
    for (let t = 0; t < facing.length; t++) {
      const [a, b, c] = [0, 1, 2].map((k) => [dot(right, points, data.triangles[3 * t + k]), dot(up, points, data.triangles[3 * t + k])]);
      facing[t] = (b[0] - a[0]) * (c[1] - a[1]) > (b[1] - a[1]) * (c[0] - a[0]) ? 1 : 0;
    }
    for (const [t, u, a, b] of neighbours) if (facing[t] !== facing[u]) ends.push(a, b);
    return Uint32Array.from(ends);
  }

  // --- turning, moving, zooming ----------------------------------------------------------------------------------

  const again = () => { if (!frame) frame = requestAnimationFrame(draw); };
  const unit = () => (2 * half) / height; // of the scene, a pixel

  function turn(x, y) {
    view.yaw -= x;
    view.pitch = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, view.pitch + y));
    again();
  }

  function move(x, y) {
    view.x -= x * unit();
    view.y += y * unit();
    again();
  }

  // Keeps the place under (x, y), in pixels from the middle, where it is.
  function zoom(factor, x = 0, y = 0) {
    const to = Math.min(40, Math.max(0.3, view.zoom * factor)), gone = 1 - view.zoom / to;
    view.x += gone * x * unit();
    view.y -= gone * y * unit();
    view.zoom = to;
    again();
  }

  const held = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    const was = held.get(event.pointerId);
    if (!was) return;
    const now = [event.clientX, event.clientY], [x, y] = [now[0] - was[0], now[1] - was[1]];
    held.set(event.pointerId, now);
    if (held.size === 2) {
      const [other] = [...held].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      const apart = (at) => Math.max(Math.hypot(at[0] - other[0], at[1] - other[1]), 1);
      move(x / 2, y / 2);
      zoom(apart(now) / apart(was));
    } else if (event.buttons === 2 || event.shiftKey) move(x, y);
    else turn(0.008 * x, 0.008 * y);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => held.delete(event.pointerId));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("dblclick", reset);
  renderer.domElement.addEventListener("webglcontextrestored", again);
  canvas.addEventListener("wheel", (event) => { // only where it has been clicked: a page that is scrolled past stays still
    if (document.activeElement !== canvas) return;
    event.preventDefault();
    const box = canvas.getBoundingClientRect();
    zoom(Math.exp(-0.0015 * event.deltaY), event.clientX - box.left - width / 2, event.clientY - box.top - height / 2);
  }, { passive: false });
  const keys = {
    ArrowLeft: () => turn(-0.12, 0), ArrowRight: () => turn(0.12, 0), ArrowUp: () => turn(0, -0.12), ArrowDown: () => turn(0, 0.12),
    "+": () => zoom(1.2), "=": () => zoom(1.2), "-": () => zoom(1 / 1.2), "−": () => zoom(1 / 1.2), 0: reset, Home: reset,
  };
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    keys[event.key]();
  });

  function reset() {
    view = start();
    again();
  }

  return paint;
};
