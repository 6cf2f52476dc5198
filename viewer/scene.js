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
import { BufferAttribute, BufferGeometry, DoubleSide, Mesh, Plane } from "three";
import {
  BLUE, GREEN, GREY, INK, PALE, RED, Strokes, colouredMaterial, createView, dot, hiding, legend, lit, outliner, places,
  plainMaterial, restOf, shade, sharedRenderer, spot, surface,
} from "./view.js";

const CUT = "#cfe3f0"; // the inside of a body without colours
const NEAR = 14; // pixels between a pointer and the node that it shows

window.truespringScene = (canvas, data, bar) => {
  const renderer = sharedRenderer();
  if (!renderer) return null;
  const model = data.paths[0];
  const longest = Math.max(...data.box), middle = data.box.map((extent) => extent / longest / 2);
  const metric = (steps) => Float32Array.from(steps, (value, i) => value / 65535 - middle[i % 3]); // about the middle

  // --- what there is to see: at rest and the reference, the model before them, an outline before all -------------

  const rest = metric(data.rest), mine = places(data.n_nodes), theirs = places(data.n_nodes), shades = places(data.n_nodes);
  const corners = new BufferAttribute(data.triangles, 1);

  // The surface of a tool about the middle; it moves without turning.
  function solid(tool) {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(metric(tool.points), 3));
    geometry.setIndex(new BufferAttribute(tool.triangles, 1));
    geometry.computeVertexNormals();
    const mesh = new Mesh(geometry, plainMaterial(PALE));
    mesh.frustumCulled = false;
    mesh.visible = tool.triangles.length > 0;
    return mesh;
  }

  const [ghost, before] = restOf(rest, corners, data.outline);
  const grey = surface(theirs, corners, plainMaterial(GREY, { transparent: true, opacity: 0.8 }));
  const hidesModel = surface(mine, corners, hiding()), hidesOutline = surface(theirs, corners, hiding());
  const coloured = surface(mine, corners, colouredMaterial(), shades);
  const [plainCap, colouredCap, hidingCap] = [plainMaterial(CUT, { side: DoubleSide }), colouredMaterial(), hiding()].map((material) => {
    const cap = new Mesh(new BufferGeometry(), material);
    cap.frustumCulled = false;
    return cap;
  });
  const black = new Map(data.paths.map((path) => [path, new Strokes(path.lines.length ? path.lines : data.edges, INK, 1.5)]));
  const blue = new Strokes(model.lines, BLUE, 1.2);
  const inside = new Strokes(model.inside, BLUE, 0.7, { opacity: 0.3, depthTest: false });
  const elements = new Strokes(data.edges, INK, 0.6, { opacity: 0.5 });
  const rim = new Strokes(new Uint32Array(), INK, 1.6);
  const tools = data.tools.map((tool) => ({ mesh: solid(tool), edges: new Strokes(tool.lines, GREEN, 1), at: metric(tool.points) }));
  const strokes = [...black.values(), blue, inside, elements, rim, ...tools.map((tool) => tool.edges)];

  const [back, front, top] = [lit(), lit(), lit()];
  back.add(ghost, before, grey, ...black.values());
  [ghost, before, grey, ...black.values()].forEach((one, order) => { one.renderOrder = order; });
  front.add(hidesModel, coloured, plainCap, colouredCap, ...tools.flatMap((tool) => [tool.mesh, tool.edges]), elements, inside, blue);
  top.add(hidesOutline, hidingCap, rim);

  // --- a plane that cuts the bodies ------------------------------------------------------------------------------

  const cutting = new Plane();
  const cuttable = [grey, ...black.values(), hidesModel, coloured, elements, inside, blue, hidesOutline, rim].map((one) => one.material);
  renderer.localClippingEnabled = true;

  // Keeps the side of an axis below `at`, a share of the box, or above it.
  function cut({ axis, at, other }) {
    const sign = other ? 1 : -1, place = (2 * at - 1) * middle[axis];
    cutting.normal.set(0, 0, 0).setComponent(axis, sign);
    cutting.constant = -sign * place;
    for (const one of cuttable) one.clippingPlanes = [cutting];
  }

  // The polygons in which the plane cuts tetrahedra: corners, and shares for colours at them.
  function section(points, share) {
    const corners = [], shares = [], t = data.tetrahedra, { normal, constant } = cutting;
    const n = [normal.x, normal.y, normal.z], above = (i) => dot(n, points, i) + constant;
    for (let first = 0; first < t.length; first += 4) {
      const nodes = [t[first], t[first + 1], t[first + 2], t[first + 3]], heights = nodes.map(above);
      const [up, down] = [0, 1, 2, 3].reduce(([a, b], k) => (heights[k] > 0 ? [[...a, k], b] : [a, [...b, k]]), [[], []]);
      if (!up.length || !down.length) continue;
      const pairs = up.flatMap((i) => down.map((j) => [i, j]));
      if (pairs.length === 4) pairs.push(...pairs.splice(2, 2).reverse()); // around the quadrilateral
      const ends = pairs.map(([i, j]) => {
        const s = heights[i] / (heights[i] - heights[j]), [a, b] = [nodes[i], nodes[j]];
        return { at: [0, 1, 2].map((k) => points[3 * a + k] + s * (points[3 * b + k] - points[3 * a + k])), share: share(a) + s * (share(b) - share(a)) };
      });
      for (let k = 2; k < ends.length; k++) {
        for (const one of [ends[0], ends[k - 1], ends[k]]) {
          corners.push(...one.at);
          shares.push(one.share);
        }
      }
    }
    return { corners: new Float32Array(corners), shares };
  }

  function fill(cap, points, share) {
    const { corners, shares } = section(points, share), colors = places(shares.length);
    shade(colors, data.colors, (i) => shares[i]);
    cap.geometry.dispose();
    cap.geometry = new BufferGeometry();
    cap.geometry.setAttribute("position", new BufferAttribute(corners, 3));
    cap.geometry.setAttribute("color", colors);
  }

  // --- drawing --------------------------------------------------------------------------------------------------

  let shown = null;
  function paint(wanted) {
    shown = wanted;
    const { reference } = shown, known = shown.theirs !== null && reference !== null;
    mine.array.set(metric(shown.mine));
    mine.needsUpdate = true;
    if (known) theirs.array.set(metric(shown.theirs));
    theirs.needsUpdate = true;
    const colours = corners.count && shown.color ? data.ask.quantity(shown.color, shown) : null, apart = colours !== null;
    const [own, opposite] = shown.other ? [theirs, mine] : [mine, theirs];
    const share = colours && data.ask.share(colours);
    if (apart) shade(shades, data.colors, share);
    for (const one of cuttable) one.clippingPlanes = null;
    const cap = apart ? colouredCap : plainCap;
    plainCap.visible = colouredCap.visible = hidingCap.visible = false;
    if (shown.cut) {
      cut(shown.cut);
      cap.visible = data.tetrahedra.length > 0;
      if (cap.visible) fill(cap, own.array, share || (() => 0));
      hidingCap.visible = cap.visible && apart && known;
      if (hidingCap.visible) fill(hidingCap, opposite.array, () => 0);
    }
    for (const [path, lines] of black) {
      lines.visible = known && !apart && path === reference && lines.lines.length > 0;
      if (lines.visible) lines.place(theirs.array);
    }
    grey.visible = known && !apart && corners.count > 0;
    coloured.visible = apart;
    coloured.geometry.setAttribute("position", own);
    hidesOutline.geometry.setAttribute("position", opposite);
    hidesModel.visible = !apart && corners.count > 0;
    blue.visible = !apart && blue.lines.length > 0;
    inside.visible = !apart && shown.ticked.includes("inside") && inside.lines.length > 0;
    elements.visible = apart;
    for (const lines of [blue, inside, elements]) lines.place(lines === elements ? own.array : mine.array);
    tools.forEach((tool, k) => {
      const moved = shown.shifts[k].map((value) => value / 65535);
      tool.mesh.position.set(...moved);
      tool.edges.place(tool.at.map((value, i) => value + moved[i % 3]));
    });
    Object.assign(shown, { colours, opposite: known ? opposite : null });
    view.draw();
  }

  const turningAway = outliner(data.triangles, data.outline, data.n_nodes);

  function render(camera) {
    renderer.render(back, camera);
    renderer.clearDepth();
    renderer.render(front, camera);
    if (!shown.colours || !shown.opposite) return;
    rim.join(turningAway(shown.opposite.array, view.axes()));
    rim.place(shown.opposite.array);
    renderer.clearDepth();
    renderer.render(top, camera);
  }

  function marks(context, width) {
    context.beginPath();
    for (let i = 0; i <= shown.level; i++) context.lineTo(...view.pixel(probe(model.positions[i])));
    context.lineTo(...view.pixel(probe(shown.mine)));
    context.strokeStyle = RED;
    context.lineWidth = 1;
    context.setLineDash([2, 3]);
    context.stroke();
    context.setLineDash([]);
    if (shown.theirs) spot(context, view.pixel(probe(shown.theirs)), "#fff", INK);
    spot(context, view.pixel(probe(shown.mine)), RED, "#fff");
    view.rule();
    if (shown.node >= 0) spot(context, view.pixel(metric(shown.mine.slice(3 * shown.node, 3 * shown.node + 3))), "#ffd23f", INK, 5.5);
    const { colours } = shown, { written } = data.ask;
    if (colours) legend(context, data.colors, colours.title, written(colours.high, colours.unit), width, written(colours.low, ""));
  }

  // The nodes on the surface, and the one of them at a pixel that is nearest to the eye; -1 without one.
  const candidates = corners.count ? [...new Set(data.triangles)].sort((a, b) => a - b) : [...Array(data.n_nodes).keys()];
  function pick([x, y]) {
    const { towards } = view.axes(), found = [];
    for (const i of candidates) {
      if (shown.cut && cutting.normal.x * mine.array[3 * i] + cutting.normal.y * mine.array[3 * i + 1] + cutting.normal.z * mine.array[3 * i + 2] + cutting.constant < 0) continue;
      const [u, v] = view.pixel(mine.array, i), away = Math.hypot(u - x, v - y);
      if (away < NEAR) found.push({ i, away, depth: dot(towards, mine.array, i) });
    }
    const front = Math.max(...found.map((one) => one.depth)) - 0.03;
    return found.filter((one) => one.depth >= front).reduce((best, one) => (one.away < best.away ? one : best), { i: -1, away: Infinity }).i;
  }

  const probe = (steps) => metric(steps.slice(3 * data.probe, 3 * data.probe + 3));

  function include(add) {
    add(rest);
    for (const path of data.paths) {
      if (path.beyond || !path.positions.length) continue;
      const last = path.positions.length - 1;
      for (const level of [Math.min(data.start, last), last]) add(metric(path.positions[level]));
    }
    for (const tool of data.tools) { // not planes, nor tools much larger than the body
      const points = metric(tool.points), far = points.some((value) => Math.abs(value) > 1.5);
      const shift = tool.shifts[data.start];
      if (tool.triangles.length && !far) add(points.map((value, i) => value + shift[i % 3] / 65535));
    }
  }

  const size = (width) => shown && Math.round(Math.max(Math.min(width, 340), Math.min(0.6 * width, 0.62 * innerHeight, 540)));
  const scenes = [back, front, top];
  const view = createView(canvas, renderer, { scenes, strokes, include, size, render, marks, bar, unit: data.unit, longest });
  return Object.assign(paint, { pick, candidates });
};
