"use strict";
// The scene in space: it turns under the mouse. canvas: where it is drawn; tools: where its buttons go; data: the
// page's; motion: the one that is shown, or nothing; load: the load case; colours: of bodies and groups; redraw: draws
// all anew. fit: choose the window; draw: bodies at q, members (of a design) in colour(row, k), at a time. What is
// farther is drawn first.
const makeScene = ({ canvas, tools, data, motion, load, colours, redraw }) => {
  const WIDTH = 760, HEIGHT = 560, g = sharpened(canvas, WIDTH, HEIGHT), glyphs = makeGlyphs(g, data.glyphs), [right, away, up] = data.upright;
  const DISTANCE = 4, SMALLEST = 0.5; // in radii of the scene: distance of the eye; what fills the view at least
  const GRID = "#c9c9c9", CONTACT = "#8a8a8a", AXES = ["#B22222", "#2E7D32", "#1F4FA3"];
  const SHARE = 9; // of a row: where its thickness is
  const THIN = 0.4, WIDE = 2.4; // pixels: the thinnest member, and by how much the widest is wider
  const VIEWS = { front: [0, 0], top: [0, 90], side: [90, 0], perspective: [32, 24] }; // degrees: turn, rise
  const camera = { turn: 0, rise: 0, zoom: 1, x: 0, y: 0, flat: false };
  let cloud = [], shift = [0, 0], low = [0, 0, 0], high = [0, 0, 0], middle = [0, 0, 0], radius = 1, scale = 1, across, along, toward;

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const sum = (a, s, b, t) => [s * a[0] + t * b[0], s * a[1] + t * b[1], s * a[2] + t * b[2]];
  const aim = () => {
    const cosTurn = Math.cos(camera.turn), sinTurn = Math.sin(camera.turn);
    const level = sum(away, cosTurn, right, -sinTurn);
    across = sum(right, cosTurn, away, sinTurn);
    toward = sum(up, Math.sin(camera.rise), level, -Math.cos(camera.rise));
    along = sum(up, Math.cos(camera.rise), level, Math.sin(camera.rise));
  };

  // rotation matrix and place of every body; the last one is ground
  const seats = (q) => {
    const found = [];
    for (let i = 0; i < q.length; i += 7) {
      const [w, x, y, z] = q.slice(i + 3, i + 7);
      found.push([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], q.slice(i, i + 3)]);
    }
    found.push([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]]);
    return found;
  };
  const place = ([a, b, c, d], p) => [dot(a, p) + d[0], dot(b, p) + d[1], dot(c, p) + d[2]];
  const indexOf = (body, b) => (body.name === "ground" && b === data.bodies.length - 1 ? data.start.length / 7 : b);

  // x to the right and y down from the middle of the scene, m, as the eye sees it, and how near it is
  const projected = (p) => {
    const r = sum(p, 1, middle, -1), near = dot(r, toward), s = 1 / (camera.flat ? 1 : Math.max(1 - near / (DISTANCE * radius), 0.02));
    return [s * dot(r, across), -s * dot(r, along), near];
  };
  // x, y on the screen and how near it is
  const seen = (p) => {
    const [x, y, near] = projected(p), zoom = camera.zoom;
    return [WIDTH / 2 + camera.x + zoom * (shift[0] + scale * x), HEIGHT / 2 + camera.y + zoom * (shift[1] + scale * y), near];
  };

  const lineOf = ({ rows, belts, windows }, k, all, time) => {
    const row = rows[k], acts = actsAt(windows[k], time);
    return { acts, ...memberLine(data.hang, place(all[row[1]], row.slice(3, 6)), place(all[row[2]], row.slice(6, 9)), acts ? belts[k] : null) };
  };

  // one window for all frames of a motion, so that it stands still
  const fit = (members) => {
    const m = motion(), inner = [], every = [], fixed = members.fixed;
    const frames = m ? m.q.map((q, i) => [q, m.t[i]]).filter((_, i) => members.rows.length < 500 || i % 8 === 0 || i === m.q.length - 1) : [[data.start, null]];
    frames.forEach(([q, time], f) => {
      const all = seats(q);
      data.bodies.forEach((body, b) => {
        const index = indexOf(body, b), moves = index < all.length - 1;
        if (f && !moves) return;
        for (const p of body.corners.concat(moves ? [[0, 0, 0]] : [])) { every.push(place(all[index], p)); if (moves) inner.push(place(all[index], p)); }
        for (const p of body.points) every.push(place(all[index], p));
      });
      members.rows.forEach((row, k) => { for (const p of lineOf(members, k, all, time).line) { every.push(p); if (!fixed[row[0]]) inner.push(p); } });
      for (const surface of data.surfaces) if (!surface.endless) for (const p of surface.lines.flat()) every.push(place(all[surface.body], p));
    });
    cloud = fixed.every((each) => each) ? every : lookedAt(inner, every, data.far);
    const reach = (pick, k) => cloud.reduce((a, p) => pick(a, p[k]), cloud.length ? cloud[0][k] : 0);
    low = [0, 1, 2].map((k) => reach(Math.min, k));
    high = [0, 1, 2].map((k) => reach(Math.max, k));
    middle = sum(low, 0.5, high, 0.5);
    radius = Math.max(0.5 * Math.hypot(...sum(high, 1, low, -1)), 1e-9);
    frame();
  };
  // the scale and the place at which all is seen from where the eye is, with room for symbols and names; the user's
  // moves and zoom come on top of them. It is chosen anew while the scene turns, so that this never leaves the view; a long
  // scene that is seen from its end is not drawn so large that it shrinks much as it turns.
  const frame = () => {
    aim();
    if (!cloud.length) return;
    const least = [Infinity, Infinity], most = [-Infinity, -Infinity], room = 46;
    for (const p of cloud) { const s = projected(p); for (const k of [0, 1]) { least[k] = Math.min(least[k], s[k]); most[k] = Math.max(most[k], s[k]); } }
    scale = Math.min(...[WIDTH, HEIGHT].map((whole, k) => (whole - 2 * room) / Math.max(most[k] - least[k], SMALLEST * radius)));
    shift = [0, 1].map((k) => -0.5 * scale * (least[k] + most[k]));
  };

  const stepOf = (length) => { const size = 10 ** Math.floor(Math.log10(length / 9)); return [1, 2, 5, 10].map((k) => k * size).find((s) => s >= length / 9 * (1 - 1e-9)); };
  const axisOf = (way) => [0, 1, 2].find((k) => way[k] !== 0);
  const line = (a, b, colour, width, alpha) => { g.strokeStyle = colour; g.lineWidth = width; g.globalAlpha = alpha; g.beginPath(); g.moveTo(a[0], a[1]); g.lineTo(b[0], b[1]); g.stroke(); };
  const write = (text, p, colour) => { g.globalAlpha = 1; g.fillStyle = colour; g.fillText(text, p[0], p[1]); };

  // a grid at the foot of the scene, with coordinates along the edges that are nearer
  const ground = () => {
    const i = axisOf(right), j = axisOf(away), k = axisOf(up), step = stepOf(2 * radius);
    const ends = [i, j].map((n) => [Math.floor(low[n] / step + 1e-9) * step, Math.ceil(high[n] / step - 1e-9) * step]);
    const at = (a, b) => { const p = [0, 0, 0]; p[i] = a; p[j] = b; p[k] = up[k] > 0 ? low[k] : high[k]; return p; };
    g.font = "11px system-ui, sans-serif"; g.textAlign = "center";
    for (const n of [0, 1]) {
      const [from, to] = ends[n], [start, end] = ends[1 - n];
      for (let c = from; c <= to + 1e-9 * step; c += step) {
        const a = seen(n ? at(start, c) : at(c, start)), b = seen(n ? at(end, c) : at(c, end));
        line(a, b, GRID, 1, 0.7);
        if (Math.abs(dot(up, toward)) < 0.02) continue; // the grid is seen from its edge
        const [near, far] = a[2] > b[2] ? [a, b] : [b, a], long = Math.hypot(near[0] - far[0], near[1] - far[1]) || 1;
        const out = [near[0] + 14 * (near[0] - far[0]) / long, near[1] + 14 * (near[1] - far[1]) / long + 4];
        if (out[0] > 12 && out[0] < WIDTH - 12 && out[1] > 12 && out[1] < HEIGHT - 4) write(`${Number(c.toPrecision(6))}`, out, "#777777");
      }
    }
  };
  const corner = () => {
    g.font = "bold 13px system-ui, sans-serif"; g.textAlign = "center";
    const foot = [48, HEIGHT - 48];
    [0, 1, 2].forEach((k) => {
      const tip = [foot[0] + 30 * across[k], foot[1] - 30 * along[k]];
      line(foot, tip, AXES[k], 2, 1);
      write("xyz"[k], [foot[0] + 40 * across[k], foot[1] - 40 * along[k] + 4], AXES[k]);
    });
    g.textAlign = "start"; g.font = "12px system-ui, sans-serif";
    write(`grid: ${Number(stepOf(2 * radius).toPrecision(3))} m`, [14, HEIGHT - 6], "#777777");
  };

  const polygon = (points, colour, alpha) => { g.globalAlpha = alpha; g.fillStyle = colour; g.beginPath(); points.forEach((p, i) => (i ? g.lineTo(p[0], p[1]) : g.moveTo(p[0], p[1]))); g.closePath(); g.fill(); };
  const mean = (points) => points.reduce((a, p) => a + p[2], 0) / points.length;

  const draw = (q, members, colour, coloured, time) => {
    aim();
    g.globalAlpha = 1;
    g.clearRect(0, 0, WIDTH, HEIGHT);
    ground();
    const all = seats(q), things = [], names = []; // things: how near, and what draws it
    data.bodies.forEach((body, b) => {
      const seat = all[indexOf(body, b)], fixed = indexOf(body, b) === all.length - 1;
      const own = fixed ? "#555555" : colours[(b + 2) % colours.length], corners = body.corners.map((p) => seen(place(seat, p)));
      for (const face of body.faces) {
        const points = face.map((k) => corners[k]);
        const area = points.reduce((a, p, i) => { const r = points[(i + 1) % points.length]; return a + p[0] * r[1] - r[0] * p[1]; }, 0);
        if (!body.convex && body.faces.length > 1 && area > 0) continue; // of what is not a hull only the front
        const alpha = body.faces.length < 2 ? 0.15 : area < 0 ? 0.24 : 0.1; // those that look to the eye are stronger
        things.push([mean(points), () => polygon(points, own, alpha)]);
      }
      for (const [m, n] of body.edges) things.push([(corners[m][2] + corners[n][2]) / 2, () => line(corners[m], corners[n], own, body.faces.length ? 1.2 : 1.5, body.faces.length ? 0.9 : 0.6)]);
      for (const p of body.points) { const s = seen(place(seat, p)); things.push([s[2], () => { g.globalAlpha = 1; g.fillStyle = own; g.fillRect(s[0] - 1.5, s[1] - 1.5, 3, 3); }]); }
      if (!fixed) names.push([body.name, seen(seat[3]), own]);
    });
    for (const surface of data.surfaces) for (const corners of surface.lines) {
      const flat = corners.map((p) => seen(place(all[surface.body], p)));
      for (let k = 1; k < flat.length; k++) things.push([(flat[k - 1][2] + flat[k][2]) / 2, () => line(flat[k - 1], flat[k], CONTACT, 0.8, 0.8)]);
    }
    members.rows.forEach((row, k) => {
      const { line: corners, slack, acts } = lineOf(members, k, all, time), shift = members.beside[k] * (THIN + WIDE + data.hang.free), flat = corners.map((p) => seen(p)), near = (flat[0][2] + flat[flat.length - 1][2]) / 2;
      const clear = 0.8 + 0.2 * Math.max(-1, Math.min(1, near / radius)); // what is farther is paler
      things.push([near, () => {
        g.strokeStyle = colour(row, k); g.globalAlpha = clear * (coloured ? 0.95 : 0.25 + 0.7 * row[SHARE]);
        strokeMember(g, data.hang, shifted(flat, shift), THIN + WIDE * row[SHARE], slack, acts);
      }]);
    });
    for (const symbol of symbolsAt(data, load(), time)) {
      const centre = place(all[symbol.body], symbol.at), s = seen(centre), end = symbol.end && seen(place(all[symbol.end[0]], symbol.end[1]));
      const seat = all[symbol.axes], way = symbol.way && [0, 1, 2].map((k) => dot(seat[k], symbol.way));
      if (way && !["load", "motion", "held"].includes(symbol.kind)) { // its axis, as long as it is in perspective
        const [a, b] = [-0.07, 0.07].map((t) => seen(sum(centre, 1, way, t * radius)));
        things.push([s[2], () => line(a, b, "#222222", 1.5, 1)]);
      }
      things.push([s[2] + 1e-6 * radius, () => glyphs.symbol(symbol, s, way && [dot(way, across), dot(way, along)], end)]);
    }
    things.sort((a, b) => a[0] - b[0]);
    for (const [, paint] of things) paint();
    writeNames(g, WIDTH, names);
    corner();
    g.globalAlpha = 1;
  };

  const look = (name) => {
    [camera.turn, camera.rise] = VIEWS[name].map((degrees) => degrees * Math.PI / 180);
    Object.assign(camera, { zoom: 1, x: 0, y: 0, flat: name !== "perspective" });
    frame();
  };
  const turn = (dx, dy) => {
    camera.flat = false;
    camera.turn -= 0.01 * dx;
    camera.rise = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, camera.rise + 0.01 * dy));
  };
  const inside = (event) => { const r = canvas.getBoundingClientRect(), k = WIDTH / (r.width || WIDTH); return [k * (event.clientX - r.left), k * (event.clientY - r.top)]; };
  const zoom = (factor, [x, y]) => { // the place under the pointer stays
    const next = Math.max(0.05, Math.min(50, camera.zoom * factor)), k = next / camera.zoom;
    camera.x = (1 - k) * (x - WIDTH / 2) + k * camera.x;
    camera.y = (1 - k) * (y - HEIGHT / 2) + k * camera.y;
    camera.zoom = next;
  };
  let asked = false; // many moves of the mouse, one picture
  const again = () => { if (!asked) { asked = true; requestAnimationFrame(() => { asked = false; frame(); redraw(); }); } };

  const fingers = new Map();
  const between = (a, b) => [[(a[0] + b[0]) / 2, (a[1] + b[1]) / 2], Math.hypot(a[0] - b[0], a[1] - b[1])];
  canvas.addEventListener("pointerdown", (event) => { fingers.set(event.pointerId, inside(event)); if (canvas.setPointerCapture) canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    const before = [...fingers.values()], last = fingers.get(event.pointerId), now = inside(event);
    fingers.set(event.pointerId, now);
    if (before.length === 2) {
      const [c0, d0] = between(...before), [c1, d1] = between(...fingers.values());
      camera.x += c1[0] - c0[0]; camera.y += c1[1] - c0[1];
      if (d0 > 0) zoom(d1 / d0, c1);
    } else if (event.shiftKey || (event.buttons & 6)) { camera.x += now[0] - last[0]; camera.y += now[1] - last[1]; } else turn(now[0] - last[0], now[1] - last[1]);
    again();
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(-0.0015 * event.deltaY), inside(event)); again(); }, { passive: false });
  canvas.addEventListener("dblclick", () => { look("perspective"); redraw(); });
  canvas.addEventListener("keydown", (event) => {
    const moves = { ArrowLeft: [-10, 0], ArrowRight: [10, 0], ArrowUp: [0, -10], ArrowDown: [0, 10] }[event.key];
    if (moves) { turn(...moves); frame(); } else if (event.key === "+" || event.key === "-") zoom(event.key === "+" ? 1.15 : 1 / 1.15, [WIDTH / 2, HEIGHT / 2]); else return;
    event.preventDefault(); redraw();
  });
  for (const name of Object.keys(VIEWS)) {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: name });
    button.addEventListener("click", () => { look(name); redraw(); });
    tools.appendChild(button);
  }
  tools.appendChild(Object.assign(document.createElement("span"), { className: "small", textContent: "drag: turn; wheel or two fingers: zoom; shift and drag: move; double click: back" }));
  canvas.tabIndex = 0;
  canvas.classList.add("turns");
  look("perspective");
  aim();
  return { fit, draw };
};
