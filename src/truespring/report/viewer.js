// Draws the model over a reference at each load level, or over time. Plain JavaScript without library or network access.
// Bodies in 3D are drawn by truespringScene of scene.min.js.
"use strict";
(() => {
  const BLUE = "#0072b2", INK = "#16191d", RED = "#d3222a", FAINT = "#a9b0b7", GREEN = "#00795a";

  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
  // x, y[, z], x, y[, z], ... in 0 ... 65535 of the box, or beyond it
  const places = (text, beyond) => new (beyond ? Float32Array : Uint16Array)(bytes(text));
  const pairs = (text) => new Uint32Array(bytes(text || "")); // from, to, from, to, ...
  const steps = (text, most) => new (most < 256 ? Uint8Array : Uint16Array)(bytes(text));
  const few = (text, n_nodes) => new (n_nodes < 65536 ? Uint16Array : Uint32Array)(bytes(text || ""));

  for (const host of document.querySelectorAll("[data-viewer]")) {
    const data = JSON.parse(document.getElementById(host.dataset.viewer).textContent);
    host.hidden = false; // first: a hidden element has no width
    start(host, unpack(data));
  }

  function unpack(data) {
    const paths = data.paths.map((path) => ({
      ...path,
      lines: pairs(path.lines),
      inside: pairs(path.inside),
      positions: path.positions.map((text) => places(text, path.beyond)),
      fields: Object.fromEntries(Object.entries(path.fields || {}).map(([name, texts]) => [name, texts.map((text) => steps(text, data.fields.find((field) => field.name === name).steps))])),
      surface: path.surface && {
        ...path.surface, points: places(path.surface.points, path.beyond), lines: pairs(path.surface.lines),
      },
    }));
    const tools = data.tools.map((tool) => ({
      ...tool, lines: pairs(tool.lines), triangles: pairs(tool.triangles), points: places(tool.points, true),
    }));
    return {
      ...data, paths, tools, rest: places(data.rest), outline: pairs(data.outline),
      triangles: pairs(data.triangles), edges: pairs(data.edges), tetrahedra: few(data.tetrahedra, data.n_nodes), numbers: pairs(data.numbers),
    };
  }

  function start(host, data) {
    const canvas = host.querySelector("canvas"), slider = host.querySelector("input[name=level]");
    const play = host.querySelector("button.play"), boxes = [...host.querySelectorAll("input[type=checkbox]")];
    const readout = host.querySelector("output.state"), color = host.querySelector("select[name=color]");
    const cut = host.querySelector("select[name=cut]"), cutAt = host.querySelector("input[name=at]");
    const model = data.paths[0], others = data.paths.slice(1), dim = data.box.length;
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    const paint = dim === 3 ? window.truespringScene(canvas, data, bar) : plane(canvas, data);
    if (!paint) return instead(host);
    let reference = others[data.chosen] || null, playing = 0;
    slider.max = model.levels.length - 1;
    slider.value = data.start;
    let chosen = false; // whether a level was chosen, from which to play

    for (const choice of host.querySelectorAll("input[type=radio]")) {
      choice.addEventListener("change", () => { reference = others[Number(choice.value)]; draw(); });
    }
    slider.addEventListener("input", () => { chosen = true; stop(); draw(); });
    for (const one of [...boxes, color, cut].filter(Boolean)) one.addEventListener("change", () => draw());
    if (cutAt) cutAt.addEventListener("input", () => draw());
    host.querySelector("button.save").addEventListener("click", () => window.truespringPage.saveCanvas(canvas, `${host.dataset.name}.png`));
    const nodes = readNodes(host, canvas, data, paint, () => draw());
    play.addEventListener("click", () => (playing ? stop() : run()));
    let width = 0, asked = 0;
    new ResizeObserver(([entry]) => { // once per frame, and not for the height that draw() sets
      if (entry.contentRect.width === width) return;
      width = entry.contentRect.width;
      cancelAnimationFrame(asked);
      asked = requestAnimationFrame(() => draw());
    }).observe(canvas.parentElement);
    draw();

    function stop() {
      cancelAnimationFrame(playing);
      playing = 0;
      play.textContent = "Play";
    }

    function run() {
      const last = model.levels.length - 1, from = !chosen || Number(slider.value) >= last ? 0 : Number(slider.value);
      chosen = true;
      const began = performance.now(), pace = Math.max(data.axis.moves ? 30 : 120, 3000 / Math.max(last, 1)); // ms per level
      play.textContent = "Pause";
      const step = (now) => {
        const at = Math.min(last, from + Math.max(0, now - began) / pace);
        slider.value = Math.floor(at + 1e-9);
        draw(still ? Math.floor(at) : at);
        if (at >= last) stop(); else playing = requestAnimationFrame(step);
      };
      playing = requestAnimationFrame(step);
    }

    // Positions between two levels, interpolated linearly for the animation only.
    function at(path, place) {
      const low = Math.floor(place), high = Math.ceil(place);
      const a = index(path, low), b = index(path, high);
      if (a < 0 || b < 0) return null;
      const p = path.positions[a], q = path.positions[b], share = place - low;
      return share ? Float64Array.from(p, (value, i) => value + share * (q[i] - value)) : p;
    }

    // How far a tool has moved, interpolated like positions; out of the picture where it is not there.
    function shift(tool, place) {
      if (!tool.there[Math.round(place)]) return tool.shifts[0].map(() => 1e8);
      const a = tool.shifts[Math.floor(place)], b = tool.shifts[Math.ceil(place)], share = place - Math.floor(place);
      return a.map((value, i) => value + share * (b[i] - value));
    }

    function index(path, level) {
      const sought = model.levels[level];
      return path.positions.length ? path.levels.findIndex((one) => Math.abs(one - sought) < 1e-9) : -1;
    }

    function surface(level) {
      const known = reference && reference.surface;
      return known && Math.abs(known.level - model.levels[level]) < 1e-9 ? known : null;
    }

    function draw(place = Number(slider.value)) {
      const level = Math.floor(place + 1e-9);
      if (!canvas.parentElement.clientWidth) return;
      const shown = {
        level, reference, outline: surface(level), mine: at(model, place), theirs: reference && at(reference, place),
        shifts: data.tools.map((tool) => shift(tool, place)),
        ticked: boxes.filter((box) => box.checked).map((box) => box.name),
        color: color ? color.value : "", node: nodes.shown(),
        cut: cut && cut.value ? { axis: Number(cut.value), at: cutAt.value / 1000, other: boxes.some((box) => box.name === "half" && box.checked) } : null,
      };
      for (const one of host.querySelectorAll("[data-with]")) { // what another choice needs
        const [name, unlike] = one.dataset.with.split(" "), value = host.querySelector(`select[name=${name}]`).value;
        one.hidden = !value || value === unlike || (one.dataset.with.startsWith("color") && !reference);
      }
      paint(shown);
      nodes.write(shown);
      write(level, reference && reference.beyond && leaves(shown.outline ? shown.outline.points : shown.theirs));
    }

    function leaves(points) {
      const longest = Math.max(...data.box), ends = data.box.map((one) => 65535 * one / longest);
      return points && points.some((value, i) => value < -1 || value > ends[i % dim] + 1);
    }

    function write(level, gone) {
      const { name, unit, span } = data.axis;
      const parts = [`${name} <b>${+(span * model.levels[level]).toPrecision(4)}${unit && " " + unit}</b>`];
      const force = (path, at) => `force <b>${path.force[at]}</b>`, moved = (path, at) => `probe moved <b>${path.moved[at]}</b>`;
      // Under loads the force is the same for all paths; under a prescribed motion it is not.
      const state = (path, at) => (data.motion ? `${force(path, at)}, ` : "") + moved(path, at);
      if (!data.motion) parts.push(force(model, level));
      parts.push(`<i class="blue"></i>${state(model, level)}`);
      if (reference) {
        const other = index(reference, level);
        if (other >= 0) parts.push(`<i class="black"></i>${state(reference, other)}`);
        if (gone) parts.push("the reference leaves the picture");
        if (other >= 0 && reference.errors[other]) parts.push(`<b>${reference.errors[other]}</b> apart`);
        if (other >= 0 && level && reference.most && reference.most[other]) parts.push(`at most <b>${reference.most[other]}</b>`);
        if (other < 0 && level) parts.push(surface(level) ? "outline only" : `the reference has no result at this ${data.axis.level}`);
      }
      readout.innerHTML = parts.map((part) => `<span>${part}</span>`).join("");
    }
  }

  // Reads nodes: under the pointer, where it was clicked, or one after the other by the keys n and p.
  function readNodes(host, canvas, data, paint, draw) {
    const words = host.querySelector("output.node"), unit = Math.max(...data.box) / 65535, dim = data.box.length;
    let kept = -1, under = -1, pressed = null;
    const at = (event) => {
      const box = canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    const hover = (node) => { if (node !== under) { under = node; draw(); } };
    canvas.addEventListener("pointerdown", (event) => { pressed = at(event); });
    canvas.addEventListener("pointermove", (event) => { if (!event.buttons && event.pointerType === "mouse") hover(paint.pick(at(event))); });
    canvas.addEventListener("pointerleave", () => hover(-1));
    canvas.addEventListener("pointerup", (event) => {
      const [x, y] = at(event);
      if (!pressed || Math.hypot(x - pressed[0], y - pressed[1]) > 4) return;
      kept = paint.pick([x, y]);
      draw();
    });
    canvas.addEventListener("keydown", (event) => {
      const way = { n: 1, p: -1 }[event.key];
      if (!way && event.key !== "Escape") return;
      const all = paint.candidates, place = all.indexOf(kept);
      kept = way ? all[(Math.max(place, way < 0 ? 0 : -1) + way + all.length) % all.length] : -1;
      draw();
    });
    const shown = () => (under >= 0 ? under : kept);

    // A length in the unit of the view, no finer than the data are.
    const round = (value, step) => +(Math.round(value / step) * step).toPrecision(3);
    const vector = (values) => `(${values.join(", ")}) ${data.unit}`.replaceAll("-", "−");

    function write({ mine }) {
      const node = shown(), axes = [...Array(dim).keys()];
      if (node < 0) { words.textContent = words.dataset.hint; return; }
      const rest = axes.map((k) => round(data.lower[k] + unit * data.rest[dim * node + k], unit));
      const moved = axes.map((k) => (unit * (mine[dim * node + k] - data.rest[dim * node + k])) / data.factor);
      const parts = [
        `node <b>${data.numbers.length ? data.numbers[node] : node}</b> at rest at ${vector(rest)}`,
        `displacement <b>${vector(moved.map((value) => round(value, unit / data.factor)))}</b>`,
        `${round(Math.hypot(...moved), unit / data.factor)} ${data.unit} in all`, ...paint.values(node),
      ];
      words.innerHTML = parts.map((part) => `<span>${part}</span>`).join("");
    }
    return { shown, write };
  }

  // The picture of a plane body; `ticked` shows the distances.
  function plane(canvas, data) {
    const context = canvas.getContext("2d"), model = data.paths[0];
    let pixels = null; // where the nodes are on the canvas

    const paint = ({ level, reference, outline, mine, theirs, shifts, ticked, node }) => {
      const width = canvas.parentElement.clientWidth, pad = 14, [wide, high] = data.box;
      const scale = Math.min((width - 2 * pad) / wide, Math.max(180, Math.min(460, innerHeight * 0.6)) / high);
      const height = Math.round(scale * high + 2 * pad + 22), dense = devicePixelRatio || 1;
      if (canvas.width !== Math.round(width * dense) || canvas.height !== Math.round(height * dense)) {
        canvas.width = Math.round(width * dense);
        canvas.height = Math.round(height * dense);
        canvas.style.height = height + "px";
      }
      context.setTransform(dense, 0, 0, dense, 0, 0);
      context.clearRect(0, 0, width, height);
      context.lineJoin = context.lineCap = "round";
      const unit = scale * Math.max(wide, high) / 65535, left = (width - scale * wide) / 2;
      const x = (p, i) => left + unit * p[2 * i], y = (p, i) => pad + scale * high - unit * p[2 * i + 1];
      const stroke = (p, lines, color, thick, q = p) => {
        context.beginPath();
        for (let i = 0; i < lines.length; i += 2) {
          context.moveTo(x(p, lines[i]), y(p, lines[i]));
          context.lineTo(x(q, lines[i + 1]), y(q, lines[i + 1]));
        }
        context.strokeStyle = color;
        context.lineWidth = thick * Math.min(1, Math.max(0.3, Math.sqrt(1500 / lines.length))); // thinner lines for fine meshes
        context.stroke();
      };
      const dot = (p, i, radius, fill, edge) => {
        context.beginPath();
        context.arc(x(p, i), y(p, i), radius, 0, 2 * Math.PI);
        context.fillStyle = fill;
        context.strokeStyle = edge;
        context.lineWidth = 1.2;
        context.fill();
        context.stroke();
      };

      bar(context, data.unit, scale, height - 8, pad);
      context.save();
      context.beginPath();
      context.rect(0, 0, width, scale * high + 2 * pad);
      context.clip(); // clips paths that leave the picture
      context.setLineDash([4, 3]);
      stroke(data.rest, data.outline, FAINT, 1);
      context.setLineDash([]);
      if (outline) stroke(outline.points, outline.lines, INK, 1.8);
      else if (theirs) stroke(theirs, reference.lines, INK, 1.8);
      stroke(mine, model.lines, BLUE, 1);
      data.tools.forEach((tool, k) => stroke(tool.points.map((value, i) => value + shifts[k][i % 2]), tool.lines, GREEN, 1.6));
      if (theirs && ticked.length) {
        const same = new Uint32Array(2 * data.n_nodes);
        for (let i = 0; i < data.n_nodes; i++) same[2 * i] = same[2 * i + 1] = i;
        stroke(mine, same, RED, 1.4, theirs);
      }
      context.beginPath();
      for (let i = 0; i <= level; i++) context.lineTo(x(model.positions[i], data.probe), y(model.positions[i], data.probe));
      context.lineTo(x(mine, data.probe), y(mine, data.probe));
      context.strokeStyle = RED;
      context.lineWidth = 1;
      context.setLineDash([2, 3]);
      context.stroke();
      context.setLineDash([]);
      if (theirs) dot(theirs, data.probe, 4.5, "#fff", INK);
      dot(mine, data.probe, 4.5, RED, "#fff");
      if (node >= 0) dot(mine, node, 5.5, "#ffd23f", INK);
      context.restore();
      pixels = { at: (i) => [x(mine, i), y(mine, i)], theirs, mine, unit: Math.max(wide, high) / 65535 / data.factor };
    };
    const pick = ([u, v]) => {
      const away = (i) => Math.hypot(pixels.at(i)[0] - u, pixels.at(i)[1] - v);
      const nearest = candidates.reduce((best, i) => (away(i) < away(best) ? i : best), 0);
      return away(nearest) < 14 ? nearest : -1;
    };
    const candidates = [...Array(data.n_nodes).keys()];
    const values = (i) => {
      const { theirs, mine, unit } = pixels;
      return theirs ? [`${+(unit * Math.hypot(mine[2 * i] - theirs[2 * i], mine[2 * i + 1] - theirs[2 * i + 1])).toPrecision(2)} ${data.unit} from the reference`] : [];
    };
    return Object.assign(paint, { pick, values, candidates });
  }

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

  // Without WebGL: the figure of the model over a reference, and the reason.
  function instead(host) {
    const picture = host.parentElement.querySelector("figure.over img");
    for (const part of host.querySelectorAll("canvas, .controls, output")) part.remove();
    for (const words of host.querySelectorAll(".missing")) words.hidden = false;
    if (picture) host.append(Object.assign(picture.cloneNode(), { className: "still" }));
  }
})();
