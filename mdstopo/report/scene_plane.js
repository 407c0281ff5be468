"use strict";
// The scene of a plane. canvas: where it is drawn; data: the page's; motion: the one that is shown, or nothing;
// colours: of bodies and groups. fit: choose the window; draw: bodies at q, members (rows) in colour(row, k).
const makeScene = ({ canvas, data, motion, colours }) => {
  // places: body coordinates to global ones
  const place = (body, x, y, q) => {
    if (body >= q.length / 3) return [x, y];
    const c = Math.cos(q[3 * body + 2]), s = Math.sin(q[3 * body + 2]);
    return [q[3 * body] + c * x - s * y, q[3 * body + 1] + s * x + c * y];
  };

  // one window for all frames of a motion, so that it stands still
  let view = null;
  const fit = () => {
    const low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    const m = motion();
    const frames = m ? m.q.filter((_, i) => i % 8 === 0 || i === m.q.length - 1) : [data.start];
    for (const q of frames) data.bodies.forEach((body, b) => {
      const index = body.name === "ground" ? q.length : b;
      for (const [x, y] of body.outline.concat(body.points)) {
        const p = place(index, x, y, q);
        for (const k of [0, 1]) { low[k] = Math.min(low[k], p[k]); high[k] = Math.max(high[k], p[k]); }
      }
    });
    const room = 30;
    const scale = Math.min((canvas.width - 2 * room) / Math.max(high[0] - low[0], 1e-9), (canvas.height - 2 * room) / Math.max(high[1] - low[1], 1e-9));
    view = { scale, x: canvas.width / 2 - scale * (low[0] + high[0]) / 2, y: canvas.height / 2 + scale * (low[1] + high[1]) / 2 };
  };
  const screen = (p) => [view.x + view.scale * p[0], view.y - view.scale * p[1]];

  const draw = (q, rows, colour, coloured) => {
    const g = canvas.getContext("2d");
    g.clearRect(0, 0, canvas.width, canvas.height);
    const named = [];
    const name = (text, x, y) => {  // below the names that would be written over
      while (named.some(([x0, y0, w]) => x < x0 + w && x0 < x + g.measureText(text).width && Math.abs(y - y0) < 12)) y += 12;
      named.push([x, y, g.measureText(text).width]);
      g.fillText(text, x, y);
    };
    data.bodies.forEach((body, b) => {
      const ground = body.name === "ground", index = ground ? q.length : b;
      g.beginPath();
      body.outline.forEach(([x, y], k) => { const p = screen(place(index, x, y, q)); k ? g.lineTo(...p) : g.moveTo(...p); });
      g.closePath();
      const colour = ground ? "#555555" : colours[(b + 2) % colours.length];
      g.globalAlpha = 0.12; g.fillStyle = colour; g.fill(); g.globalAlpha = 1; g.strokeStyle = colour; g.lineWidth = 1; g.stroke();
      g.fillStyle = colour;
      for (const [x, y] of body.points) { const p = screen(place(index, x, y, q)); g.fillRect(p[0] - 1.5, p[1] - 1.5, 3, 3); }
      if (!ground) { const p = screen(place(index, 0, 0, q)); name(body.name, p[0] + 5, p[1] - 5); g.fillRect(p[0] - 3, p[1] - 0.5, 6, 1); g.fillRect(p[0] - 0.5, p[1] - 3, 1, 6); }
    });
    rows.forEach((row, k) => {
      const p = screen(place(row[1], row[3], row[4], q)), r = screen(place(row[2], row[5], row[6], q));
      g.strokeStyle = colour(row, k);
      g.globalAlpha = coloured ? 0.9 : 0.25 + 0.65 * row[7];
      g.lineWidth = 0.4 + 2 * row[7];
      g.beginPath(); g.moveTo(...p); g.lineTo(...r); g.stroke();
    });
    g.globalAlpha = 1;
  };
  return { fit, draw };
};
