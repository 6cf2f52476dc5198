// What the view of a report and that of a live session share: renderer, camera, lines, surfaces, colours, marks.
import {
  AmbientLight, BufferAttribute, BufferGeometry, ColorManagement, DirectionalLight, DoubleSide, LinearSRGBColorSpace,
  LineDashedMaterial, LineSegments, Mesh, MeshBasicMaterial, MeshLambertMaterial, OrthographicCamera, Scene,
  WebGLRenderer,
} from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";

ColorManagement.enabled = false; // colours are those of the page's other pictures

export const BLUE = "#0072b2", INK = "#16191d", RED = "#d3222a", FAINT = "#a9b0b7", GREY = "#e6e9ec", SOFT = "#3d4248", GREEN = "#00795a", PALE = "#8fc7b4";
const YAW = Math.atan2(0.55, 1), PITCH = Math.atan2(0.5, Math.hypot(0.55, 1)); // where the still pictures look from
const SIDE = 24, ABOVE = 50, BELOW = 34; // pixels around the body
export const PUSHED = { polygonOffset: true, polygonOffsetFactor: 1.5, polygonOffsetUnits: 2 }; // behind lines on the surface

// One for all views of a page, since browsers allow few; each view copies what it drew.
let shared;
export function sharedRenderer() {
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
export class Strokes extends LineSegments2 {
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

export const places = (n_nodes) => new BufferAttribute(new Float32Array(3 * n_nodes), 3);
export const dot = (a, p, i = 0) => a[0] * p[3 * i] + a[1] * p[3 * i + 1] + a[2] * p[3 * i + 2];

// A surface between nodes, of one colour or with one for each node.
export function surface(positions, corners, material, colors) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", positions);
  if (colors) geometry.setAttribute("color", colors);
  geometry.setIndex(corners);
  const mesh = new Mesh(geometry, material);
  mesh.frustumCulled = false;
  mesh.visible = corners.count > 0;
  return mesh;
}

export const hiding = () => new MeshBasicMaterial({ colorWrite: false, side: DoubleSide, ...PUSHED });
export const colouredMaterial = () => new MeshLambertMaterial({ vertexColors: true, flatShading: true, side: DoubleSide, ...PUSHED });
export const plainMaterial = (color, more = {}) => new MeshLambertMaterial({ color, flatShading: true, ...PUSHED, ...more });

// The body at rest as a pale surface and a dashed outline.
export function restOf(rest, corners, outline) {
  const positions = new BufferAttribute(rest, 3);
  const ghost = surface(positions, corners, new MeshBasicMaterial({ color: FAINT, transparent: true, opacity: 0.13, depthWrite: false }));
  const before = new LineSegments(
    new BufferGeometry(), new LineDashedMaterial({ color: FAINT, dashSize: 0.012, gapSize: 0.008, depthWrite: false }),
  );
  before.geometry.setAttribute("position", positions);
  before.geometry.setIndex(new BufferAttribute(outline, 1));
  before.geometry = before.geometry.toNonIndexed();
  before.computeLineDistances();
  before.frustumCulled = false;
  return [ghost, before];
}

// Scenes that are drawn one before the other, each with the same light.
export function lit() {
  const scene = new Scene(), sun = new DirectionalLight(0xffffff, 0.2 * Math.PI);
  scene.add(new AmbientLight(0xffffff, 0.8 * Math.PI), sun);
  scene.sun = sun;
  return scene;
}

// Colours of the nodes on a ramp from 0 to 1: `share` by node.
export function shade(shades, colors, share) {
  const last = colors.length - 1;
  for (let i = 0; i < shades.count; i++) {
    const at = last * Math.min(1, share(i)), low = Math.min(Math.floor(at), last - 1);
    for (let k = 0; k < 3; k++) {
      const [p, q] = [colors[low][k], colors[low + 1][k]];
      shades.array[3 * i + k] = (p + (at - low) * (q - p)) / 255;
    }
  }
  shades.needsUpdate = true;
}

// The ramp from the smallest value, 0 for distances, to the largest, with a title.
export function legend(context, colors, title, words, width, from = "0") {
  const [x, y, long, thick] = [14, 24, Math.min(170, width / 2), 9];
  const ramp = context.createLinearGradient(x, 0, x + long, 0);
  colors.forEach((color, i) => ramp.addColorStop(i / (colors.length - 1), `rgb(${color})`));
  context.fillStyle = "rgba(255, 255, 255, 0.75)";
  context.fillRect(0, 0, x + Math.max(long, 210), y + thick + 22);
  context.fillStyle = ramp;
  context.fillRect(x, y, long, thick);
  context.fillStyle = SOFT;
  context.font = "12px system-ui, sans-serif";
  context.fillText(title, x, y - 8);
  context.fillText(from, x, y + thick + 14);
  context.textAlign = "end";
  context.fillText(words, x + long, y + thick + 14);
  context.textAlign = "start";
}

// A round mark at a pixel.
export function spot(context, [x, y], fill, edge, radius = 4.5) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fillStyle = fill;
  context.strokeStyle = edge;
  context.lineWidth = 1.2;
  context.fill();
  context.stroke();
}

// A function that returns the edges of a surface where it is sharp at rest, or turns away from the eye.
export function outliner(triangles, outline, n_nodes) {
  const seen = new Map(), pairs = [], count = triangles.length / 3;
  for (let t = 0; t < count; t++) {
    for (let k = 0; k < 3; k++) {
      const a = triangles[3 * t + k], b = triangles[3 * t + ((k + 1) % 3)], key = Math.min(a, b) * n_nodes + Math.max(a, b);
      if (seen.has(key)) pairs.push([seen.get(key), t, a, b]);
      else seen.set(key, t);
    }
  }
  return (points, { right, up }) => {
    const ends = [...outline], facing = new Uint8Array(count);
    for (let t = 0; t < count; t++) {
      const [a, b, c] = [0, 1, 2].map((k) => [dot(right, points, triangles[3 * t + k]), dot(up, points, triangles[3 * t + k])]);
      facing[t] = (b[0] - a[0]) * (c[1] - a[1]) > (b[1] - a[1]) * (c[0] - a[0]) ? 1 : 0;
    }
    for (const [t, u, a, b] of pairs) if (facing[t] !== facing[u]) ends.push(a, b);
    return Uint32Array.from(ends);
  };
}

// A view of a canvas that can be turned, moved and zoomed.
//   scenes, strokes: what is lit, and the lines whose widths are in pixels
//   include(add): calls add(points) for what the view holds at the start
//   size(width): its height in pixels, or 0 while there is nothing to see
//   render(camera): draws the scenes; marks(context): draws words and marks over them
//   loose: room around that, over its size
//   frontal: for a plane body, which does not turn; press, drag, drop: what else a pointer does; keys: further keys
export function createView(canvas, renderer, { scenes, strokes, include, size, render, marks, bar, unit: length, longest, frontal = false, loose = 1, ...more }) {
  const context = canvas.getContext("2d"), camera = new OrthographicCamera();
  const options = { signal: more.signal };

  // --- where it is seen from ------------------------------------------------------------------------------------

  const start = () => ({ yaw: frontal ? 0 : YAW, pitch: frontal ? 0 : PITCH, zoom: 1, x: 0, y: 0 });
  let view = more.from || start(), width = 0, height = 0, half = 1, frame = 0;

  function axes(at = view) {
    const [c, s, p, q] = [Math.cos(at.yaw), Math.sin(at.yaw), Math.cos(at.pitch), Math.sin(at.pitch)];
    return { right: [c, 0, -s], up: [-q * s, p, -q * c], towards: [p * s, q, p * c] };
  }

  // The half height of the view, and its middle, that hold everything at the start.
  const hold = (() => {
    const { right, up } = axes(start()), low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    include((points) => {
      for (let i = 0; i < points.length / 3; i++) {
        [right, up].forEach((axis, k) => {
          const at = dot(axis, points, i);
          low[k] = Math.min(low[k], at);
          high[k] = Math.max(high[k], at);
        });
      }
    });
    return { middle: low.map((one, k) => (one + high[k]) / 2), extent: high.map((one, k) => loose * Math.max(one - low[k], 1e-3) / 2) };
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
    for (const scene of scenes) {
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

  // The point at a pixel, on the plane through another point that is parallel to the screen.
  function point([x, y], through) {
    const { right, up, towards } = axes(), [a, b] = sight(), c = dot(towards, through);
    const [i, j] = [a + (x - width / 2) * unit(), b - (y - height / 2) * unit()];
    return [0, 1, 2].map((k) => i * right[k] + j * up[k] + c * towards[k]);
  }

  // --- drawing --------------------------------------------------------------------------------------------------

  function draw() {
    frame = 0;
    width = canvas.parentElement.clientWidth;
    height = width && size(width);
    if (!height) return;
    const dense = devicePixelRatio || 1, pixels = [Math.round(width * dense), Math.round(height * dense)];
    if (canvas.width !== pixels[0] || canvas.height !== pixels[1]) {
      [canvas.width, canvas.height] = pixels;
      canvas.style.height = height + "px";
    }
    const drawn = renderer.domElement;
    if (drawn.width !== pixels[0] || drawn.height !== pixels[1]) renderer.setSize(...pixels, false);
    look(dense);
    renderer.clear();
    render(camera);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, ...pixels);
    context.drawImage(renderer.domElement, 0, 0);
    context.setTransform(dense, 0, 0, dense, 0, 0);
    context.lineJoin = context.lineCap = "round";
    marks(context, width, height);
  }

  // The scale bar and the axes; more of it where the body may come near.
  function rule() {
    if (view.zoom > 1) { // the body may come this near
      context.fillStyle = "rgba(255, 255, 255, 0.75)";
      context.fillRect(0, height - 26, 170, 26);
      context.fillRect(width - 90, height - 88, 90, 88);
    }
    bar(context, length, height / 2 / half / longest, height - 10, 14);
    triad();
  }

  function triad() {
    const { right, up, towards } = axes(), [x, y] = [width - 46, height - 44], arm = 28;
    context.font = "600 12px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    for (const k of (frontal ? [0, 1] : [0, 1, 2]).sort((a, b) => towards[a] - towards[b])) { // the nearest last
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
  const within = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    if (more.press && more.press(event, within(event))) return;
    held.set(event.pointerId, [event.clientX, event.clientY]);
  }, options);
  canvas.addEventListener("pointermove", (event) => {
    const was = held.get(event.pointerId);
    if (!was) {
      if (more.drag) more.drag(event, within(event));
      return;
    }
    const now = [event.clientX, event.clientY], [x, y] = [now[0] - was[0], now[1] - was[1]];
    held.set(event.pointerId, now);
    if (held.size === 2) {
      const [other] = [...held].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      const apart = (at) => Math.max(Math.hypot(at[0] - other[0], at[1] - other[1]), 1);
      move(x / 2, y / 2);
      zoom(apart(now) / apart(was));
    } else if (event.buttons === 2 || event.shiftKey || frontal) move(x, y);
    else turn(0.008 * x, 0.008 * y);
  }, options);
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, (event) => {
      if (!held.delete(event.pointerId) && more.drop) more.drop(event);
    }, options);
  }
  canvas.addEventListener("contextmenu", (event) => event.preventDefault(), options);
  if (!more.press) canvas.addEventListener("dblclick", reset, options);
  renderer.domElement.addEventListener("webglcontextrestored", again, options);
  canvas.addEventListener("wheel", (event) => { // only where it has been clicked: a page that is scrolled past stays still
    if (document.activeElement !== canvas) return;
    event.preventDefault();
    const [x, y] = within(event);
    zoom(Math.exp(-0.0015 * event.deltaY), x - width / 2, y - height / 2);
  }, { passive: false, ...options });
  const keys = {
    ArrowLeft: () => turn(-0.12, 0), ArrowRight: () => turn(0.12, 0), ArrowUp: () => turn(0, -0.12), ArrowDown: () => turn(0, 0.12),
    "+": () => zoom(1.2), "=": () => zoom(1.2), "-": () => zoom(1 / 1.2), "−": () => zoom(1 / 1.2), 0: reset, Home: reset, ...more.keys,
  };
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    keys[event.key](event);
  }, options);

  function reset() {
    view = start();
    again();
  }

  return { draw, again, axes, pixel, point, unit, rule, reset, turn, move, zoom, view: () => view };
}
