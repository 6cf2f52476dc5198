// The picture of a live body: shaded, coloured by its distance from a reference, with what pulls and pushes it.
import { BufferAttribute, BufferGeometry, DoubleSide, LineBasicMaterial, LineSegments, Mesh, SphereGeometry } from "three";
import {
  INK, PALE, RED, Strokes, colouredMaterial, createView, dot, hiding, legend, lit, outliner, places,
  plainMaterial, restOf, shade, sharedRenderer, spot, surface,
} from "./view.js";

const BODY = "#c9dfee", LATE = "#8a929a", NEAR = 24; // pixels within which a node is picked
const MARK = 8, GRASP = 0, PIN = 1, SPHERE = 2; // see docs/live.md

// A scale bar of a round length; `scale` is pixels per unit.
function bar(context, unit, scale, bottom, left) {
  const aim = 90 / scale, power = 10 ** Math.floor(Math.log10(aim));
  const length = [5, 2, 1].map((digit) => digit * power).find((value) => value <= aim) || power;
  context.fillStyle = context.strokeStyle = "#5b6168";
  context.lineWidth = 1.5;
  context.beginPath();
  context.moveTo(left, bottom - 4);
  context.lineTo(left, bottom);
  context.lineTo(left + length * scale, bottom);
  context.lineTo(left + length * scale, bottom - 4);
  context.stroke();
  context.font = "12px system-ui, sans-serif";
  context.fillText(`${+length.toPrecision(3)} ${unit}`, left + length * scale + 7, bottom + 1);
}

// The smallest of 1, 2 and 5 times a power of ten that is not below a value.
function rounded(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((digit) => digit * power).find((one) => one >= value * (1 - 1e-9));
}

// body: { dim, nodes, size, unit, rest: Float32Array, triangles, edges, outline: Uint32Array, colors }, places in units
//   of the longest edge of its box about the middle; size is that edge in `unit`
// hands: press(event, at), drag(event, at), drop(event), keys: what a pointer and further keys do
// begin: further places that the view holds at the start
// from: the view of a scene that was there before; height(width): of the picture in pixels
// Returns null without WebGL.
export function createLiveScene(canvas, body, { begin = [], press, drag, drop, keys, height, from }) {
  const renderer = sharedRenderer();
  if (!renderer) return null;
  const ends = new AbortController();
  const corners = new BufferAttribute(body.triangles, 1), n = body.nodes;
  const mine = places(n), theirs = places(n), shades = places(n);
  mine.array.set(body.rest);
  let marked = new Float32Array(), reference = null, shown = true, stroke = null, rimFor = "";

  const lineOf = (positions, lines, color, opacity) => { // by index: the positions are shared with the surface
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", positions);
    geometry.setIndex(new BufferAttribute(lines, 1));
    const drawn = new LineSegments(geometry, new LineBasicMaterial({ color, transparent: true, opacity, depthWrite: false }));
    drawn.frustumCulled = false;
    return drawn;
  };
  const rest = restOf(body.rest, corners, body.outline);
  const plain = surface(mine, corners, plainMaterial(BODY, { side: DoubleSide }));
  const coloured = surface(mine, corners, colouredMaterial(), shades);
  const fine = Math.min(1, Math.max(0.25, Math.sqrt(1500 / Math.max(body.edges.length / 2, 1)))); // fine meshes paler
  const elements = lineOf(mine, body.edges, INK, 0.3 * fine), sharp = lineOf(mine, body.outline, INK, 0.55);
  const hides = surface(theirs, corners, hiding()), rim = new Strokes(new Uint32Array(), INK, 1.8);
  const round = new SphereGeometry(1, 32, 20), balls = [];
  const [back, front, top] = [lit(), lit(), lit()];
  back.add(...rest);
  front.add(plain, coloured, elements, sharp);
  top.add(hides, rim);
  const turningAway = outliner(body.triangles, body.outline, n);

  // --- drawing --------------------------------------------------------------------------------------------------

  function colour() {
    const known = reference !== null && shown;
    coloured.visible = known;
    plain.visible = !known;
    if (known) shade(shades, body.colors, (i) => reference.distances[i] / reference.most);
  }

  function render(camera) {
    renderer.render(back, camera);
    renderer.clearDepth();
    renderer.render(front, camera);
    if (!reference || !shown) return;
    const { yaw, pitch } = view.view(), wanted = `${reference.number} ${yaw} ${pitch}`;
    if (wanted !== rimFor) {
      rim.join(turningAway(theirs.array, view.axes()));
      rim.place(theirs.array);
      rimFor = wanted;
    }
    renderer.clearDepth();
    renderer.render(top, camera);
  }

  function marks(context, width) {
    for (let i = 0; i < marked.length; i += MARK) {
      const [what, , ...ends] = marked.subarray(i, i + MARK), [held, at] = [ends.slice(0, 3), ends.slice(3)].map((one) => view.pixel(one));
      if (what === SPHERE) continue;
      context.strokeStyle = what === PIN ? INK : RED;
      context.lineWidth = 2;
      context.beginPath();
      context.moveTo(...at);
      context.lineTo(...held);
      context.stroke();
      if (what === GRASP) {
        spot(context, at, "#fff", RED, 4);
        spot(context, held, RED, "#fff", 6);
      } else {
        context.fillStyle = INK;
        context.fillRect(held[0] - 5, held[1] - 5, 10, 10);
        context.strokeStyle = "#fff";
        context.lineWidth = 1.2;
        context.strokeRect(held[0] - 5, held[1] - 5, 10, 10);
      }
    }
    if (stroke) {
      context.setLineDash([6, 4]);
      context.strokeStyle = RED;
      context.lineWidth = 2;
      context.beginPath();
      for (const one of stroke) context.lineTo(...one);
      context.stroke();
      context.setLineDash([]);
    }
    view.rule();
    if (reference && shown) legend(context, body.colors, reference.title, `${+(reference.most * body.size).toPrecision(2)} ${body.unit}`, width);
  }

  const view = createView(canvas, renderer, {
    scenes: [back, front, top], strokes: [rim], render, marks, bar, unit: body.unit, longest: body.size, size: height,
    include: (add) => [body.rest, ...begin].forEach(add), loose: 1.2, frontal: body.dim === 2, press, drag, drop, keys, from, signal: ends.signal,
  });

  const all = Uint32Array.from({ length: n }, (_, i) => i), bounding = new Set(body.outline);
  function nearest(nodes, [x, y], near) {
    const { towards } = view.axes(), found = { node: -1, depth: -Infinity };
    for (const i of nodes) {
      const [a, b] = view.pixel(mine.array, i), far = Math.hypot(a - x, b - y);
      if (far > near) continue;
      const depth = dot(towards, mine.array, i) - 0.004 * far; // beside the nearest in sight
      if (depth > found.depth) Object.assign(found, { node: i, depth });
    }
    return found.node;
  }

  // --- what may be done with it ---------------------------------------------------------------------------------

  return {
    view,

    // places: Float32Array of the nodes; marks: MARK numbers each
    paint(positions, marks) {
      mine.array.set(positions);
      mine.needsUpdate = true;
      marked = marks;
      let used = 0;
      for (let i = 0; i < marks.length; i += MARK) {
        if (marks[i] !== SPHERE) continue;
        if (used === balls.length) {
          balls.push(new Mesh(round, plainMaterial(PALE, { transparent: true, opacity: 0.85, flatShading: false })));
          front.add(balls[used]);
        }
        balls[used].position.set(marks[i + 2], marks[i + 3], marks[i + 4]);
        balls[used].scale.setScalar(marks[i + 1]);
        balls[used++].visible = true;
      }
      for (const one of balls.slice(used)) one.visible = false;
      view.again();
    },

    // A reference with its distances from the body at one time; null for none.
    compare(number, positions, distances, title) {
      let farthest = 0;
      for (const one of distances) farthest = Math.max(farthest, one);
      const least = reference ? reference.most : 0, most = rounded(Math.max(farthest, 1e-6) * body.size) / body.size;
      theirs.array.set(positions);
      theirs.needsUpdate = true;
      // The scale shrinks only where the distances are much smaller, so that it does not flicker.
      reference = { number, distances, title, most: most < least && most > least / 4 ? least : most };
      colour();
      view.again();
    },

    // What the colours show, and whether the outline is that of another time than the body's.
    call(title, behind) {
      if (reference) reference.title = title;
      rim.material.color.set(behind ? LATE : INK);
    },

    forget() {
      reference = null;
      colour();
      view.again();
    },

    // Whether the reference is shown.
    show(wanted) {
      shown = wanted;
      colour();
      view.again();
    },

    // The line of a cut on the screen, pixels; null for none.
    line(ends) {
      stroke = ends;
      view.again();
    },

    // The node nearest to a pixel, of several the one towards the eye; -1 where there is none.
    // In the plane only the boundary can be held: on the body it is the nearest node of that.
    node(at, near = NEAR) {
      if (body.dim === 3) return nearest(all, at, near);
      return nearest(all, at, near) < 0 ? -1 : nearest(bounding, at, Infinity);
    },

    place: (i) => [...mine.array.subarray(3 * i, 3 * i + 3)],

    dispose() {
      ends.abort();
      for (const scene of [back, front, top]) {
        scene.traverse((one) => {
          if (one.geometry) one.geometry.dispose();
          if (one.material) one.material.dispose();
        });
      }
    },
  };
}

// Little-endian numbers in base64, from a description of a body.
const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;

// The description of a body as the server sends it, with its arrays.
export function unpackBody(sent) {
  const numbers = (name) => new Uint32Array(bytes(sent[name]));
  return { ...sent, rest: new Float32Array(bytes(sent.rest)), triangles: numbers("triangles"), edges: numbers("edges"), outline: numbers("outline") };
}
