// Draws a plane body. Plain JavaScript without library or network access.
"use strict";
(() => {
  const BLUE = "#0072b2", INK = "#16191d", RED = "#d3222a", FAINT = "#a9b0b7", GREEN = "#00795a", SOFT = "#3d4248";
  const SMOOTH = 3000; // more triangles have one colour each
  const LEGEND = 40; // its height [pixels]

  // The picture of a plane body; `ticked` shows the distances.
  window.truespringPlane = (canvas, data, bar) => {
    const context = canvas.getContext("2d"), model = data.paths[0];
    let pixels = null; // where the nodes are on the canvas

    const paint = (shown) => {
      const { level, reference, outline, mine, theirs, shifts, ticked, node } = shown;
      const colours = shown.color ? data.ask.quantity(shown.color, shown) : null, above = colours ? LEGEND : 0;
      const width = canvas.parentElement.clientWidth, pad = 14, [wide, high] = data.box;
      const scale = Math.min((width - 2 * pad) / wide, Math.max(180, Math.min(460, innerHeight * 0.6)) / high);
      const height = Math.round(above + scale * high + 2 * pad + 22), dense = devicePixelRatio || 1;
      if (canvas.width !== Math.round(width * dense) || canvas.height !== Math.round(height * dense)) {
        canvas.width = Math.round(width * dense);
        canvas.height = Math.round(height * dense);
        canvas.style.height = height + "px";
      }
      context.setTransform(dense, 0, 0, dense, 0, 0);
      context.clearRect(0, 0, width, height);
      context.lineJoin = context.lineCap = "round";
      const unit = scale * Math.max(wide, high) / 65535, left = (width - scale * wide) / 2;
      const x = (p, i) => left + unit * p[2 * i], y = (p, i) => above + pad + scale * high - unit * p[2 * i + 1];
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
      context.rect(0, above, width, scale * high + 2 * pad);
      context.clip(); // clips paths that leave the picture
      context.setLineDash([4, 3]);
      stroke(data.rest, data.outline, FAINT, 1);
      context.setLineDash([]);
      if (colours) {
        const [own, opposite] = shown.other ? [theirs, mine] : [mine, theirs];
        fill(context, (i) => [x(own, i), y(own, i)], data, data.ask.share(colours));
        stroke(own, (shown.other ? reference : model).lines, "rgba(22, 25, 29, 0.35)", 0.7);
        if (opposite) stroke(opposite, data.outline, INK, 1.6);
      } else {
        if (outline) stroke(outline.points, outline.lines, INK, 1.8);
        else if (theirs) stroke(theirs, reference.lines, INK, 1.8);
        stroke(mine, model.lines, BLUE, 1);
      }
      data.tools.forEach((tool, k) => stroke(tool.points.map((value, i) => value + shifts[k][i % 2]), tool.lines, GREEN, 1.6));
      if (theirs && ticked.includes("distances")) {
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
      pixels = (i) => [x(mine, i), y(mine, i)];
      if (colours) legend(context, data.colors, colours, data.ask.written);
    };
    const pick = ([u, v]) => {
      const away = (i) => Math.hypot(pixels(i)[0] - u, pixels(i)[1] - v);
      const nearest = candidates.reduce((best, i) => (away(i) < away(best) ? i : best), 0);
      return away(nearest) < 14 ? nearest : -1;
    };
    const candidates = [...Array(data.n_nodes).keys()];
    return Object.assign(paint, { pick, candidates });
  };

  // Fills the triangles of a body; `share` of the range of colours, linear within each.
  function fill(context, at, { triangles, colors }, share) {
    const last = colors.length - 1, smooth = triangles.length / 3 <= SMOOTH;
    const color = (value) => {
      const place = last * Math.min(1, Math.max(0, value)), low = Math.min(Math.floor(place), last - 1);
      return `rgb(${colors[low].map((one, k) => Math.round(one + (place - low) * (colors[low + 1][k] - one)))})`;
    };
    context.lineWidth = 0.8; // covers the seams
    for (let t = 0; t < triangles.length; t += 3) {
      const nodes = [triangles[t], triangles[t + 1], triangles[t + 2]], [p, q, r] = nodes.map(at), [a, b, c] = nodes.map(share);
      const slope = smooth && gradient(p, q, r, a, b, c);
      let paint = color((a + b + c) / 3);
      if (slope) {
        const [low, high] = [Math.min(a, b, c), Math.max(a, b, c)], steep = slope[0] ** 2 + slope[1] ** 2;
        const end = (value) => [p[0] + ((value - a) * slope[0]) / steep, p[1] + ((value - a) * slope[1]) / steep];
        paint = context.createLinearGradient(...end(low), ...end(high));
        const steps = Math.max(1, Math.ceil((high - low) * last));
        for (let k = 0; k <= steps; k++) paint.addColorStop(k / steps, color(low + (k / steps) * (high - low)));
      }
      context.fillStyle = context.strokeStyle = paint;
      context.beginPath();
      context.moveTo(...p);
      context.lineTo(...q);
      context.lineTo(...r);
      context.closePath();
      context.fill();
      context.stroke();
    }
  }

  // The change of a share per pixel in a triangle; null if it is even or the triangle is flat.
  function gradient(p, q, r, a, b, c) {
    const [ux, uy, vx, vy] = [q[0] - p[0], q[1] - p[1], r[0] - p[0], r[1] - p[1]], area = ux * vy - uy * vx;
    if (Math.abs(area) < 1e-6 || Math.max(a, b, c) - Math.min(a, b, c) < 1e-3) return null;
    return [((b - a) * vy - (c - a) * uy) / area, ((c - a) * ux - (b - a) * vx) / area];
  }

  // The range of colours, above the body.
  function legend(context, colors, { title, low, high, unit }, written) {
    const [x, y, long, thick] = [14, 24, 170, 9], ramp = context.createLinearGradient(x, 0, x + long, 0);
    colors.forEach((one, i) => ramp.addColorStop(i / (colors.length - 1), `rgb(${one})`));
    context.font = "12px system-ui, sans-serif";
    context.fillStyle = ramp;
    context.fillRect(x, y, long, thick);
    context.fillStyle = SOFT;
    context.fillText(title, x, y - 8);
    context.fillText(written(low, ""), x, y + thick + 14);
    context.textAlign = "end";
    context.fillText(written(high, unit), x + long, y + thick + 14);
    context.textAlign = "start";
  }
})();
