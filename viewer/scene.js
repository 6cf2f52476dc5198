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
import { BufferAttribute, BufferGeometry, Mesh } from "three";
import {
  BLUE, GREEN, GREY, INK, PALE, RED, Strokes, colouredMaterial, createView, hiding, legend, lit, outliner, places,
  plainMaterial, restOf, shade, sharedRenderer, spot, surface,
} from "./view.js";

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
  front.add(hidesModel, coloured, ...tools.flatMap((tool) => [tool.mesh, tool.edges]), elements, inside, blue);
  top.add(hidesOutline, rim);

  // --- drawing --------------------------------------------------------------------------------------------------

  let shown = null;
  function paint(wanted) {
    shown = wanted;
    const { reference } = shown, known = shown.theirs !== null && reference !== null;
    mine.array.set(metric(shown.mine));
    mine.needsUpdate = true;
    if (known) theirs.array.set(metric(shown.theirs));
    theirs.needsUpdate = true;
    const apart = known && shown.ticked.includes("distance") && corners.count > 0;
    if (apart) shade(shades, data.colors, distance(reference.farthest));
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
    view.draw();
  }

  // How far nodes are from the reference, over the largest distance.
  function distance(farthest) {
    const a = shown.mine, b = shown.theirs;
    if (!farthest) return () => 0;
    return (i) => Math.hypot(a[3 * i] - b[3 * i], a[3 * i + 1] - b[3 * i + 1], a[3 * i + 2] - b[3 * i + 2]) / farthest.steps;
  }

  const turningAway = outliner(data.triangles, data.outline, data.n_nodes);

  function render(camera) {
    renderer.render(back, camera);
    renderer.clearDepth();
    renderer.render(front, camera);
    if (!shown.apart) return;
    rim.join(turningAway(theirs.array, view.axes()));
    rim.place(theirs.array);
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
    const { reference } = shown;
    if (shown.apart) legend(context, data.colors, `distance from ${reference.label}`, reference.farthest ? reference.farthest.words : "0", width);
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
  return paint;
};
