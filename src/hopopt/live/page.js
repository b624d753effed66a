"use strict";
(() => {
  const $ = (id) => document.getElementById(id);
  const NS = "http://www.w3.org/2000/svg";
  const svg = (parent, name, attributes = {}, text = "") => {
    const made = document.createElementNS(NS, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    made.textContent = text;
    parent.append(made);
    return made;
  };
  const html = (parent, name, attributes = {}, text = "") => {
    const made = document.createElement(name);
    Object.assign(made, attributes);
    if (text) made.textContent = text;
    parent.append(made);
    return made;
  };
  const shown = (x) => (x === null || x === undefined ? "" : Number(x.toPrecision(4)).toString());
  const signed = (x) => (x < 0 ? "−" : "+");
  const height = (x) => (x === null ? "nothing" : `${x.toFixed(3)} m`);
  const small = (x) => {  // a difference in the objective
    const size = Math.abs(x);
    if (state.unit === "m") return `${size < 1e-5 ? "< 0.01" : Number((1000 * size).toPrecision(2))} mm`;
    return `${size < 1e-6 ? "< 0.000001" : Number(size.toPrecision(2))}${state.unit === "1" ? "" : ` ${state.unit}`}`;
  };
  let state = null, live = null, asked = {}, t = 0, before = null, drawn = null, waiting = null;

  // ---- what is asked ------------------------------------------------------------------------------------------
  const ask = (what, given = null) => {
    if (live && live.readyState === WebSocket.OPEN) live.send(JSON.stringify({ [what]: given }));
  };
  const drag = (entry, value) => {
    asked[entry] = value;
    aged();
    if (waiting === null) waiting = setTimeout(() => { waiting = null; ask("set", { ...asked }); }, 30);
  };
  const aged = () => {  // no number stands under a slider that it does not belong to
    const old = state === null || state.stale || Object.keys(asked).length > 0 || !state.now;
    for (const id of ["value", "error", "family", "limits", "lines", "leg", "charts"]) {
      $(id).classList.toggle("stale", old || !["preliminary", "verified", "not verified"].includes(state.now.word));
    }
    if (old && state && state.now) { $("word").textContent = "solving"; $("word").className = "word"; $("sentence").textContent = ""; }
  };

  // ---- words --------------------------------------------------------------------------------------------------
  const words = () => {
    const now = state.now;
    $("kind").textContent = `Problem ${state.problem}, objective ${state.objective}`;
    $("title").textContent = `${state.title}: drag a number and watch the leg hop`;
    document.title = `${state.title}: hopopt explore`;
    $("busy").textContent = state.fault ? "" : state.busy;
    $("said").textContent = state.said;
    if (state.fault) { $("word").textContent = "no hop"; $("word").className = "word bad"; $("sentence").textContent = state.fault; return; }
    if (!now) { $("word").textContent = "searching"; return; }
    if (now.value !== null) $("value").textContent = `${now.value.toFixed(3)} ${state.unit === "1" ? "" : state.unit}`;
    $("word").textContent = now.word;
    $("word").className = `word ${{ preliminary: "preliminary", verified: "verified" }[now.word] || "bad"}`;
    $("error").textContent = now.word === "preliminary" && now.error !== null
      ? `first mesh alone, estimated error ${small(now.error)}; it is verified when the hands rest` : "";
    $("sentence").textContent = now.sentence || (now.switched ? "Another family of hops is the best here." : "");
    $("family").textContent = now.words ? `The hop: ${now.words}.` : "";
    $("limits").textContent = now.limits.length
      ? "1 % more of " + now.limits.map((l) => `${l.entry}: ${signed(l.percent)}${small(l.percent)}`).join("; ") : "";
    const lines = state.lines || {}, told = [];
    if (lines.pd) told.push(lines.pd.clearance === null ? `The paper's PD control does not hop on this leg: ${lines.pd.why}.` : `The paper's PD control reaches ${height(lines.pd.clearance)}.`);
    if (lines.reached) {
      const part = Math.round(100 * lines.reached.share);
      told.push(`${part} % of robots reach ${height(lines.reached.tracked)} tracking a plan and ${height(lines.reached.pd)} by PD control.`);
    }
    $("lines").textContent = told.join(" ");
  };

  // ---- sliders ------------------------------------------------------------------------------------------------
  const sliders = () => {
    const form = $("sliders"), key = JSON.stringify(state.sliders);
    if (form.dataset.key !== key) {
      form.dataset.key = key;
      form.replaceChildren();
      for (const s of state.sliders) {
        const row = html(form, "div", { className: "slider" }), id = `slider ${s.entry}`.replaceAll(" ", "-");
        const label = html(row, "label", { htmlFor: id }, s.entry + " ");
        html(label, "small", {}, s.unit === "1" ? "" : `[${s.unit}]`);
        label.title = s.meaning;
        const limits = { min: s.low, max: s.high, step: s.step };
        const range = html(row, "input", { type: "range", id, ...limits });
        const number = html(row, "input", { type: "number", ariaLabel: `${s.entry} as a number`, min: s.low, max: s.high, step: "any" });
        range.addEventListener("input", () => { number.value = range.value; drag(s.entry, Number(range.value)); });
        number.addEventListener("change", () => {
          if (number.value.trim() === "" || !Number.isFinite(Number(number.value))) { number.value = range.value; return; }
          const held = Math.min(s.high, Math.max(s.low, Number(number.value))), x = s.step === 1 ? Math.round(held) : held;
          range.value = number.value = x;
          drag(s.entry, x);
        });
        row.dataset.entry = s.entry;
      }
      for (const [id, none] of [["first", null], ["second", "nothing else"]]) {
        const chosen = $(id).value;
        $(id).replaceChildren();
        if (none) html($(id), "option", { value: "" }, none);
        for (const s of state.sliders) html($(id), "option", { value: s.entry }, s.entry);
        if (chosen) $(id).value = chosen;
      }
    }
    for (const row of form.children) {
      const [range, number] = row.querySelectorAll("input"), entry = row.dataset.entry, value = state.values[entry];
      if (entry in asked || value === undefined) continue;
      if (Number(range.value) !== value) range.value = value;
      if (document.activeElement !== number) number.value = Number(value.toPrecision(6));
    }
    const parts = $("parts");
    if (!parts.children.length) {
      for (const [path, names] of Object.entries(state.parts)) {
        const label = html(parts, "label", {}, `${path} `), chosen = html(label, "select");
        html(chosen, "option", { value: "" }, "as in the problem");
        for (const name of names) html(chosen, "option", { value: name }, name);
        chosen.dataset.path = path;
        chosen.addEventListener("change", () => { ask("choose", { path, name: chosen.value }); });
      }
    }
    for (const chosen of parts.querySelectorAll("select")) chosen.value = state.chosen[chosen.dataset.path];
    $("undo").disabled = !state.undo;
  };

  // ---- pictures -----------------------------------------------------------------------------------------------
  const W = 520, H = 360, L = 62, R = 12, T = 12, B = 44;
  const span = (...lists) => {
    let low = Infinity, high = -Infinity;
    for (const list of lists) for (const x of list) { low = Math.min(low, x); high = Math.max(high, x); }
    const room = 0.05 * Math.max(high - low, 1e-9);
    return [low - room, high + room];
  };
  const ticks = ([low, high]) => {
    const power = 10 ** Math.floor(Math.log10((high - low) / 5));
    const step = [1, 2, 5, 10].map((d) => d * power).find((s) => (high - low) / s <= 5);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k <= high / step + 1e-9; k++) found.push(Number((k * step).toPrecision(8)));
    return found;
  };
  const axes = (parent, x, y, xLabel, yLabel) => {
    const px = (v) => L + (W - L - R) * (v - x[0]) / (x[1] - x[0]), py = (v) => H - B - (H - T - B) * (v - y[0]) / (y[1] - y[0]);
    for (const v of ticks(x)) {
      svg(parent, "line", { class: "grid", x1: px(v), x2: px(v), y1: T, y2: H - B });
      svg(parent, "text", { class: "tick", x: px(v), y: H - B + 17, "text-anchor": "middle" }, String(v));
    }
    for (const v of ticks(y)) {
      svg(parent, "line", { class: "grid", x1: L, x2: W - R, y1: py(v), y2: py(v) });
      svg(parent, "text", { class: "tick", x: L - 6, y: py(v) + 5, "text-anchor": "end" }, String(v));
    }
    svg(parent, "text", { class: "label", x: (L + W - R) / 2, y: H - 6, "text-anchor": "middle" }, xLabel);
    svg(parent, "text", { class: "label", transform: "rotate(-90)", x: -(T + H - B) / 2, y: 16, "text-anchor": "middle" }, yLabel);
    return { px, py, line: (a, b) => a.map((v, k) => `${px(v).toFixed(1)},${py(b[k]).toFixed(1)}`).join(" ") };
  };
  const chart = (title, x, y, xLabel, yLabel) => {
    const figure = html($("charts"), "figure");
    html(figure, "figcaption", {}, title);
    const area = svg(figure, "svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": title });
    return { area, ...axes(area, x, y, xLabel, yLabel) };
  };
  const hops = () => [state.picture, state.beside && state.beside.picture].filter((p) => p);
  const pictures = () => {
    const all = hops(), key = JSON.stringify(all);
    if (!all.length || drawn && drawn.key === key) return;
    const [p] = all, of = (pick) => all.map(pick), class_ = (k) => (k ? " beside" : "");
    drawn = { key, dots: [], cursors: [], bones: [] };
    // the leg
    $("leg").replaceChildren();
    const flat = all.flatMap((q) => q.chain.flat());
    const zs = flat.filter((_, k) => k % 2), xs = flat.filter((_, k) => k % 2 === 0);
    const top = 1.08 * Math.max(...zs), wide = top * 1.13 * (W - L - R) / (H - T - B), middle = (Math.min(...xs) + Math.max(...xs)) / 2;
    const a = axes($("leg"), [middle - wide / 2, middle + wide / 2], [-0.05 * top, top], "along [m]", "height [m]");
    svg($("leg"), "line", { class: "ground", x1: L, x2: W - R, y1: a.py(0), y2: a.py(0) });
    for (let k = all.length - 1; k >= 0; k--) {
      const bars = all[k].bars[0].flatMap((_, i) => (i % 6 ? [] : [svg($("leg"), "polyline", { class: "bar" + class_(k) })]));
      drawn.bones.push({ hop: all[k], a, bars, line: svg($("leg"), "polyline", { class: "bones" + class_(k) }), body: svg($("leg"), "circle", { class: "body" + class_(k), r: k ? 8 : 11 }) });
    }
    // charts
    $("charts").replaceChildren();
    p.joints.forEach((joint, j) => {
      const [speeds, torques] = p.regions[j];
      const c = chart(`Operating points, ${joint}`, span(speeds, ...of((q) => q.v[j] || [])), span(torques, ...of((q) => q.tau[j] || [])), "speed [rad/s]", "torque [N m]");
      svg(c.area, "polygon", { class: "region", points: c.line(speeds, torques) });
      all.forEach((q, k) => q.v[j] && svg(c.area, "polyline", { class: "curve" + class_(k), points: c.line(q.v[j], q.tau[j]) }));
      drawn.dots.push({ at: (k) => [c.px(p.v[j][k]), c.py(p.tau[j][k])], dot: svg(c.area, "circle", { class: "dot", r: 7 }) });
    });
    const overTime = (title, label, pick) => {
      const values = of(pick);
      if (values.some((v) => !v)) return;
      const c = chart(title, [0, Math.max(...all.map((q) => q.t[q.t.length - 1]))], span(...values), "time [s]", label);
      all.forEach((q, k) => svg(c.area, "polyline", { class: "curve" + class_(k), points: c.line(q.t, values[k]) }));
      drawn.cursors.push({ c, line: svg(c.area, "line", { class: "cursor", y1: T, y2: H - B }) });
    };
    overTime("Height of the lowest point", "height [m]", (q) => q.lowest);
    overTime("Ground force", "force [N]", (q) => q.force);
    overTime("Bus voltage", "of that without load", (q) => q.voltage);
    $("legend").replaceChildren();
    if (all.length > 1) {
      for (const [name, text] of [["mark", "the design that is shown"], ["mark beside", `design ${state.beside.id} of the list`]]) {
        const row = html($("legend"), "li");
        html(row, "span", { className: name });
        row.append(text);
      }
    }
    const end = Math.max(...all.map((q) => q.t[q.t.length - 1]));
    $("scrub").max = end;
    t = Math.min(t, end);
    move();
  };
  const at = (hop, when) => {  // index before, and share of the way to the next
    let k = hop.t.findIndex((v) => v >= when);
    k = k < 0 ? hop.t.length - 1 : Math.max(1, k);
    return [k, Math.min(1, Math.max(0, (when - hop.t[k - 1]) / (hop.t[k] - hop.t[k - 1] || 1)))];
  };
  const move = () => {
    if (!drawn) return;
    for (const { hop, a, bars, line, body } of drawn.bones) {
      const [k, share] = at(hop, t), now = (rows) => rows[k].map((v, i) => (1 - share) * rows[k - 1][i] + share * v);
      const places = (values) => values.flatMap((v, i) => (i % 2 ? [] : [`${a.px(v).toFixed(1)},${a.py(values[i + 1]).toFixed(1)}`]));
      const pose = now(hop.chain), beside = places(now(hop.bars));
      line.setAttribute("points", places(pose).join(" "));
      bars.forEach((bar, i) => bar.setAttribute("points", beside.slice(3 * i, 3 * i + 3).join(" ")));
      body.setAttribute("cx", a.px(pose[0]));
      body.setAttribute("cy", a.py(pose[1]));
    }
    const [k] = at(state.picture, t);
    for (const { at: place, dot } of drawn.dots) { const [x, y] = place(k); dot.setAttribute("cx", x); dot.setAttribute("cy", y); }
    for (const { c, line } of drawn.cursors) { line.setAttribute("x1", c.px(t)); line.setAttribute("x2", c.px(t)); }
    $("scrub").value = t;
    $("clock").textContent = `${t.toFixed(3)} s`;
  };
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const step = (clock) => {
    if (before === null) return;
    const end = Number($("scrub").max);
    t += 0.25 * (clock - before) / 1000;
    if (t > end + 0.1) t = 0;
    before = clock;
    move();
    requestAnimationFrame(step);
  };
  const play = (on) => {
    before = on ? performance.now() : null;
    $("play").textContent = on ? "Pause" : "Play";
    $("play").setAttribute("aria-pressed", String(on));
    if (on) requestAnimationFrame(step);
  };

  // ---- list and map -------------------------------------------------------------------------------------------
  const designs = () => {
    const entries = state.sliders.map((s) => s.entry).filter((e) => state.designs.some((d) => d.values[e] !== state.designs[0].values[e]));
    const parts = Object.keys(state.parts).filter((p) => state.designs.some((d) => d.choices[p]));
    const key = JSON.stringify([state.designs, state.current, state.beside && state.beside.id, entries]);
    if ($("designs").dataset.key === key) return;
    $("designs").dataset.key = key;
    const voltage = state.designs.some((d) => d.figures.lowest_voltage !== null);
    const head = ["", state.objective.replaceAll("_", " ") + (state.unit === "1" ? "" : ` [${state.unit}]`), "", ...parts, ...entries, "mass [kg]", "peak power [W]", ...(voltage ? ["lowest voltage"] : []), "limited by", "beside", ""];
    $("head").replaceChildren();
    for (const name of head) html($("head"), name ? "th" : "td", name ? { scope: "col" } : {}, name);
    $("designs").replaceChildren();
    for (const d of state.designs) {
      const row = html($("designs"), "tr", { className: d.id === state.current ? "now" : "" });
      html(row, "th", { scope: "row" }, String(d.id));
      html(row, "td", {}, d.value === null ? "" : d.value.toFixed(4));
      html(row, "td", {}, d.word);
      for (const p of parts) html(row, "td", {}, d.choices[p] || "as in the problem");
      for (const e of entries) html(row, "td", {}, shown(d.values[e]));
      html(row, "td", {}, shown(d.figures.mass_kg));
      html(row, "td", {}, d.figures.peak_power_W.toFixed(0));
      if (voltage) html(row, "td", {}, shown(d.figures.lowest_voltage));
      html(row, "td", {}, d.limits.length ? d.limits[0].entry : "");
      const box = html(html(row, "td"), "input", { type: "checkbox", ariaLabel: `show design ${d.id} beside`, checked: Boolean(state.beside && state.beside.id === d.id) });
      box.addEventListener("change", () => ask("beside", box.checked ? d.id : null));
      const back = html(html(row, "td"), "button", { type: "button", ariaLabel: `back to design ${d.id}` }, "Back to it");
      back.addEventListener("click", () => ask("back", d.id));
    }
  };
  const color = (share) => `hsl(${240 - 180 * share} 65% ${35 + 35 * share}%)`;
  const map = () => {
    const place = $("map"), m = state.map, key = JSON.stringify([m, m && state.values]);
    if (place.dataset.key === key) return;
    place.dataset.key = key;
    place.replaceChildren();
    if (!m) return;
    html(place, "p", { className: "hint" }, `preliminary, of the first mesh alone: ${m.of - m.left} of ${m.of}`);
    const known = m.cells.filter((c) => c.value !== null), figure = html(place, "figure");
    const values = known.map((c) => c.value);
    const area = svg(figure, "svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": `${state.objective} over ${m.entries.join(" and ")}` });
    if (!known.length) return;
    const ends = (axis, room) => [axis[0] - room, axis[axis.length - 1] + room];
    if (m.entries.length === 1) {
      const [x] = m.axes, sorted = known.slice().sort((p, q) => p.at[0] - q.at[0]);
      const a = axes(area, ends(x, 0), span(values), m.entries[0], state.objective);
      svg(area, "polyline", { class: "curve", points: a.line(sorted.map((c) => x[c.at[0]]), sorted.map((c) => c.value)) });
      for (const c of sorted) svg(area, "circle", { class: "dot", r: 4, cx: a.px(x[c.at[0]]), cy: a.py(c.value) });
      const here = a.px(state.values[m.entries[0]]);
      svg(area, "line", { class: "cursor", x1: here, x2: here, y1: T, y2: H - B });
    } else {
      const [x, y] = m.axes, dx = (x[1] - x[0]) / 2, dy = (y[1] - y[0]) / 2;
      const a = axes(area, ends(x, dx), ends(y, dy), m.entries[0], m.entries[1]);
      const low = Math.min(...values), high = Math.max(...values);
      for (const c of known) {
        const [i, j] = c.at, share = (c.value - low) / Math.max(high - low, 1e-12);
        const cell = svg(area, "rect", { class: "cell", fill: color(share), x: a.px(x[i] - dx), width: a.px(x[i] + dx) - a.px(x[i] - dx), y: a.py(y[j] + dy), height: a.py(y[j] - dy) - a.py(y[j] + dy) });
        svg(cell, "title", {}, `${c.value.toFixed(4)} at ${m.entries[0]} ${shown(x[i])}, ${m.entries[1]} ${shown(y[j])}`);
      }
      svg(area, "circle", { class: "here", r: 8, cx: a.px(state.values[m.entries[0]]), cy: a.py(state.values[m.entries[1]]) });
      html(place, "p", { className: "hint" }, `from ${low.toFixed(3)} (dark) to ${high.toFixed(3)} (light)${state.unit === "1" ? "" : ` ${state.unit}`}; the ring is the design that is shown`);
    }
  };

  // ---- begin --------------------------------------------------------------------------------------------------
  const take = (message) => {
    if (message.refused) {
      asked = {};
      if (state) take(state);
      $("said").textContent = message.refused;
      return;
    }
    if (!("problem" in message)) { $("busy").textContent = message.busy; return; }
    state = message;
    for (const [entry, value] of Object.entries(asked)) if (state.values[entry] === value) delete asked[entry];
    words();
    aged();
    if (state.sliders.length) { sliders(); designs(); map(); }
    pictures();
  };
  const connect = () => {
    live = new WebSocket(new URL("live", location.href).href.replace(/^http/, "ws"));
    live.onmessage = (event) => take(JSON.parse(event.data));
    live.onclose = () => { $("busy").textContent = "hopopt explore has ended: start it again at the command line"; document.body.classList.add("ended"); };
  };
  $("play").addEventListener("click", () => play(before === null));
  $("scrub").addEventListener("input", () => { play(false); t = Number($("scrub").value); move(); });
  $("undo").addEventListener("click", () => { asked = {}; ask("undo"); });
  $("fill").addEventListener("click", () => ask("map", [$("first").value, $("second").value].filter((e, k, all) => e && all.indexOf(e) === k)));
  for (const button of document.querySelectorAll("[data-ask]")) button.addEventListener("click", () => ask(button.dataset.ask));
  $("sliders").addEventListener("submit", (event) => event.preventDefault());
  connect();
  if (!still) play(true);
})();
