// Draws the model over a reference at each load level, or over time. Plain JavaScript without library or network access.
// Plane bodies are drawn by truespringPlane of plane.js, bodies in 3D by truespringScene of scene.min.js.
"use strict";
(() => {
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
    data.ask = quantities(data);
    const paint = dim === 3 ? window.truespringScene(canvas, data, bar) : window.truespringPlane(canvas, data, bar);
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
        color: color && data.triangles.length ? color.value : "", node: nodes.shown(),
        cut: cut && cut.value ? { axis: Number(cut.value), at: cutAt.value / 1000, other: boxes.some((box) => box.name === "half" && box.checked) } : null,
      };
      shown.other = shown.theirs !== null && reference !== null && shown.ticked.includes("other") && shown.color !== "distance";
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

  // What colours stand for: its words, unit and range, and its value at a node of the model or of the reference.
  function quantities(data) {
    const dim = data.box.length, model = data.paths[0], unit = Math.max(...data.box) / 65535 / data.factor;
    const length = (p, q, i) => {
      let sum = 0;
      for (let k = dim * i; k < dim * (i + 1); k++) sum += (p[k] - q[k]) ** 2;
      return unit * Math.sqrt(sum);
    };
    const farthest = (p, q) => {
      let most = 0;
      for (let i = 0; i < data.n_nodes; i++) most = Math.max(most, length(p, q, i));
      return most;
    };
    const same = (path, level) => path.levels.findIndex((one) => Math.abs(one - level) < 1e-9);
    const inside = data.paths.filter((path) => !path.beyond).flatMap((path) => path.positions);
    const largest = Math.max(0, ...inside.map((p) => farthest(p, data.rest)));
    const apart = new Map(data.paths.slice(1).map((path) => [path, Math.max(0, ...model.levels.map((level, at) => {
      const other = path.positions.length ? same(path, level) : -1;
      const most = other < 0 ? 0 : farthest(model.positions[at], path.positions[other]);
      return most > 2 * unit ? most : 0; // less is rounding
    }))]));

    function quantity(name, { level, reference, mine, theirs, other }) {
      if (name === "distance") {
        if (!theirs) return null;
        return { title: `distance from ${reference.label}`, unit: data.unit, low: 0, high: apart.get(reference), value: (i) => length(mine, theirs, i) };
      }
      const path = other ? reference : model, own = other ? theirs : mine, of = ` of ${path.label}`;
      if (name === "displacement") return { title: name + of, unit: data.unit, low: 0, high: largest, value: (i) => length(own, data.rest, i) };
      const field = data.fields.find((one) => one.name === name), steps = path.fields[name] && path.fields[name][same(path, model.levels[level])];
      return field && steps ? { ...field, title: field.label + of, value: (i) => field.low + ((field.high - field.low) * steps[i]) / field.steps } : null;
    }

    const share = ({ low, high, value }) => (i) => (high > low ? (value(i) - low) / (high - low) : 0);
    const written = (value, unit) => `${+value.toPrecision(3)}${unit && " " + unit}`;

    // What is known of a node besides its displacement.
    function values(node, shown) {
      return ["distance", ...data.fields.map((field) => field.name)].map((name) => {
        const known = quantity(name, shown);
        return known && `${known.label || known.title} ${written(known.value(node), known.unit)}`;
      }).filter(Boolean);
    }
    return { quantity, share, written, values };
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
    const asked = () => (under >= 0 ? under : kept);

    // A text as HTML: labels may be names of files.
    const plain = (text) => Object.assign(document.createElement("span"), { textContent: text }).innerHTML;

    // A length in the unit of the view, no finer than the data are.
    const round = (value, step) => +(Math.round(value / step) * step).toPrecision(3);
    const vector = (values) => `(${values.join(", ")}) ${data.unit}`.replaceAll("-", "−");

    function write(shown) {
      const { mine } = shown;
      const node = asked(), axes = [...Array(dim).keys()];
      if (node < 0) { words.textContent = words.dataset.hint; return; }
      const rest = axes.map((k) => round(data.lower[k] + unit * data.rest[dim * node + k], unit));
      const moved = axes.map((k) => (unit * (mine[dim * node + k] - data.rest[dim * node + k])) / data.factor);
      const parts = [
        `node <b>${data.numbers.length ? data.numbers[node] : node}</b> at rest at ${vector(rest)}`,
        `displacement <b>${vector(moved.map((value) => round(value, unit / data.factor)))}</b>`,
        `${round(Math.hypot(...moved), unit / data.factor)} ${data.unit} in all`, ...data.ask.values(node, shown).map(plain),
      ];
      words.innerHTML = parts.map((part) => `<span>${part}</span>`).join("");
    }
    return { shown: asked, write };
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
