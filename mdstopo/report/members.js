"use strict";
// Members as the pictures of `mdstopo plot` draw them (plots/slack.py, plots/beside.py).

// Corners of a member between two places, and whether it is slack. belt: how long it is as a belt, or null; one that is
// longer than its ends are apart hangs down as a parabola.
const memberLine = (hang, p, q, belt) => {
  const apart = Math.hypot(...p.map((x, k) => q[k] - x)), spare = belt === null ? 0 : belt - apart;
  if (!(spare > hang.slack * belt)) return { line: [p, q], slack: false };
  const deep = Math.min(Math.sqrt(0.375 * apart * spare), hang.deepest * apart);
  const line = Array.from({ length: hang.corners }, (_, i) => {
    const s = i / (hang.corners - 1), depth = 4 * deep * s * (1 - s);
    return p.map((x, k) => (1 - s) * x + s * q[k] + depth * hang.down[k]);
  });
  return { line, slack: true };
};
// corners on the screen, shifted to the left of the way from the first to the last
const shifted = (line, pixels) => {
  const [a, b] = [line[0], line[line.length - 1]], dx = b[0] - a[0], dy = b[1] - a[1], long = Math.hypot(dx, dy);
  return pixels && long ? line.map((p) => [p[0] + pixels * dy / long, p[1] - pixels * dx / long]) : line;
};
// whether a member acts at a time: windows, from when on and until when each of its laws does, null where a side is open;
// no windows, or no time: it does
const actsAt = (windows, time) => !windows || time === null || windows.some(([from, until]) => (from === null || time >= from) && (until === null || time < until));
// a member on the screen; a slack one is thin and dashed, one that does not act thin and dotted in grey
const strokeMember = (g, hang, line, width, slack, acts) => {
  const dashes = acts ? hang.dashes : hang.idle.dots;
  g.lineWidth = acts ? (slack ? hang.thin * width : width) : hang.idle.width;
  if (!acts) g.strokeStyle = hang.idle.colour;
  if ((slack || !acts) && g.setLineDash) g.setLineDash(dashes);
  g.beginPath();
  line.forEach((p, k) => (k ? g.lineTo(p[0], p[1]) : g.moveTo(p[0], p[1])));
  g.stroke();
  if ((slack || !acts) && g.setLineDash) g.setLineDash([]);
};
