// Draws the view of a session and sends commands; all that is known is in the view.

const SVG = "http://www.w3.org/2000/svg";
const PAD = { left: 62, right: 14, top: 10, bottom: 38 };
const QUIET = 450; // ms without a key, after which a handle that was moved by keys is released

function h(tag, given = {}, ...children) {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(given)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (key in made && key !== "list" && typeof value !== "string") made[key] = value;
    else if (value !== null && value !== undefined) made.setAttribute(key, value);
  }
  made.append(...children.flat().filter((one) => one !== null && one !== undefined));
  return made;
}

function s(tag, given = {}, ...children) {
  const made = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(given)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

const said = (look, text) => (text ? h("p", { class: look }, text) : null);
const same = (choices) => choices.map((one) => [one, one]);
const press = (name, words, onclick, more = {}) =>
  h("button", { type: "button", "data-do": name, "data-key": name, onclick, ...more }, words);
const link = (key, words, onclick, more = {}) =>
  h("button", { type: "button", class: "link", "data-key": key, onclick, ...more }, words);
const row = (cells, looks = [], more = {}) =>
  h("tr", more, cells.map((one, k) => h("td", { class: looks[k] ?? "" }, one)));
const heads = (words, looks = []) => words.map((one, k) => h("th", { scope: "col", class: looks[k] ?? "" }, one));

function table(rows, { top, look } = {}) {
  const head = top ? h("thead", {}, h("tr", {}, top)) : null;
  return h("div", { class: "scroll" }, h("table", { class: look ?? "" }, head, h("tbody", {}, rows)));
}

const short = (value) => String(Number(Number(value).toPrecision(4)));

function ticks(low, high, most) {
  const rough = (high - low) / Math.max(most, 1);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= rough) ?? rough;
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step && found.length < 30; k++) {
    found.push(Number((k * step).toPrecision(10)));
  }
  return found;
}

// Smallest and largest value of what is drawn, with some room.
function reach(layers, x0, x1) {
  const found = [];
  for (const one of layers) {
    for (const values of [one.low, one.high, one.y].flat(0)) {
      if (values === undefined || one.kind === "span") continue;
      if (!Array.isArray(values)) found.push(values);
      else values.forEach((value, k) => { if (value !== null && one.x[k] >= x0 && one.x[k] <= x1) found.push(value); });
    }
  }
  const low = found.reduce((a, b) => Math.min(a, b), Infinity);
  const high = found.reduce((a, b) => Math.max(a, b), -Infinity);
  if (!found.length) return [0, 1];
  const room = high > low ? 0.05 * (high - low) : 0.5 * (Math.abs(low) || 1);
  return [low - room, high + room];
}

// -- one panel -----------------------------------------------------------------------------------

class Plot {
  constructor(panel, react) {
    this.react = react;
    this.svg = s("svg", { class: "panel", role: "group" });
    this.head = h("figcaption");
    this.key = h("div", { class: "legend" });
    this.figure = h("figure", { "data-panel": panel.key }, this.head, this.svg, this.key);
    this.handles = new Map();
    this.watch = new ResizeObserver(() => { if (!this.holding && this.width !== this.svg.clientWidth) this.draw(); });
    this.watch.observe(this.svg);
    this.set(panel);
  }

  set(panel) {
    this.panel = panel;
    this.moved = null;
    if (!this.holding) this.draw();
  }

  // Draw the model as it was dragged.
  follow(line) {
    this.moved = line;
    for (const path of this.models) path.setAttribute("d", this.path(line.x, line.y));
  }

  // Where a value of a handle stands, in pixels.
  at(one, value) { return this[one.along](one.offset + one.per_unit * value); }

  draw() {
    const panel = this.panel;
    this.width = this.svg.clientWidth || 560;
    this.height = panel.short ? 150 : Math.round(Math.min(300, Math.max(210, this.width * 0.46)));
    const [w, tall] = [this.width - PAD.left - PAD.right, this.height - PAD.top - PAD.bottom];
    const [x0, x1] = panel.x.ends;
    const [y0, y1] = panel.y.ends ?? reach(panel.layers, x0, x1);
    this.x = (value) => PAD.left + ((value - x0) / (x1 - x0 || 1)) * w;
    this.y = (value) => PAD.top + tall - ((value - y0) / (y1 - y0 || 1)) * tall;
    this.from = { x: (px) => x0 + ((px - PAD.left) / w) * (x1 - x0),
      y: (px) => y0 + ((PAD.top + tall - px) / tall) * (y1 - y0) };
    this.box = { w, tall };
    this.svg.setAttribute("viewBox", `0 0 ${this.width} ${this.height}`);
    this.svg.style.height = `${this.height}px`;
    this.svg.setAttribute("aria-label", panel.title);
    this.head.textContent = panel.title;
    const active = this.svg.getRootNode().activeElement;
    const focus = this.svg.contains(active) && active.dataset.handle;
    const within = s("svg", { x: PAD.left, y: PAD.top, width: Math.max(w, 0), height: Math.max(tall, 0),
      viewBox: `${PAD.left} ${PAD.top} ${w} ${tall}`, class: "within" });
    this.models = [];
    for (const layer of panel.layers) within.append(...this.layer(layer));
    const ground = s("rect", { x: PAD.left, y: PAD.top, width: w, height: tall, class: "ground" });
    this.svg.replaceChildren(ground, this.axes(), within);
    if (panel.strike) this.striking(ground);
    this.handles.clear();
    panel.handles.forEach((one, k) => this.svg.append(this.handle(one, k)));
    if (focus) this.handles.get(focus)?.group.focus({ preventScroll: true });
    const named = panel.layers.filter((one) => one.name && one.look !== "bar");
    this.key.replaceChildren(...named.map((one) => h("span", { class: `of ${one.look} ${one.kind}` },
      h("i"), one.name)));
  }

  axes() {
    const { w, tall } = this.box;
    const drawn = s("g", { class: "axes" });
    const bottom = PAD.top + tall;
    for (const value of ticks(...this.panel.x.ends, Math.max(3, w / 90))) {
      const at = this.x(value);
      drawn.append(s("path", { d: `M${at},${PAD.top}V${bottom}` }),
        s("text", { x: at, y: bottom + 15, "text-anchor": "middle" }, short(value)));
    }
    for (const value of ticks(this.from.y(PAD.top + tall), this.from.y(PAD.top), Math.max(2, tall / 45))) {
      const at = this.y(value);
      drawn.append(s("path", { d: `M${PAD.left},${at}H${PAD.left + w}` }),
        s("text", { x: PAD.left - 7, y: at + 4, "text-anchor": "end" }, short(value)));
    }
    const words = ({ label, unit }) => (unit && !label.endsWith(`[${unit}]`) ? `${label} [${unit}]` : label);
    drawn.append(s("text", { x: PAD.left + w / 2, y: this.height - 5, "text-anchor": "middle" }, words(this.panel.x)),
      s("text", { x: 13, y: PAD.top + tall / 2, "text-anchor": "middle",
        transform: `rotate(-90 13 ${PAD.top + tall / 2})` }, words(this.panel.y)));
    return drawn;
  }

  path(x, y) {
    let text = "";
    let pen = "M";
    for (let k = 0; k < x.length; k++) {
      if (x[k] === null || y[k] === null) { pen = "M"; continue; }
      text += `${pen}${this.x(x[k]).toFixed(1)},${this.y(y[k]).toFixed(1)}`;
      pen = "L";
    }
    return text;
  }

  layer(one) {
    const look = { class: `${one.kind} ${one.look}` };
    const { w, tall } = this.box;
    if (one.kind === "line") {
      const { x, y } = (one.look === "model" && this.moved) || one;
      const path = s("path", { ...look, d: this.path(x, y) });
      if (one.name && one.look === "bar") path.append(s("title", {}, one.name));
      if (one.look === "model") this.models.push(path);
      return [path];
    }
    if (one.kind === "lines") return one.many.map((y) => s("path", { ...look, d: this.path(one.x, y) }));
    if (one.kind === "band") {
      const back = this.path([...one.x].reverse(), [...one.low].reverse()).replace("M", "L");
      return [s("path", { ...look, d: `${this.path(one.x, one.high)}${back}Z` })];
    }
    if (one.kind === "span") {
      const left = this.x(one.low);
      const wide = Math.max(this.x(one.high) - left, 1.5);
      return [s("rect", { ...look, x: left, y: PAD.top, width: wide, height: tall }),
        s("rect", { class: `span ${one.look} firm`, x: left, y: PAD.top + tall - 6, width: wide, height: 6 })];
    }
    return [s("path", { ...look, d: `M${PAD.left},${this.y(one.y)}H${PAD.left + w}` })];
  }

  // A handle is a slider: it can be dragged, and moved by the arrow keys.
  handle(one, k) {
    const along = one.along;
    const upright = along === "x";
    const { w, tall } = this.box;
    const group = s("g", { class: `handle ${along}`, tabindex: 0, role: "slider",
      "data-handle": one.name, "data-key": `${this.panel.key}-${one.name}`,
      "aria-label": one.label, "aria-orientation": upright ? "horizontal" : "vertical" });
    const down = PAD.top + 2 + 19 * (k % 4);
    const grip = upright ? `M-8,${down}h16v11l-8,7l-8,-7z` : `M${PAD.left + w},-8h-12l-7,8l7,8h12z`;
    const line = upright ? `M0,${PAD.top}V${PAD.top + tall}` : `M${PAD.left},0H${PAD.left + w}`;
    const words = upright
      ? s("text", { x: 12, y: down + 11 })
      : s("text", { x: PAD.left + w - 24, y: -6, "text-anchor": "end" });
    group.append(s("path", { class: "reach", d: line }), s("path", { class: "rule", d: line }),
      s("path", { class: "grip", d: grip }), words);
    const state = { one, group, words, value: one.value };
    this.handles.set(one.name, state);
    this.place(state, one.value, one.text);
    const drag = (event) => {
      const box = this.svg.getBoundingClientRect();
      const px = upright ? event.clientX - box.left : event.clientY - box.top;
      this.move(state, (this.from[along](px - (state.grabbed ?? 0)) - one.offset) / one.per_unit);
    };
    group.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      event.preventDefault();
      group.focus({ preventScroll: true });
      group.setPointerCapture(event.pointerId);
      const box = this.svg.getBoundingClientRect();
      const here = upright ? event.clientX - box.left : event.clientY - box.top;
      state.grabbed = here - this.at(one, state.value);
      this.holding = true;
    });
    group.addEventListener("pointermove", (event) => { if (group.hasPointerCapture(event.pointerId)) drag(event); });
    for (const end of ["pointerup", "pointercancel"]) {
      group.addEventListener(end, () => { if (this.holding) this.release(state); });
    }
    group.addEventListener("keydown", (event) => this.key_pressed(state, event));
    group.addEventListener("blur", () => { if (state.later) this.release(state); });
    return group;
  }

  key_pressed(state, event) {
    const { one } = state;
    const step = one.step * (event.shiftKey ? 10 : 1);
    const to = { ArrowLeft: state.value - step, ArrowDown: state.value - step, ArrowRight: state.value + step,
      ArrowUp: state.value + step, Home: one.low, End: one.high, PageDown: state.value - 10 * step,
      PageUp: state.value + 10 * step }[event.key];
    if (to === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    this.holding = true;
    this.move(state, to);
    clearTimeout(state.later);
    state.later = setTimeout(() => this.release(state), QUIET);
  }

  move(state, value) {
    this.place(state, Math.min(Math.max(value, state.one.low), state.one.high));
    state.changed = true;
    this.react.moved(this.panel, state.one, state.value);
  }

  place(state, value, text) {
    const { one, group, words } = state;
    state.value = value;
    const px = this.at(one, value);
    const by = one.along === "x" ? `${px.toFixed(2)} 0` : `0 ${px.toFixed(2)}`;
    group.setAttribute("transform", `translate(${by})`);
    const shown = one.along === "x" ? value * one.per_unit : value;
    const told = text ?? `${short(shown)} ${one.along === "x" ? this.panel.x.unit : ""}`.trim();
    if (one.along === "x") {
      const right = px > PAD.left + 0.72 * this.box.w;
      words.setAttribute("x", right ? -12 : 12);
      words.setAttribute("text-anchor", right ? "end" : "start");
    }
    words.textContent = `${one.label} ${told}`;
    for (const [name, now] of [["min", one.low], ["max", one.high], ["now", value]]) {
      group.setAttribute(`aria-value${name}`, now);
    }
    group.setAttribute("aria-valuetext", told);
  }

  release(state) {
    clearTimeout(state.later);
    state.later = null;
    this.holding = false;
    if (!state.changed) return;
    state.changed = false;
    this.react.released(this.panel, state.one, state.value);
  }

  striking(ground) {
    let begin = null;
    let shade = null;
    const here = (event) => this.from.x(event.clientX - this.svg.getBoundingClientRect().left);
    ground.addEventListener("pointerdown", (event) => {
      if (!this.react.strikes()) return;
      ground.setPointerCapture(event.pointerId);
      begin = here(event);
      shade = s("rect", { class: "span out", y: PAD.top, height: this.box.tall });
      this.svg.append(shade);
    });
    ground.addEventListener("pointermove", (event) => {
      if (!shade) return;
      const [a, b] = [begin, here(event)].map(this.x).sort((p, q) => p - q);
      shade.setAttribute("x", a);
      shade.setAttribute("width", b - a);
    });
    ground.addEventListener("pointerup", (event) => {
      if (!shade) return;
      shade.remove();
      shade = null;
      this.react.struck(this.panel, begin, here(event));
    });
  }
}

// -- the page ------------------------------------------------------------------------------------

class App {
  constructor(model, root) {
    this.model = model;
    this.root = root;
    this.waiting = new Map();
    this.mine = Math.random().toString(36).slice(2);
    this.count = 0;
    this.quick = Promise.resolve();
    this.plots = new Map();
    this.drawn = {};
    this.marks = {}; // of what was drawn and need not be drawn again
    model.on("change:answer", () => this.answered(model.get("answer")));
    try {
      this.channel = new BroadcastChannel(`ctrl_realize ${location.pathname}`);
      this.channel.onmessage = () => this.refresh();
    } catch { this.channel = null; }
    this.build();
    this.refresh();
  }

  // Short commands one after another; long ones beside them, so that they can be cancelled.
  ask(command, lane = "quick") {
    const send = () => new Promise((resolve) => {
      const id = `${this.mine}-${++this.count}`;
      this.waiting.set(id, resolve);
      this.model.set("command", { ...command, id });
      this.model.save_changes();
    });
    if (lane !== "quick") return send();
    const next = this.quick.then(send);
    this.quick = next.catch(() => {});
    return next;
  }

  answered(answer) {
    const resolve = this.waiting.get(answer.id);
    this.waiting.delete(answer.id);
    if (resolve) resolve(answer);
    else if (answer.view) this.show(answer.view); // of another view of the same widget
  }

  async refresh() {
    const answer = await this.ask({ do: "view" });
    if (answer.view) this.show(answer.view);
    else if (answer.error) this.say(answer.error);
  }

  async change(command) {
    this.say("");
    this.paused = false;
    const answer = await this.ask(command);
    if (answer.error) {
      this.say(answer.error);
      this.marks = {}; // a choice that was refused is taken back
    }
    if (answer.view) this.show(answer.view);
    this.channel?.postMessage("changed");
  }

  // Newest value only: while one is drawn, the last of the others waits.
  async follow(command, draw) {
    this.wanted = { command, draw };
    if (this.following) return;
    this.following = true;
    while (this.wanted) {
      const { command: now, draw: then } = this.wanted;
      this.wanted = null;
      const answer = await this.ask(now);
      if (answer.error) this.say(answer.error);
      else then(answer);
    }
    this.following = false;
  }

  async compute() {
    if (this.computing || this.paused || !this.view.pending) return;
    this.computing = true;
    const done = this.busy(this.view.pending);
    const answer = await this.ask({ do: "compute" }, "long");
    done();
    this.computing = false;
    this.paused = Boolean(answer.cancelled);
    if (answer.error) this.say(answer.error);
    if (answer.view) this.show(answer.view);
    else this.parts();
    if (!answer.error) this.channel?.postMessage("computed");
  }

  async long(command, words) {
    this.say("");
    const done = this.busy(words);
    const answer = await this.ask(command, "long");
    done();
    if (answer.error) this.say(answer.error);
    return answer;
  }

  busy(words) {
    const begun = performance.now();
    const tell = () => {
      this.status.textContent = `${words} … ${((performance.now() - begun) / 1000).toFixed(1)} s`;
    };
    tell();
    const clock = setInterval(tell, 100);
    this.bar.hidden = false;
    return () => { clearInterval(clock); this.bar.hidden = true; };
  }

  say(text) {
    this.error.textContent = text;
    this.error.hidden = !text;
  }

  build() {
    const input = h("input", { type: "file", multiple: true, hidden: true, onchange: async () => {
      await this.open(input.files);
      input.value = "";
    } });
    this.undo = press("undo", "Undo", () => this.change({ do: "undo" }), { title: "Ctrl+Z" });
    this.redo = press("redo", "Redo", () => this.change({ do: "redo" }), { title: "Ctrl+Y" });
    this.status = h("span", { role: "status", "aria-live": "off" });
    this.bar = h("div", { class: "bar", hidden: true }, h("progress", { "aria-label": "progress" }), this.status,
      press("cancel", "Cancel", () => this.ask({ do: "cancel" }, "long")));
    this.error = h("p", { class: "error", role: "alert", hidden: true });
    this.again = h("p", { class: "under", hidden: true }, "Model and loop are not up to date. ",
      press("fit", "Fit", () => { this.paused = false; this.say(""); this.parts(); this.compute(); }));
    const section = (name) => [name, h("section", { class: `part ${name}`, "data-part": name })];
    this.sections = Object.fromEntries(["data", "model", "loop", "plan", "out"].map(section));
    this.top = h("div", { class: "app", tabindex: -1 },
      h("header", { class: "top" }, h("h1", {}, "Data, model, loop"),
        h("div", { class: "buttons" },
          press("open", "Open files …", () => input.click()), input, this.undo, this.redo,
          press("save", "Save work", () => this.write("work")))),
      this.bar, this.error, this.again, ...Object.values(this.sections));
    this.root.append(this.top);
    this.top.addEventListener("keydown", (event) => {
      const name = { z: "undo", y: "redo" }[event.key.toLowerCase()];
      if (!name || !(event.ctrlKey || event.metaKey) || /INPUT|TEXTAREA/.test(event.target.tagName)) return;
      event.preventDefault();
      this.change({ do: event.shiftKey ? "redo" : name });
    });
    for (const kind of ["dragover", "dragleave", "drop"]) {
      this.top.addEventListener(kind, (event) => {
        event.preventDefault();
        this.top.classList.toggle("over", kind === "dragover");
        if (kind === "drop") this.open(event.dataTransfer.files);
      });
    }
  }

  async open(files) {
    for (const file of files) {
      const bytes = new Uint8Array(await file.arrayBuffer());
      let text = "";
      for (let k = 0; k < bytes.length; k += 32768) text += String.fromCharCode(...bytes.subarray(k, k + 32768));
      await this.change({ do: "open", name: file.name, content: btoa(text) });
    }
  }

  async write(what) {
    const answer = await this.long({ do: "write", what }, "writing");
    if (!answer.written) return;
    const bytes = Uint8Array.from(atob(answer.written.content), (one) => one.charCodeAt(0));
    const link = h("a", { href: URL.createObjectURL(new Blob([bytes])), download: answer.written.name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  show(view) {
    this.view = view;
    this.undo.disabled = !view.can.undo;
    this.redo.disabled = !view.can.redo;
    this.compute(); // goes on while the rest is drawn
    this.parts();
  }

  // What is still to be computed stays as it was drawn, also where it was dragged to.
  parts() {
    const { view } = this;
    const waiting = Boolean(view.pending);
    this.again.hidden = !(waiting && this.paused);
    const { records, selected } = view.state;
    const draw = {
      model: [() => [h("h2", {}, "Model"), ...this.modelled(view)]],
      loop: [() => [h("h2", {}, "Loop"), ...this.looped(view)]],
      data: [() => [h("h2", {}, "Data"), ...this.data(view)], view.data, records, selected, this.strike],
      plan: [() => [h("h2", {}, "Which test next?"), ...this.planned(view)], view.plan, view.state.plan, this.paused,
        records.length],
      out: [() => [h("h2", {}, "Out"), ...this.outward(view)], view.script, !view.model, !view.loop, records.length],
    };
    for (const [name, [call, ...given]] of Object.entries(draw)) {
      const stale = waiting && (name === "model" || name === "loop") && !view[name] && this.drawn[name];
      const mark = given.length ? JSON.stringify(given) : null;
      this.sections[name].classList.toggle("stale", Boolean(stale));
      if (!stale && !(mark && mark === this.marks[name])) {
        this.fill(name, records.length || name === "data" ? call : () => []);
      }
      this.marks[name] = mark;
      this.drawn[name] = records.length && (stale || Boolean(view[name] && !view[name].error));
    }
  }

  // What is being typed, what has the focus and what is open stays.
  fill(name, make) {
    const part = this.sections[name];
    const active = part.getRootNode().activeElement;
    const focus = part.contains(active) ? active.dataset.key : null;
    const typed = new Map();
    for (const one of part.querySelectorAll("input[data-key]")) {
      if (one.type !== "checkbox" && one.value !== one.dataset.shown) typed.set(one.dataset.key, one.value);
    }
    const open = new Set([...part.querySelectorAll("details[open]")].map((one) => one.dataset.key));
    const scrolled = window.scrollY;
    part.replaceChildren(...make().filter(Boolean));
    for (const one of part.querySelectorAll("details")) if (open.has(one.dataset.key)) one.open = true;
    for (const one of part.querySelectorAll("[data-key]")) {
      if (typed.has(one.dataset.key) && one.type !== "range") one.value = typed.get(one.dataset.key);
      if (focus && one.dataset.key === focus) one.focus({ preventScroll: true });
    }
    if (window.scrollY !== scrolled) window.scrollTo(window.scrollX, scrolled);
  }

  figures(panels) {
    const react = {
      moved: (panel, one, value) => this.moved(panel, one, value),
      released: (panel, one, value) => this.released(panel, one, value),
      strikes: () => this.strike,
      struck: (panel, a, b) => this.struck(panel, a, b),
    };
    const drawn = panels.map((panel) => {
      let plot = this.plots.get(panel.key);
      if (plot) plot.set(panel);
      else this.plots.set(panel.key, plot = new Plot(panel, react));
      return plot.figure;
    });
    return h("div", { class: `panels n${panels.length}` }, drawn);
  }

  field(key, label, value, commit, more = {}) {
    const shown = value === null || value === undefined ? "" : String(value);
    const input = h("input", { "data-key": key, "data-shown": shown, type: "text", ...more, onchange: () => {
      input.dataset.shown = input.value;
      commit(input.value.trim());
    } });
    input.value = shown;
    return h("label", {}, label, input);
  }

  choice(key, label, value, choices, commit) {
    const select = h("select", { "data-key": key, onchange: () => commit(select.value) },
      choices.map(([name, words]) => h("option", { value: name, selected: String(name) === String(value) }, words)));
    return h("label", {}, label, select);
  }

  // -- data --------------------------------------------------------------------------------------

  data(view) {
    const { records, panels, preview } = view.data;
    if (!records.length) {
      const { frf } = view.data;
      return [said("under", frf && `Measured frequency response: ${frf}. It is drawn beside the model of a record.`),
        said("drop", "Drop files here, or open them: CSV of loggers and historians, Excel, MATLAB, Parquet, HDF5, "
          + "TDMS, npz; a measured frequency response; or saved work.")];
    }
    const chosen = view.state.selected;
    const rows = records.map((one, k) => row([
      h("input", { type: "checkbox", checked: one.used, "data-key": `use${k}`, "aria-label": `use ${one.name}`,
        onchange: (event) => this.record({ used: event.target.checked }, k) }),
      link(`select${k}`, one.name, () => this.change({ do: "select", index: k })),
      [one.facts, ...one.notes.map((note) => said(one.bad ? "bad" : "under", note))],
      link(`remove${k}`, "remove", () => this.change({ do: "remove", index: k }),
        { "aria-label": `remove ${one.name}` }),
    ], ["", "name"], { class: k === chosen && records.length > 1 ? "best" : "" }));
    const strike = press("strike", this.strike ? "Strike out: drag over the output" : "Strike out …", () => {
      this.strike = !this.strike;
      this.parts();
    }, { "aria-pressed": String(Boolean(this.strike)) });
    const whole = { range: null, rest: null, shift: 0, struck: [] };
    return [
      table(rows, { look: "records" }),
      said("under", view.data.frf && `Measured frequency response: ${view.data.frf}`),
      this.preview(view, preview, chosen),
      panels.length ? h("div", { class: "buttons" }, strike,
        press("restore", "Whole record again", () => this.record(whole))) : null,
      this.figures(panels),
    ];
  }

  preview(view, preview, index) {
    const state = view.state.records[index];
    if (!preview?.columns.length) return null;
    const { options } = state;
    const taken = preview.taken ?? {};
    const read = (more) => this.record({ options: { ...options, ...more } });
    const unit = (more) => this.record({ units: { ...state.units, ...more } });
    const roles = [["", "–"], ...same(["time", "input", "output"])];
    const role = (k) => ["time", "input", "output"].find((name) => taken[name] === k) ?? "";
    const take = (name, k) => {
      const others = Object.entries(taken).filter(([key, value]) => value !== null && value !== k && key !== name);
      if (name) read({ ...Object.fromEntries(others), [name]: k });
    };
    const title = (one) => (one.unit ? `${one.name} [${one.unit}]` : one.name);
    const top = heads(preview.columns.map((one, k) =>
      this.choice(`role${k}`, title(one), role(k), roles, (name) => take(name, k))));
    const most = Math.max(...preview.columns.map((one) => one.cells.length));
    const rows = Array.from({ length: most }, (_, at) =>
      row(preview.columns.map((one) => one.cells[at] ?? ""), preview.columns.map(() => "mono")));
    const units = view.data.panels[0]?.units ?? {};
    const missing = [["auto", "keep and tell"], ...same(["refuse", "keep"]), ["hold", "input holds its value"]];
    // A choice of how to read; the first is that without an argument.
    const how = (key, label, choices) => this.choice(key, label, options[key] ?? choices[0][0], choices,
      (value) => read({ [key]: choices.slice(1).find(([one]) => String(one) === value)?.[0] ?? null }));
    return h("details", { "data-key": "preview", open: view.data.records[index].bad },
      h("summary", {}, "Columns and units as they were read"),
      table(rows, { top, look: "preview" }),
      h("div", { class: "fields" },
        how("time_unit", "unit of time", same(["auto", "s", "ms", "us", "min", "h", "day"])),
        this.field("dt", "sample time in s, if there is no time", options.dt, (value) =>
          read({ dt: value ? Number(value) : null, time: value ? null : options.time })),
        how("missing", "bad cells and gaps", missing),
        how("resample", "jitter", [["", "refuse"], [true, "resample"]]),
        how("decimal", "decimal sign", same(["auto", ".", ","])),
        this.field("unit-input", "unit of the input", units.input, (input) => unit({ input })),
        this.field("unit-output", "unit of the output", units.output, (output) => unit({ output }))));
  }

  struck(panel, a, b) {
    this.strike = false;
    const ends = [a, b].sort((p, q) => p - q).map((one) => one / panel.handles[0].per_unit);
    const { struck } = this.view.state.records[this.view.state.selected];
    this.record({ struck: [...struck, ends] });
  }

  // -- handles -----------------------------------------------------------------------------------

  // What comes later moves with it.
  moved(panel, one, value) {
    if (panel.key.startsWith("record")) return;
    const plot = this.plots.get(panel.key);
    for (const other of plot.handles.values()) {
      if (other.one.along !== "x" || !((other.start ?? other.one.offset) > one.offset)) continue;
      other.start ??= other.one.offset;
      other.one.offset = other.start + (value - one.value) * one.per_unit;
      plot.place(other, other.one.value, other.one.text);
    }
    this.drag(one.name, value);
  }

  drag(name, value) {
    this.follow({ do: "drag", values: { [name]: value } }, ({ drag }) => {
      if (!drag) return;
      for (const [key, line] of Object.entries(drag.lines)) this.plots.get(key)?.follow(line);
      this.told.textContent = drag.misfit.text;
      this.told.classList.toggle("bad", drag.misfit.allowed === false);
      this.told.dataset.steps = Number(this.told.dataset.steps ?? 0) + 1;
      if (name === "dead_time") this.other(value);
    });
  }

  // The dead time has two handles: on the response, and on the criterion.
  other(value) {
    for (const key of ["start", "criterion"]) {
      const plot = this.plots.get(key);
      const state = plot?.handles.get("dead_time");
      if (state && !plot.holding) plot.place(state, value);
    }
  }

  released(panel, one, value) {
    const row = this.view.state.records[this.view.state.selected];
    if (one.name === "start" || one.name === "stop") {
      const ends = Object.fromEntries(panel.handles.map((each) => [each.name, each.value]));
      ends[one.name] = value;
      this.record({ range: [ends.start, ends.stop].sort((a, b) => a - b) });
    } else if (one.name === "rest") {
      const [input, , start] = row.rest ?? [panel.rest_input, 0, panel.step_time];
      this.record({ rest: [input, value, start] });
    } else if (one.name === "step") {
      this.record({ shift: row.shift + value - one.value });
    } else this.know(one.name, value);
  }

  set(part, values, more = {}) { return this.change({ do: "set", part, values, ...more }); }

  record(values, index = this.view.state.selected) { return this.set("record", values, { index }); }

  know(name, value) {
    this.wanted = null;
    const { [name]: _, ...known } = this.view.state.model.known;
    return this.set("model", { known: value === null ? known : { ...known, [name]: value } });
  }

  // -- model -------------------------------------------------------------------------------------

  modelled(view) {
    const { model } = view;
    if (model?.error) return [h("p", { class: "bad" }, model.error)];
    if (!model) return [h("p", { class: "under" }, view.pending && !this.paused ? "Fitting …" : "No model yet.")];
    this.told = h("p", { class: "told", "aria-live": "polite" }, model.misfit?.text ?? "");
    const verdict = (one) => h("div", { class: one.level.replace(" ", "-") },
      h("dt", {}, one.question), h("dd", {}, h("b", {}, one.level), ` ${one.sentence}`));
    return [
      said("formula", model.formula),
      h("dl", { class: "verdicts" }, model.verdicts.map(verdict)),
      model.notes.length ? h("ul", { class: "reasons" }, model.notes.map((one) => h("li", {}, one))) : null,
      this.told,
      this.figures(this.with_plan(view)),
      model.parameters.length ? this.parameters(view) : null,
      model.structures.length ? this.structures(view) : null,
      this.evidence(),
      h("details", { "data-key": "report" }, h("summary", {}, "All of the fit in words"), h("pre", {}, model.report)),
    ];
  }

  with_plan(view) {
    const next = view.plan?.interval;
    return view.model.panels.map((panel) => {
      if (!next || panel.key !== "criterion") return panel;
      const { per_unit } = panel.handles[0];
      const [low, high] = [next.low * per_unit, next.high * per_unit];
      const layer = { kind: "span", look: "next", name: next.text, low, high };
      return { ...panel, layers: [...panel.layers, layer] };
    });
  }

  parameters(view) {
    const looks = ["", "number", "number", "wide"];
    const rows = view.model.parameters.map((one) => {
      const moved = () => {
        if (one.name === "dead_time") this.other(Number(range.value));
        this.drag(one.name, Number(range.value));
      };
      const range = h("input", { type: "range", min: String(one.low), max: String(one.high), step: "any",
        "data-key": `range-${one.name}`, "aria-label": one.label, "aria-valuetext": one.text,
        oninput: moved, onchange: () => this.know(one.name, Number(range.value)),
        onkeydown: (event) => {
          const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
          if (!by) return;
          event.preventDefault();
          range.value = String(Number(range.value) + by * (one.high - one.low) / (event.shiftKey ? 20 : 200));
          moved();
          clearTimeout(this.quiet);
          this.quiet = setTimeout(() => this.know(one.name, Number(range.value)), QUIET);
        } });
      range.value = String(one.value);
      const known = h("input", { type: "checkbox", checked: one.known, "data-key": `known-${one.name}`,
        "aria-label": `${one.label} is known`,
        onchange: () => this.know(one.name, known.checked ? one.value : null) });
      const check = h("label", { class: "check" }, known, "known");
      return row([one.label, one.text, one.interval, range, check], looks, { "data-name": one.name });
    });
    const top = heads(["parameter", "value and std", "95 % interval", "drag", ""], looks);
    return table(rows, { top, look: "parameters" });
  }

  structures(view) {
    const looks = ["", "number", "number", "number", "number"];
    const state = (structure) => this.set("model", { structure, known: {} });
    const rows = view.model.structures.map((one) => row(
      [link(`structure${one.structure}`, one.name, () => state(one.structure)), one.delta_bic, one.dead_time,
        one.interval, one.gain], looks,
      { class: `${one.chosen ? "best" : ""} ${one.ruled_out ? "out" : ""}`,
        "data-structure": one.structure.join(",") }));
    return h("details", { "data-key": "structures", open: true },
      h("summary", {}, "Structures: click to state one"),
      table(rows, { top: heads(["structure", "ΔBIC", "dead time", "95 % interval", "gain"], looks) }),
      view.state.model.structure ? press("choose", "Choose from the data", () => state(null)) : null);
  }

  evidence() {
    const inside = h("div", { class: "evidence" });
    const mark = JSON.stringify([this.view.model.report, this.view.data.frf]);
    const fill = (figures) => inside.replaceChildren(...figures.map((one) => {
      const figure = h("figure", {}, h("figcaption", {}, h("b", {}, one.title), h("span", {}, one.caption)));
      const drawing = new DOMParser().parseFromString(one.svg, "text/html").querySelector("svg");
      if (drawing) figure.append(drawing);
      return figure;
    }));
    const details = h("details", { "data-key": "evidence", ontoggle: async () => {
      if (!details.open || (this.shown?.mark === mark && inside.children.length)) return;
      if (this.shown?.mark !== mark) {
        const answer = await this.long({ do: "figures" }, "drawing");
        if (!answer.figures) return;
        this.shown = { mark, figures: answer.figures };
      }
      fill(this.shown.figures);
    } }, h("summary", {}, "Residual tests, frequency response, plausible models"), inside);
    if (this.shown?.mark === mark) fill(this.shown.figures);
    return details;
  }

  // -- loop --------------------------------------------------------------------------------------

  looped(view) {
    const { loop, choices } = view;
    const given = view.state.loop;
    const tune = (more) => this.set("loop", more);
    const range = h("input", { type: "range", min: "0", max: "1", step: "0.02", "data-key": "speed",
      "aria-label": "from cautious to quick", disabled: !choices.speeds.includes(given.rule),
      oninput: () => this.follow({ do: "slide", speed: Number(range.value) }, ({ slide }) => this.slid(slide)),
      onchange: () => { this.wanted = null; tune({ speed: Number(range.value) }); } });
    range.value = String(given.speed ?? 0.5);
    const ends = (key, label) => {
      const typed = (text) => {
        const found = text.split(/\s*(?:\.\.\.|…|to|;|\s)\s*/).filter(Boolean).map(Number);
        if (!text) tune({ [key]: null });
        else if (found.length === 2 && found.every(Number.isFinite)) tune({ [key]: found });
        else this.say(`${label}: expected two numbers such as 0 to 100, got "${text}"`);
      };
      return this.field(key, label, given[key] ? given[key].join(" to ") : "", typed, { placeholder: "low to high" });
    };
    const number = (key, label) => this.field(key, label, given[key], (text) => {
      if (text && Number.isFinite(Number(text))) tune({ [key]: Number(text) });
      else this.say(`${label}: expected a number, got "${text}"`);
    });
    const kind_for = (rule) => (choices.rules[rule].includes(given.kind) ? given.kind : choices.rules[rule][0]);
    const controls = h("div", { class: "fields" },
      this.choice("rule", "rule", given.rule, same(Object.keys(choices.rules)), (rule) =>
        tune({ rule, kind: kind_for(rule) })),
      this.choice("kind", "controller", given.kind, same(choices.rules[given.rule]), (kind) => tune({ kind })),
      h("label", { class: "speed" }, "cautious – quick", range),
      number("setpoint", "step of the set point"), number("load", "step of the load"),
      ends("limits", "limits of the output, from its level"));
    const form = h("div", { class: "fields" },
      this.choice("form", "form", given.form, Object.entries(choices.forms), (value) => tune({ form: value })),
      this.choice("pid_time_unit", "unit of times", given.time_unit ?? "",
        [["", "of the record"], ...same(choices.time_units)], (value) => tune({ time_unit: value || null })),
      ends("measured_range", "range of the measured value"), ends("output_range", "range of the output"));
    const waits = !loop || view.model?.error;
    if (waits) return [controls, said("under", "Waiting for the model."), form];
    if (loop.error) return [controls, said("bad", loop.error), form];
    this.margins = h("dl", { class: "facts" });
    this.numbers = h("div", { class: "numbers" });
    this.tell(loop);
    const unsafe = h("details", { "data-key": "unsafe" }, h("summary", {}, "It would be unstable if …"),
      h("ul", { class: "reasons" }, loop.unsafe.map((one) => h("li", {}, one))));
    return [controls, this.margins, ...loop.warnings.map((one) => said("warning", one)), said("under", loop.noise),
      loop.unsafe.length ? unsafe : null, this.figures(loop.panels), h("h3", {}, "What to enter"), form, this.numbers];
  }

  tell({ margins, numbers }) {
    const fact = ([name, value]) => h("div", {}, h("dt", {}, name),
      h("dd", { class: /unstable/.test(value) ? "bad" : "" }, value));
    this.margins.replaceChildren(...margins.map(fact));
    const entered = numbers.rows.map(([name, value]) => row([name, h("b", {}, value)], ["", "number"]));
    this.numbers.replaceChildren(...(numbers.error ? [said("bad", numbers.error)]
      : [table(entered), ...numbers.notes.map((one) => said("under", one))]));
  }

  slid(slide) {
    if (!slide) return;
    this.tell(slide);
    for (const panel of slide.panels) {
      this.plots.get(panel.key)?.follow(panel.layers.find((one) => one.look === "model"));
    }
  }

  // -- next test, and out ------------------------------------------------------------------------

  planned(view) {
    const asked = view.state.plan;
    const time = this.field("plan_time", "length in s (empty: as the record)", asked.time ?? "", () => {});
    const go = (want) => this.set("plan", { want, time: Number(time.querySelector("input").value) || null });
    const button = ([want, words]) =>
      press(`plan-${want}`, words, () => go(want), { "aria-pressed": String(asked.want === want) });
    const intro = [said("under", "The input that tells most about …"), h("div", { class: "fields" }, time,
      h("div", { class: "buttons" }, Object.entries(view.choices.want).map(button)))];
    const { plan } = view;
    if (!asked.want) return intro;
    if (!plan) return [...intro, said("under", this.paused ? "Not planned." : "Planning …")];
    if (plan.error) return [...intro, said("bad", plan.error)];
    return [...intro, said("told", plan.interval?.text), this.figures(plan.panels),
      table(plan.rows.map((one) => row(one))),
      h("div", { class: "buttons" }, press("write-plan", "Input as CSV", () => this.write("plan")))];
  }

  outward(view) {
    const words = { report: "HTML report", model: "Model file", script: "Python file", st: "Structured Text", c: "C",
      python: "Python class", matlab: "MATLAB" };
    const button = ([what, label]) =>
      press(`write-${what}`, label, () => this.write(what), { disabled: !view.model || !view.loop });
    const copy = press("copy", "Copy", async () => {
      await navigator.clipboard.writeText(view.script);
      copy.textContent = "Copied";
    });
    return [
      h("div", { class: "buttons" }, Object.entries(words).map(button)),
      said("under", "The same in Python"), h("pre", { class: "script" }, view.script), copy];
  }
}

export function render({ model, el }) {
  let root = el;
  const style = model.get("style");
  if (style) { // in a notebook: apart from the styles of its page
    root = el.attachShadow({ mode: "open" });
    root.append(h("style", {}, style.replaceAll(":root", ":host").replaceAll("body {", ":host {")));
  }
  const app = new App(model, root);
  return () => { app.channel?.close(); for (const plot of app.plots.values()) plot.watch.disconnect(); };
}

export default { render };
