"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const at = (id) => document.getElementById(id);
  const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C7A00"];
  const state = { design: 0, load: data.load_cases[0], frame: 0, colour: "design", playing: false };
  const cursors = [];

  const number = (x, digits = 5) => (x === null || x === undefined ? "-" : String(Number(Number(x).toPrecision(digits))));
  const text = (id, value) => { at(id).textContent = value; };
  const motion = () => (data.designs[state.design].motions || {})[state.load];

  const current = () => { const m = motion(); return m ? m.q[state.frame] : data.start; };

  const shade = (share) => { // blue (push) over grey to orange (pull)
    const t = Math.max(-1, Math.min(1, share));
    const end = t < 0 ? [0, 114, 178] : [213, 94, 0], mid = [205, 205, 205], a = Math.sqrt(Math.abs(t));
    return `rgb(${mid.map((m, k) => Math.round(m + a * (end[k] - m))).join(",")})`;
  };

  // words, and what the colours and the symbols mean
  const legend = (words, coloured) => {
    const own = data.designs[state.design].members, parts = [document.createElement("span")];
    parts[0].textContent = words;
    const entry = (mark, name, colour) => {
      const part = document.createElement("span"), key = document.createElement("b");
      part.className = "key"; key.textContent = mark; key.style = `color: ${colour}`;
      part.appendChild(key); part.appendChild(Object.assign(document.createElement("span"), { textContent: ` ${name}` }));
      parts.push(part);
    };
    if (!coloured && own.groups.length <= 16) own.groups.forEach((name, k) => entry(own.fixed[k] ? "\u2504" : "\u2501", name, COLOURS[k % COLOURS.length]));
    if (motion() && own.windows.some((each) => each)) entry("\u2508", data.hang.idle.word, data.hang.idle.colour);
    const kinds = new Set(symbolsAt(data, state.load, null).map((each) => each.kind));
    for (const kind of kinds) entry(MARKS[kind] || "\u25cb", data.glyphs[kind].words, "#222222");
    at("legend").replaceChildren(...parts);
  };
  const MARKS = { fixed: "\u25a0", prismatic: "\u25ad", cylindrical: "\u25ad", planar: "\u25b1", distance: "\u2022\u2014\u2022", bushing: "\u2307", load: "\u2192", moment: "\u21ba", motion: "\u21e8", turning: "\u21bb", held: "\u251c\u2524", unturned: "\u2612" };

  const draw = () => {
    const q = current(), m = motion();
    const members = data.designs[state.design].members;
    const forces = state.colour === "force" && m && m.force ? m.force[state.frame] : null;
    const most = forces ? Math.max(1e-12, ...m.force.map((row) => row.reduce((a, f) => Math.max(a, Math.abs(f)), 0))) : 1;
    scene.draw(q, members, (row, k) => (forces ? shade(forces[k] / most) : COLOURS[row[0] % COLOURS.length]), Boolean(forces), m ? m.t[state.frame] : null);
    text("clock", m ? `t = ${number(m.t[state.frame], 4)} s` : "at the start");
    const shown = `${members.rows.length} of ${members.all} members are thick enough to be drawn.`;
    legend(forces ? `${shown} Orange pulls, blue pushes; up to ${number(most, 3)} N.`
      : state.colour === "force" ? `${shown} Forces are shown for springs and gaps only.` : `${shown}${members.what ? ` Width: ${members.what}.` : ""}`, Boolean(forces));
    for (const move of cursors) move();
  };

  const scene = makeScene({ canvas: at("layout"), tools: at("views"), data, motion, load: () => state.load, colours: COLOURS, redraw: draw });

  // small charts
  const SVG = "http://www.w3.org/2000/svg";
  const element = (parent, tag, attributes, content) => {
    const node = document.createElementNS(SVG, tag);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    if (content !== undefined) node.textContent = content;
    parent.appendChild(node);
    return node;
  };
  const ticks = (low, high) => {
    const raw = (high - low) / 4 || 1, size = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((k) => k * size).find((s) => s >= raw);
    const found = [];
    for (let x = Math.ceil(low / step) * step; x <= high + 1e-9 * step; x += step) found.push(Math.abs(x) < 1e-9 * step ? 0 : x);
    return found;
  };
  const chart = (parent, title, xLabel, yLabel, xs, ys, log) => {
    const head = document.createElement("h2");
    head.textContent = title;
    parent.appendChild(head);
    const W = 460, H = 190, L = 62, B = 34, T = 8, R = 10;
    const svg = element(parent, "svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": title });
    const f = log ? Math.log10 : (x) => x;
    const finite = (v) => v.filter((x) => x !== null && Number.isFinite(x));
    const [x0, x1] = [Math.min(...finite(xs)), Math.max(...finite(xs))];
    let [y0, y1] = [f(Math.min(...finite(ys))), f(Math.max(...finite(ys)))];
    if (y0 === y1) { y0 -= 0.5; y1 += 0.5; }
    const pad = 0.06 * (y1 - y0);
    y0 -= pad; y1 += pad;
    const px = (x) => L + (W - L - R) * (x - x0) / ((x1 - x0) || 1), py = (y) => H - B - (H - B - T) * (f(y) - y0) / (y1 - y0);
    for (const x of ticks(x0, x1)) { element(svg, "line", { x1: px(x), x2: px(x), y1: T, y2: H - B, stroke: "#e4e4e4" }); element(svg, "text", { x: px(x), y: H - B + 14, "text-anchor": "middle" }, number(x, 4)); }
    for (const e of ticks(y0, y1)) { const y = log ? 10 ** e : e; element(svg, "line", { x1: L, x2: W - R, y1: py(y), y2: py(y), stroke: "#e4e4e4" }); element(svg, "text", { x: L - 5, y: py(y) + 4, "text-anchor": "end" }, number(y, 3)); }
    element(svg, "text", { x: (L + W - R) / 2, y: H - 3, "text-anchor": "middle" }, xLabel);
    element(svg, "text", { x: 12, y: (T + H - B) / 2, "text-anchor": "middle", transform: `rotate(-90 12 ${(T + H - B) / 2})` }, yLabel);
    return { svg, px, py, top: T, bottom: H - B };
  };
  const line = (c, xs, ys, colour) => element(c.svg, "polyline", {
    points: xs.map((x, i) => (ys[i] === null ? null : `${c.px(x)},${c.py(ys[i])}`)).filter((p) => p).join(" "),
    fill: "none", stroke: colour, "stroke-width": 1.6,
  });

  // a peak with its value, where there is room for it
  const mark = (c, [t, value], colour) => {
    const x = c.px(t), y = c.py(value);
    element(c.svg, "circle", { cx: x, cy: y, r: 3.5, fill: "none", stroke: colour, "stroke-width": 1.6, class: "peak" });
    const left = x > 330, low = y < c.top + 22;
    element(c.svg, "text", { x: x + (left ? -8 : 8), y: y + (low ? 16 : -7), "text-anchor": left ? "end" : "start", class: "peak" }, `${number(value, 5)} at ${number(t, 4)} s`);
  };

  const responses = () => {
    const parent = at("responses");
    parent.replaceChildren();
    cursors.length = 0;
    const m = motion();
    if (data.fit) { fitted(parent, m); return; }
    if (!m) return;
    m.responses.forEach((each) => {
      const place = data.objectives.findIndex((o) => o.name === each.name), objective = data.objectives[place];
      const c = chart(parent, `${each.name}: ${objective.what}`, "time, s", `${each.name}, ${each.unit}`, m.times, each.values);
      line(c, m.times, each.values, COLOURS[place % COLOURS.length]);
      if (each.peak) mark(c, each.peak, COLOURS[place % COLOURS.length]);
      const cursor = element(c.svg, "line", { y1: c.top, y2: c.bottom, stroke: "#000", "stroke-dasharray": "3 3", class: "cursor" });
      cursors.push(() => { const x = c.px(m.t[state.frame]); cursor.setAttribute("x1", x); cursor.setAttribute("x2", x); });
    });
  };

  // of a fit: each series as measured and as fitted, and what is left of it
  const fitted = (parent, m) => {
    data.fit.series.forEach((each, k) => {
      if (each.load_case !== state.load) return;
      const colour = COLOURS[k % COLOURS.length], [times, values] = each.curve || [[], []];
      const c = chart(parent, `${each.name}, measured and fitted: ${each.response}`, "time, s", each.unit || "value", each.t.concat(m ? m.t : times), each.measured.concat(values));
      line(c, times, values, colour);
      each.t.forEach((t, i) => element(c.svg, "circle", { cx: c.px(t), cy: c.py(each.measured[i]), r: 2.2, fill: "none", stroke: "#222", class: "measured" }));
      if (m) {
        const cursor = element(c.svg, "line", { y1: c.top, y2: c.bottom, stroke: "#000", "stroke-dasharray": "3 3", class: "cursor" });
        cursors.push(() => { const x = c.px(m.t[state.frame]); cursor.setAttribute("x1", x); cursor.setAttribute("x2", x); });
      }
      if (!each.residual) return;
      const r = chart(parent, `${each.name}, what is left`, "time, s", "fitted - measured, deviations", each.t.concat(m ? m.t : []), each.residual.concat([-2, 2]));
      for (const level of [-2, 0, 2]) line(r, [Math.min(...each.t), Math.max(...each.t)], [level, level], "#999").setAttribute("stroke-dasharray", level ? "4 3" : "0");
      each.t.forEach((t, i) => element(r.svg, "circle", { cx: r.px(t), cy: r.py(each.residual[i]), r: 2.2, fill: colour, class: "residual" }));
    });
  };
  const correlation = (parent) => {
    const names = data.fit.estimates.map((each) => each.name), rows = data.fit.correlation, n = names.length, L = 34 + 6 * Math.max(...names.map((name) => name.length)), side = Math.min(46, Math.max(n > 8 ? 14 : 36, (455 - L) / n)), W = Math.max(460, L + n * side + 5), H = n * side + 18;
    if (!rows || n < 2) return;
    parent.appendChild(Object.assign(document.createElement("h2"), { textContent: "how errors of estimates go together: correlations" }));
    const svg = element(parent, "svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": "correlations of estimates", class: "correlation" });
    rows.forEach((row, i) => {
      element(svg, "text", { x: L - 6, y: (i + 0.5) * side + 4, "text-anchor": "end" }, `${names[i]}  ${i + 1}`);
      element(svg, "text", { x: L + (i + 0.5) * side, y: n * side + 13, "text-anchor": "middle" }, String(i + 1));
      row.forEach((value, j) => {
        element(svg, "rect", { x: L + j * side, y: i * side, width: side - 1, height: side - 1, fill: value === null ? "#f2f2f2" : shade(value * Math.abs(value)) });
        if (side > 30) element(svg, "text", { x: L + (j + 0.5) * side, y: (i + 0.5) * side + 4, "text-anchor": "middle", style: value !== null && Math.abs(value) > 0.7 ? "fill: #fff" : "" }, value === null ? "-" : value.toFixed(2));
      });
    });
  };
  const profiles = (parent) => {
    data.fit.profiles.forEach((each, k) => {
      const c = chart(parent, `profile of ${each.name}${k ? "" : "; dotted: the parabola of its interval, which ends at the dashed line"}`, each.name, "rise of the squares", each.fine, each.parabola.concat(each.between, each.rise));
      line(c, [each.fine[0], each.fine[each.fine.length - 1]], [each.end, each.end], "#999").setAttribute("stroke-dasharray", "5 4");
      line(c, each.fine, each.parabola, "#666").setAttribute("stroke-dasharray", "1.5 3");
      line(c, each.fine, each.between, COLOURS[0]);
      each.values.forEach((x, i) => mark2(c, x, each.rise[i], COLOURS[0]));
    });
  };
  const estimates = (parent) => {
    const fit = data.fit, known = fit.estimates.some((each) => each.low !== undefined), profiled = fit.profiles.length > 0, share = `${number(100 * fit.confidence)} %`;
    if (fit.estimates[0].value === undefined) return;
    table(parent, ["estimate", "value", ...(known ? ["standard deviation", `${share} from`, "to"] : []), ...(profiled ? ["by profile from", "to"] : []), "between", "derivative"],
      fit.estimates.map((each) => [each.name, number(each.value, 7), ...(known ? [each.at_bound ? `at its ${each.at_bound} bound` : number(each.deviation, 3), number(each.low, 6), number(each.high, 6)] : []),
        ...(profiled ? [number(each.profile_low, 6), number(each.profile_high, 6)] : []), `${number(each.lower)} and ${number(each.upper)}`, each.derivative]));
    table(parent, ["series", "values", "root mean square left", "deviation", "squares / values"],
      fit.series.map((each) => [each.name, String(each.t.length), `${number(each.root_mean_square, 4)} ${each.unit}`,
        `${[...new Set(each.deviation)].map((x) => number(x, 4)).join(" to ")}${each.deviation_estimated ? " (estimated)" : ""}`, each.deviation_estimated ? "" : number(each.chi_square / each.t.length, 3)]));
    for (const sentence of fit.sentences) parent.appendChild(Object.assign(document.createElement("p"), { textContent: sentence, className: "bound" }));
  };

  const mark2 = (c, x, y, colour) => element(c.svg, "circle", { cx: c.px(x), cy: c.py(y), r: 3.5, fill: colour });

  const convergence = () => {
    if (!data.iterations) return;
    data.objectives.forEach((objective, i) => {
      const ys = data.iterations.objectives[i], xs = ys.map((_, k) => k);
      const known = ys.filter((y) => y !== null), log = Math.min(...known) > 0 && Math.max(...known) > 20 * Math.min(...known);
      const bound = objective.bound ? [objective.bound.value] : [], drawn = log && bound.some((y) => y <= 0) ? [] : bound;
      const c = chart(at("convergence"), `convergence of ${objective.name}${data.iterations.kept ? ", best so far; grey: each iterate" : ""}${drawn.length ? "; dashed: its bound" : ""}`, "iteration", `${objective.name}, ${objective.unit}`, xs, ys.concat(drawn), log);
      const kept = data.iterations.kept, most = data.summary[i] && data.summary[i].sense === "maximize";
      line(c, xs, ys, kept ? "#b5b5b5" : COLOURS[i % COLOURS.length]);
      if (kept) { // the best that keeps all limits, so far; of several objectives that of the best combination
        let best = null;
        const order = data.objectives.length > 1 ? data.iterations.combined : ys.map((y) => (most ? -y : y));
        const far = ys.map((y, k) => { if (kept[k] && order[k] !== null && (best === null || order[k] < order[best])) best = k; return best === null ? null : ys[best]; });
        line(c, xs, far, COLOURS[i % COLOURS.length]);
        if (data.iterations.best !== null) mark2(c, data.iterations.best, ys[data.iterations.best], COLOURS[i % COLOURS.length]);
      }
      for (const y of drawn) line(c, [xs[0], xs[xs.length - 1]], [y, y], "#000").setAttribute("stroke-dasharray", "4 3");
    });
  };

  let marks = [];
  const front = () => {
    if (!data.front || data.objectives.length < 2) return;
    for (let i = 0; i < data.objectives.length; i++) for (let j = i + 1; j < data.objectives.length; j++) pair(i, j);
  };
  // two objectives; marks of one design are kept together
  const pair = (i, j) => {
    const points = data.front.objectives, a = data.objectives[i], b = data.objectives[j];
    const xs = points.map((p) => p[i]), ys = points.map((p) => p[j]);
    const c = chart(at("front"), "the front: click a point to see its design", `${a.name}, ${a.unit}`, `${b.name}, ${b.unit}`, xs, ys);
    const good = points.map((_, k) => k).filter((k) => xs[k] !== null && ys[k] !== null && !data.front.dominated[k]).sort((k, n) => xs[k] - xs[n]);
    if (data.objectives.length === 2) line(c, good.map((k) => xs[k]), good.map((k) => ys[k]), "#9cc3de");
    const written = [];
    points.forEach((p, k) => {
      if (xs[k] === null || ys[k] === null) return;
      const usable = Boolean(data.designs[k].members), x = c.px(xs[k]), y = c.py(ys[k]);
      const mark = element(c.svg, "circle", { cx: x, cy: y, r: 5, class: "point", tabindex: 0, role: "button", "data-point": k,
        fill: data.front.dominated[k] ? "#fff" : "#0072B2", stroke: data.front.dominated[k] ? "#D55E00" : "#0072B2" });
      element(mark, "title", {}, `point ${k}: ${a.name} ${number(xs[k])}, ${b.name} ${number(ys[k])}; ${data.front.status[k] === "visited" ? `visited, ${data.front.reason[k]}` : `weights ${data.front.weights[k].map((w) => number(w, 3)).join(", ")}; ${data.front.status[k]}`}`);
      if (!data.front.dominated[k] && !written.some(([u, v]) => Math.abs(u - x) < 16 && Math.abs(v - y) < 12)) {
        written.push([x, y]);
        const left = x > 430;
        element(c.svg, "text", { x: x + (left ? -7 : 7), y: Math.max(y - 6, c.top + 9), "text-anchor": left ? "end" : "start", class: "number" }, String(k));
      }
      const choose = () => { if (usable) { state.design = k; state.frame = 0; refresh(); } };
      mark.addEventListener("click", choose);
      mark.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); choose(); } });
      marks.push([k, mark]);
    });
  };

  const ended = (status, kkt) => status.replace("_", " ") + (kkt === null || kkt === undefined ? "" : `, KKT residual ${kkt.toExponential(1)}`);
  const table = (parent, head, rows) => {
    const made = document.createElement("table"), top = made.insertRow();
    for (const cell of head) { const th = document.createElement("th"); th.textContent = cell; top.appendChild(th); }
    for (const row of rows) { const tr = made.insertRow(); for (const cell of row) tr.insertCell().textContent = cell; }
    parent.appendChild(made);
    return made;
  };
  const SENSE = { limit: "at most", at_least: "at least", equals: "equal to" };
  const results = () => {
    const parent = at("results");
    if (data.fit) estimates(parent);
    if (data.front) table(parent, ["point", ...data.objectives.map((o) => `${o.name}, ${o.unit}`), ""],
      data.front.objectives.map((p, j) => [String(j), ...p.map((x) => number(x, 7)), ended(data.front.status[j], data.front.kkt[j])]));
    else if (data.summary && data.summary.length) table(parent, ["objective", "start", "design", "change"],
      data.summary.map((o) => [`${o.name}, ${o.unit}`, number(o.start, 7), number(o.best, 7), o.start ? `${o.best < o.start ? "" : "+"}${number(100 * (o.best - o.start) / Math.abs(o.start), 3)} %` : ""]));
    if (data.limits && data.limits.length) table(parent, ["constraint", "start", "design", "bound", "margin"],
      data.limits.map((c) => [`${c.what}${c.unit ? `, ${c.unit}` : ""}`, number(c.start, 6), number(c.best, 6), `${SENSE[c.sense]} ${number(c.bound, 6)}`,
        c.sense === "equals" ? number(c.margin, 2) : `${number(c.margin, 4)}${c.bound ? ` (${number(100 * c.margin / Math.abs(c.bound), 3)} %)` : ""}`])).className = "limits";
    for (const o of data.objectives) {
      if (!o.bound) continue;
      const p = document.createElement("p"), gap = o.bound.gap;
      const reached = o.bound.best === null ? "" : `; best ${number(o.bound.best, 7)}${gap === null ? "" : `, a gap of ${number(100 * gap, 3)} %`}`;
      p.textContent = `${o.name}: ${o.bound.above ? "at most" : "at least"} ${number(o.bound.value, 7)} ${o.unit} with any members${reached}. ${o.bound.why}.`;
      p.className = "bound";
      parent.appendChild(p);
    }
  };
  const parts = () => {
    const own = data.designs[state.design].parts || [], forces = own.some((part) => part.force !== undefined);
    const where = (body, p) => `${body} (${p.map((x) => number(x, 4)).join(", ")})`;
    at("parts").replaceChildren();
    table(at("parts"), ["member", "from, m", "to, m", "length, m", "alpha", ...(forces ? ["largest force, N", "at, s", "load case"] : [])],
      own.map((part) => [`${part.group} ${part.member}`, where(part.from, part.p), where(part.to, part.q), number(part.length, 4), number(part.size, 4),
        ...(forces ? [number(part.force, 4), number(part.time, 4), part.load_case] : [])]));
    const all = data.designs[state.design].members.all, note = document.createElement("p");
    note.className = "small";
    note.textContent = `${own.length} of ${all} members${forces ? "; pull is positive" : ""}.`;
    at("parts").appendChild(note);
  };

  const refresh = () => {
    const m = motion(), slider = at("time");
    slider.max = m ? m.t.length - 1 : 0;
    slider.value = state.frame;
    for (const [k, mark] of marks) mark.setAttribute("stroke-width", k === state.design ? 5 : 1.5);
    document.body.dataset.design = state.design;
    scene.fit(data.designs[state.design].members); responses(); parts(); draw();
  };
  const show = (frame) => { state.frame = frame; at("time").value = frame; document.body.dataset.frame = frame; draw(); };

  text("title", data.title);
  text("status", `${ended(data.status, data.kkt)}: ${data.reason}`);
  for (const warning of data.warnings) at("warnings").appendChild(Object.assign(document.createElement("li"), { textContent: warning }));
  text("case", data.case);
  for (const [key, value] of Object.entries({ ...data.versions, ...data.settings })) { const tr = at("versions").insertRow(); tr.insertCell().textContent = key; tr.insertCell().textContent = value; }
  for (const name of data.load_cases) at("loadcase").appendChild(Object.assign(document.createElement("option"), { value: name, textContent: name }));
  at("cases").hidden = data.load_cases.length < 2;
  at("time").addEventListener("input", (event) => show(Number(event.target.value)));
  at("loadcase").addEventListener("change", (event) => { state.load = event.target.value; state.frame = 0; refresh(); });
  at("colour").addEventListener("change", (event) => { state.colour = event.target.value; draw(); });
  at("play").addEventListener("click", () => {
    state.playing = !state.playing;
    text("play", state.playing ? "stop" : "play");
    const step = () => {
      const m = motion();
      if (!state.playing || !m) return;
      show((state.frame + 1) % m.t.length);
      setTimeout(() => requestAnimationFrame(step), 40);
    };
    step();
  });
  state.design = Math.max(0, data.front ? data.designs.findIndex((d, j) => d.members && j >= Math.floor(data.designs.length / 2)) : 0);
  front(); convergence(); results(); refresh();
  if (data.fit) { correlation(at("convergence")); profiles(at("convergence")); }
  if (globalThis.addEventListener) globalThis.addEventListener("beforeprint", () => { for (const each of document.querySelectorAll("details")) each.open = true; });
  document.body.dataset.ready = "yes";
})();
