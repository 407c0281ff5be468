"use strict";
// The scene of a plane. canvas: where it is drawn; data: the page's; motion: the one that is shown, or nothing; load:
// the load case; colours: of bodies and groups. fit: choose the window; draw: bodies at q, members (of a design) in
// colour(row, k), at a time.
const makeScene = ({ canvas, data, motion, load, colours }) => {
  const WIDTH = 760, HEIGHT = 560, g = sharpened(canvas, WIDTH, HEIGHT), glyphs = makeGlyphs(g, data.glyphs);
  const count = data.start.length / 3, GROUND = "#666666", SHARE = 7; // of a row: where its thickness is
  // places: body coordinates to global ones
  const place = (body, [x, y], q) => {
    if (body >= count) return [x, y];
    const c = Math.cos(q[3 * body + 2]), s = Math.sin(q[3 * body + 2]);
    return [q[3 * body] + c * x - s * y, q[3 * body + 1] + s * x + c * y];
  };
  const indexOf = (body, b) => (body.name === "ground" && b === data.bodies.length - 1 ? count : b);

  const lineOf = ({ rows, belts, windows }, k, q, time) => {
    const row = rows[k], acts = actsAt(windows[k], time);
    return { acts, ...memberLine(data.hang, place(row[1], row.slice(3, 5), q), place(row[2], row.slice(5, 7), q), acts ? belts[k] : null) };
  };

  // one window for all frames of a motion, so that it stands still
  let view = null;
  const fit = (members) => {
    const low = [Infinity, Infinity], high = [-Infinity, -Infinity], inner = [], all = [];
    const m = motion(), fixed = members.fixed;
    const frames = m ? m.q.map((q, i) => [q, m.t[i]]).filter((_, i) => members.rows.length < 500 || i % 8 === 0 || i === m.q.length - 1) : [[data.start, null]];
    for (const [q, time] of frames) {
      data.bodies.forEach((body, b) => {
        const index = indexOf(body, b), shape = body.areas.flat(2).concat(body.lines.flat()).map((p) => place(index, p, q));
        for (const p of shape.concat(body.arms.flat().concat(body.borders.flat(), body.points).map((p) => place(index, p, q)))) all.push(p);
        if (index < count) for (const p of shape.concat([place(index, [0, 0], q)])) { inner.push(p); all.push(p); }
      });
      members.rows.forEach((row, k) => { for (const p of lineOf(members, k, q, time).line) { all.push(p); if (!fixed[row[0]]) inner.push(p); } });
    }
    const seen = fixed.every((each) => each) ? all : lookedAt(inner, all, data.far);
    for (const p of seen) for (const k of [0, 1]) { low[k] = Math.min(low[k], p[k]); high[k] = Math.max(high[k], p[k]); }
    const room = 42; // for symbols and names
    const scale = Math.min((WIDTH - 2 * room) / Math.max(high[0] - low[0], 1e-9), (HEIGHT - 2 * room) / Math.max(high[1] - low[1], 1e-9));
    view = { scale, x: WIDTH / 2 - scale * (low[0] + high[0]) / 2, y: HEIGHT / 2 + scale * (low[1] + high[1]) / 2 };
  };
  const screen = (p) => [view.x + view.scale * p[0], view.y - view.scale * p[1]];

  const trace = (points, closed) => {
    points.forEach((p, k) => (k ? g.lineTo(...p) : g.moveTo(...p)));
    if (closed) g.closePath();
  };
  const strokes = (lines, q, index, colour, width, dash, closed) => {
    g.strokeStyle = colour; g.lineWidth = width;
    if (g.setLineDash) g.setLineDash(dash);
    for (const line of lines) { g.beginPath(); trace(line.map((p) => screen(place(index, p, q))), closed); g.stroke(); }
    if (g.setLineDash) g.setLineDash([]);
  };
  const bodies = (q) => data.bodies.forEach((body, b) => {
    const index = indexOf(body, b), colour = index === count ? GROUND : colours[(b + 2) % colours.length];
    for (const loops of body.areas) {
      g.beginPath();
      for (const loop of loops) trace(loop.map((p) => screen(place(index, p, q))), true);
      g.globalAlpha = 0.13; g.fillStyle = colour; g.fill("evenodd"); g.globalAlpha = 1;
      strokes(loops, q, index, colour, 1, [], true);
    }
    g.globalAlpha = 0.85;
    strokes(body.lines, q, index, colour, 2.2, [], false);
    g.globalAlpha = 0.7;
    strokes(body.arms, q, index, colour, body.thin_arms ? 1 : 3, body.thin_arms ? [6, 4] : [], false);
    strokes(body.borders, q, index, colour, 1, [5, 4], true);
    g.globalAlpha = 1; g.fillStyle = colour;
    for (const point of body.points) { const p = screen(place(index, point, q)); g.fillRect(p[0] - 1.5, p[1] - 1.5, 3, 3); }
  });
  const contacts = (q) => {
    for (const each of data.contacts) {
      g.globalAlpha = 0.8;
      strokes([each.edge], q, each.edge_body, "#222222", 1.8, [], false);
      g.globalAlpha = 1; g.strokeStyle = "#222222"; g.lineWidth = 0.8;
      for (const point of each.points) { const p = screen(place(each.body, point, q)); g.beginPath(); g.arc(p[0], p[1], 2.5, 0, 2 * Math.PI); g.stroke(); }
    }
  };
  const names = (q) => writeNames(g, WIDTH, data.bodies.flatMap((body, b) => {
    const index = indexOf(body, b);
    return index === count ? [] : [[body.name, screen(place(index, [0, 0], q)), colours[(b + 2) % colours.length]]];
  }));
  // a length to measure by, and which way is down
  const measures = () => {
    const raw = WIDTH / 6 / view.scale, size = 10 ** Math.floor(Math.log10(raw)), length = [5, 2, 1].map((k) => k * size).find((s) => s <= raw * (1 + 1e-9));
    const x = 14, y = HEIGHT - 14, wide = length * view.scale;
    g.globalAlpha = 1; g.strokeStyle = "#222222"; g.lineWidth = 1.2;
    g.beginPath(); trace([[x, y - 4], [x, y], [x + wide, y], [x + wide, y - 4]], false); g.stroke();
    g.fillStyle = "#222222"; g.font = "12px system-ui, sans-serif"; g.textAlign = "start";
    g.fillText(`${Number(length.toPrecision(3))} m`, x + wide + 6, y);
    const gravity = data.symbols[load()].gravity;
    if (gravity[0] || gravity[1]) { glyphs.draw("gravity", [WIDTH - 24, 16], Math.atan2(gravity[1], gravity[0]), 1, false); g.fillStyle = "#222222"; g.fillText("g", WIDTH - 16, 26); }
  };

  const draw = (q, members, colour, coloured, time) => {
    g.globalAlpha = 1;
    g.clearRect(0, 0, WIDTH, HEIGHT);
    bodies(q);
    contacts(q);
    const thin = 0.6, wide = Math.max(0.8, 3.2 - 0.9 * Math.log10(Math.max(1, members.rows.length / 10)));
    members.rows.forEach((row, k) => {
      const { line, slack, acts } = lineOf(members, k, q, time), shift = members.beside[k] * (thin + wide + data.hang.free);
      g.strokeStyle = colour(row, k);
      g.globalAlpha = coloured ? 0.9 : 0.45 + 0.45 * row[SHARE];
      strokeMember(g, data.hang, shifted(line.map(screen), shift), thin + wide * row[SHARE], slack, acts);
    });
    for (const symbol of symbolsAt(data, load(), time)) {
      const at = place(symbol.body, symbol.at, q), o = symbol.way && place(symbol.axes, [0, 0], q), w = symbol.way && place(symbol.axes, symbol.way, q);
      glyphs.symbol(symbol, screen(at), w && [w[0] - o[0], w[1] - o[1]], symbol.end && screen(place(symbol.end[0], symbol.end[1], q)));
    }
    names(q);
    measures();
    g.globalAlpha = 1;
  };
  return { fit, draw };
};
