"use strict";
(() => {
  const hops = JSON.parse(document.getElementById("hops").textContent);
  const play = document.getElementById("play"), scrub = document.getElementById("scrub");
  const now = document.getElementById("now"), speed = document.getElementById("speed");
  const end = Number(scrub.max), FORCE = 0.0006; // metres of arrow for a newton
  let t = 0, before = null;

  // row of an array at time t, linear between instants
  const at = (hop, rows) => {
    let low = 0, high = hop.t.length - 1;
    if (t >= hop.t[high]) return rows[high];
    while (high - low > 1) { const middle = (low + high) >> 1; if (hop.t[middle] <= t) low = middle; else high = middle; }
    const part = (t - hop.t[low]) / (hop.t[high] - hop.t[low]);
    return rows[low].map((x, k) => x + part * (rows[high][k] - x));
  };
  const mapping = (svg) => {
    const d = svg.dataset, n = (name) => Number(d[name]);
    return [(x) => n("x0") + n("xs") * x, (y) => n("y0") + n("ys") * y];
  };
  const set = (element, values) => { for (const name in values) element.setAttribute(name, values[name]); };

  const draw = () => {
    for (const svg of document.querySelectorAll("svg.scene")) {
      const hop = hops[svg.dataset.hop], [px, py] = mapping(svg);
      const places = (values) => {
        const found = [];
        for (let k = 0; k < values.length; k += 2) found.push([px(values[k]), py(values[k + 1])]);
        return found;
      };
      const points = places(at(hop, hop.chain)), bars = places(at(hop, hop.bars));
      svg.querySelectorAll(".bar").forEach((bar, k) => bar.setAttribute("points", bars.slice(3 * k, 3 * k + 3).join(" ")));
      svg.querySelector(".leg").setAttribute("points", points.map((p) => p.join(",")).join(" "));
      set(svg.querySelector(".body"), { cx: points[0][0], cy: points[0][1] });
      const foot = points[points.length - 1], f = at(hop, hop.force).map((x) => x * FORCE);
      set(svg.querySelector(".force"), {
        x1: foot[0], y1: foot[1], x2: foot[0] + px(f[0]) - px(0), y2: foot[1] + py(f[1]) - py(0),
      });
    }
    for (const dot of document.querySelectorAll("circle.dot")) {
      const hop = hops[dot.dataset.hop], joint = dot.dataset.joint, [px, py] = mapping(dot.ownerSVGElement);
      set(dot, { cx: px(at(hop, hop.v)[joint]), cy: py(at(hop, hop.tau)[joint]) });
    }
    for (const svg of document.querySelectorAll("svg.timed")) {
      const x = mapping(svg)[0](t);
      set(svg.querySelector(".cursor"), { x1: x, x2: x });
    }
    scrub.value = t;
    now.textContent = t.toFixed(3) + " s";
  };
  const step = (clock) => {
    if (before === null) return;
    t = Math.min(end, t + Number(speed.value) * (clock - before) / 1000);
    before = clock;
    draw();
    if (t < end) requestAnimationFrame(step); else pause();
  };
  const pause = () => { before = null; play.textContent = "Play"; play.setAttribute("aria-pressed", "false"); };
  const start = () => {
    if (t >= end) t = 0;
    before = performance.now();
    play.textContent = "Pause";
    play.setAttribute("aria-pressed", "true");
    requestAnimationFrame(step);
  };
  play.addEventListener("click", () => (before === null ? start() : pause()));
  scrub.addEventListener("input", () => { pause(); t = Number(scrub.value); draw(); });
  document.addEventListener("keydown", (event) => {
    if (event.target !== document.body) return;
    if (event.key === " ") { event.preventDefault(); play.click(); }
    const move = { ArrowRight: 0.01, ArrowLeft: -0.01 }[event.key];
    if (move) { event.preventDefault(); pause(); t = Math.max(0, Math.min(end, t + move)); draw(); }
  });
  draw();
})();
