// Runs the scripts of a page on a stand-in for a browser: what is drawn is kept as a list of lines, areas and words.
const fs = require("fs");
const html = fs.readFileSync(process.argv[2], "utf8");
const drawn = [];
let path = [];
const context = {
  clearRect() { drawn.length = 0; }, beginPath() { path = []; }, closePath() {}, arc(x, y) { path.push([x, y]); },
  moveTo(x, y) { path.push([x, y]); }, lineTo(x, y) { path.push([x, y]); },
  stroke() { drawn.push({ kind: "line", path, colour: this.strokeStyle, width: this.lineWidth }); },
  fill() { drawn.push({ kind: "area", path, colour: this.fillStyle }); },
  fillRect(x, y) { drawn.push({ kind: "point", path: [[x, y]], colour: this.fillStyle }); },
  fillText(text, x, y) { drawn.push({ kind: "text", path: [[x, y]], text }); }, measureText: () => ({ width: 10 }),
};
const node = () => {
  const own = { children: [], listeners: {}, dataset: {}, width: 760, height: 560, classList: { add() {} } };
  return Object.assign(own, {
    addEventListener(kind, act) { (own.listeners[kind] = own.listeners[kind] || []).push(act); },
    appendChild(child) { own.children.push(child); return child; },
    replaceChildren(...children) { own.children = children; },
    setAttribute() {}, insertCell: node, insertRow: () => node(), getContext: () => context,
    getBoundingClientRect: () => ({ left: 0, top: 0, width: 760, height: 560 }),
    fire(kind, event) { for (const act of own.listeners[kind] || []) act({ target: own, preventDefault() {}, ...event }); },
  });
};
const known = {};
const at = (id) => (known[id] = known[id] || node());
global.document = { body: node(), getElementById: at, createElement: node, createElementNS: node };
global.requestAnimationFrame = (act) => act();
at("data").textContent = html.match(/<script id="data" type="application\/json">([\s\S]*?)<\/script>/)[1];
for (const [, script] of html.matchAll(/<script>([\s\S]*?)<\/script>/g)) new Function(script)();

const canvas = at("layout"), seen = {};
const keep = (name) => { seen[name] = JSON.parse(JSON.stringify(drawn)); };
const pointer = (kind, id, x, y) => canvas.fire(kind, { pointerId: id, clientX: x, clientY: y, buttons: 1 });
keep("perspective");
at("views").children.slice(0, 3).forEach((button) => { button.fire("click", {}); keep(button.textContent); });
pointer("pointerdown", 1, 300, 300); pointer("pointermove", 1, 340, 320); pointer("pointerup", 1, 340, 320);
keep("turned");
canvas.fire("wheel", { deltaY: -300, clientX: 380, clientY: 280 });
keep("nearer");
canvas.fire("dblclick", {});
keep("back");
pointer("pointerdown", 1, 280, 280); pointer("pointerdown", 2, 480, 280); pointer("pointermove", 2, 680, 280);
keep("spread");
canvas.fire("dblclick", {});
pointer("pointerdown", 3, 300, 300); canvas.fire("pointermove", { pointerId: 3, clientX: 420, clientY: 250, shiftKey: true }); pointer("pointerup", 3, 420, 250);
canvas.fire("wheel", { deltaY: -300, clientX: 200, clientY: 400 });
keep("moved");
at("loadcase").fire("change", { target: { value: "default" } });
keep("chosen again");
canvas.fire("dblclick", {});
at("views").children[2].fire("click", {});
pointer("pointerdown", 4, 100, 300); pointer("pointermove", 4, 257, 300);
keep("turning from the side");
pointer("pointerup", 4, 257, 300);
keep("turned from the side");
canvas.fire("dblclick", {});
at("time").value = 40; at("time").fire("input", {});
keep("later");
process.stdout.write(JSON.stringify({ seen, title: at("title").textContent, clock: at("clock").textContent }));
