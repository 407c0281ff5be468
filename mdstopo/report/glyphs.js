"use strict";
// Symbols of joints, loads and motions, in pixels whatever the scale is. g: what is drawn on; glyphs: the page's.
const makeGlyphs = (g, glyphs) => {
  const INK = "#222222", PAPER = "#ffffff", SCALE = 1.15, END_ON = 0.2;
  const draw = (kind, [x, y], angle, size, mirrored) => {
    const glyph = glyphs[kind], c = SCALE * size * Math.cos(angle), s = SCALE * size * Math.sin(angle);
    for (const stroke of glyph.strokes) {
      const last = stroke[stroke.length - 1], closed = stroke[0][0] === last[0] && stroke[0][1] === last[1];
      g.globalAlpha = 1; g.strokeStyle = INK; g.lineWidth = 1.1;
      g.beginPath();
      stroke.forEach(([a, b], k) => {
        const v = mirrored ? -b : b, p = [x + c * a - s * v, y - s * a - c * v];
        k ? g.lineTo(...p) : g.moveTo(...p);
      });
      if (closed && glyph.fill) { g.fillStyle = glyph.fill === "ink" ? INK : PAPER; g.fill(); }
      g.stroke();
    }
  };
  // one symbol; at, end: places on the screen; way: its direction there, up being positive, or nothing
  const symbol = ({ kind, size }, at, way, end) => {
    if (end) {
      g.globalAlpha = 1; g.strokeStyle = INK; g.lineWidth = 1.4;
      g.beginPath(); g.moveTo(at[0], at[1]); g.lineTo(end[0], end[1]); g.stroke();
      draw(kind, end, 0, 1, false);
    }
    const length = way ? Math.hypot(...way) : 1, angle = way && length > 0 ? Math.atan2(way[1], way[0]) : 0;
    const scale = kind === "load" ? Math.max(0.45, Math.abs(size)) : kind === "motion" || kind === "turning" ? 0.8 : 1;
    if (length < END_ON && (kind === "load" || kind === "motion" || kind === "held")) { g.fillStyle = INK; g.beginPath(); g.arc(at[0], at[1], 3, 0, 2 * Math.PI); g.fill(); return; }
    draw(kind, at, angle, scale, size < 0);
  };
  return { draw, symbol };
};
// the symbols of a load case at a time
const symbolsAt = (data, load, time) => {
  const own = data.symbols[load], many = own.loads.length;
  const share = own.end > own.start && time !== null ? (time - own.start) / (own.end - own.start) : 0;
  return own.still.concat(own.loads[Math.max(0, Math.min(many - 1, Math.round(share * (many - 1))))] || []);
};
// names of bodies [name, place on the screen, colour] beside crosses, none over another and none cut
const writeNames = (g, width, names) => {
  const written = [];
  g.font = "13px system-ui, sans-serif"; g.textAlign = "start"; g.globalAlpha = 1;
  for (const [name, p, colour] of names) {
    const wide = g.measureText(name).width, x = Math.max(2, Math.min(p[0] + 6, width - wide - 2));
    g.fillStyle = colour; g.fillRect(p[0] - 4, p[1] - 0.75, 8, 1.5); g.fillRect(p[0] - 0.75, p[1] - 4, 1.5, 8);
    let y = Math.max(p[1] - 6, 14); // below the names that would be written over
    while (written.some(([x0, y0, w]) => x < x0 + w && x0 < x + wide && Math.abs(y - y0) < 14)) y += 14;
    written.push([x, y, wide]);
    if (g.strokeText) { g.lineWidth = 3; g.strokeStyle = "#ffffff"; g.strokeText(name, x, y); }
    g.fillStyle = colour; g.fillText(name, x, y);
  }
};
// What is looked at: all places, or those of candidates and moving bodies where the rest would make these small
// (plots/cloud.py).
const lookedAt = (inner, all, far) => {
  const extent = (places, k) => {
    let low = Infinity, high = -Infinity;
    for (const p of places) { low = Math.min(low, p[k]); high = Math.max(high, p[k]); }
    return high - low;
  };
  const size = (places) => (places.length ? Math.max(...places[0].map((_, k) => extent(places, k))) : 0);
  const own = size(inner);
  return own > 0 && size(all) > far * own ? inner : all;
};
// a canvas as sharp as the screen is; what draws on it counts in the pixels of the page
const sharpened = (canvas, width, height) => {
  const ratio = Math.min(3, globalThis.devicePixelRatio || 1), g = canvas.getContext("2d");
  canvas.width = width * ratio; canvas.height = height * ratio;
  if (g.setTransform) g.setTransform(ratio, 0, 0, ratio, 0, 0);
  return g;
};
