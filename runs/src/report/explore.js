const { passes, traces: cycles, events, limits } = JSON.parse(document.getElementById("run-data").textContent);
const root = document.getElementById("explore");
const MU = "\u03bc'";

function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

function save(name, type, text) {
  const link = el("a", { href: URL.createObjectURL(new Blob([text], { type })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

const csv = (rows) => (rows.length ? [Object.keys(rows[0]), ...rows.map(Object.values)].map((r) => r.map((v) => v ?? "").join(",")).join("\n") + "\n" : "");
const button = (text, click, more = {}) => el("button", { type: "button", onclick: click, ...more }, text);
const number = (v, digits) => (v == null ? "none" : v.toFixed(digits));
const words = (p) => `pass ${p.point}: w ${p.w_um.toFixed(2)} \u00b5m pp, ${p.f_khz.toFixed(1)} kHz, ${(p.u_mm_s * p.direction).toFixed(1)} mm/s, ${p.normal_n.toFixed(2)} N; ${MU} ${number(p.mu, 3)} \u00b1 ${number(p.mu_sd, 3)}, predicted ${number(p.predicted, 3)} \u00b1 ${number(p.predicted_sd, 3)}, surprise ${number(p.surprise, 1)} sd`;

// A figure with a legend that shows and hides its series, words under the pointer, and its numbers as a file.
function clickable(title, xTitle, yTitle, fromZero, series, file) {
  const box = figure(root, title);
  const keys = el("p", { class: "legend" });
  box.plot.before(keys);
  const chart = marks(box.plot, xTitle, yTitle, fromZero);
  const hidden = new Set();
  const tip = el("div", { class: "tip", hidden: "" });
  box.plot.append(tip);
  const shown = () => series.filter((one) => !hidden.has(one.label)).flatMap((one) => one.points);
  const draw = () => chart.set(shown());
  for (const one of series) {
    keys.append(button(`${one.sign} ${one.label}`, (event) => {
      if (!hidden.delete(one.label)) hidden.add(one.label);
      event.target.setAttribute("aria-pressed", String(!hidden.has(one.label)));
      draw();
    }, { "aria-pressed": "true", style: `color: var(${one.style.colour})` }));
  }
  keys.append(button("CSV", () => save(`${file}.csv`, "text/csv", csv(shown().map((p) => p.pass)))));
  const nearest = (event) => {
    const { left, top } = chart.plot.over.getBoundingClientRect();
    const far = (p) => Math.hypot(chart.plot.valToPos(p.x, "x") - event.clientX + left, chart.plot.valToPos(p.y, "y") - event.clientY + top);
    const best = shown().reduce((b, p) => (b && far(b) <= far(p) ? b : p), null);
    return best && far(best) < 25 ? best : null;
  };
  chart.plot.over.addEventListener("mousemove", (event) => {
    const p = nearest(event);
    tip.hidden = !p;
    if (p) tip.textContent = words(p.pass);
    chart.plot.over.style.cursor = p ? "pointer" : "";
  });
  chart.plot.over.addEventListener("mouseleave", () => { tip.hidden = true; });
  chart.plot.over.addEventListener("click", (event) => {
    const p = nearest(event);
    if (p) choose(p.pass.point);
  });
  draw();
  return box;
}

const SIGNS = ["\u25cf", "\u25a0", "\u25b2", "\u25c6", "\u25cb", "\u25a1", "\u25b3", "\u25c7", "\u2715"];
function bySpeed(x, chosen) {
  const speeds = levels(chosen.map((p) => p.u_mm_s), WITHIN.speed);
  return SERIES.slice(0, speeds.names.length).map((style, i) => {
    const of = i + 1 === SERIES.length ? speeds.names.slice(i) : [speeds.names[i]];
    const series = (p) => Math.min(speeds.index(p.u_mm_s), SERIES.length - 1);
    const points = chosen.filter((p) => series(p) === i).map((p) => ({ x: x(p), y: p.mu, sd: p.mu_sd, predicted: p.predicted, predicted_sd: p.predicted_sd, ...style, pass: p }));
    return { label: `${of.join(", ")} mm/s`, sign: SIGNS[i], style, points };
  });
}

root.append(el("h2", {}, "Look closer"), el("p", { class: "note" }, "Point at a mark for its pass, click it for its forces. The buttons show and hide speeds. Strokes: predicted, with twice its standard uncertainty."));
const driven = passes.filter((p) => p.w_um > 0 && p.mu != null);
const known = driven.filter((p) => p.psi != null);
if (driven.length) clickable(`Relative friction against amplitude, all ${driven.length} passes`, "amplitude w, \u00b5m peak to peak", `relative friction ${MU}`, true, bySpeed((p) => p.w_um, driven), "mu-against-amplitude");
if (known.length) clickable("Relative friction against \u03a8", "\u03a8 (Eq. 17)", `relative friction ${MU}`, true, bySpeed((p) => p.psi, known), "mu-against-psi");
const still = passes.filter((p) => p.mu0 != null);
if (still.length) clickable("Friction without vibration over the run", "loop time, s", "\u03bc\u2080", false, [{ label: "references", sign: SIGNS[0], style: SERIES[0], points: still.map((p) => ({ x: p.time_s, y: p.mu0, ...SERIES[0], pass: p })) }], "mu0-drift");

// Forces and mu' of a pass, or of all passes one after the other.
const force = figure(root, "Forces");
const ratio = figure(root, "Relative friction in time");
const band = [{ colour: "--a", band: true }, { colour: "--b", band: true, dash: [8, 4] }];
const charts = cycles.length ? { force: timed(force.plot, "force, N", band), ratio: timed(ratio.plot, `relative friction ${MU}`, band.slice(0, 1)) } : null;
const select = el("select", { id: "pass", onchange: () => show(select.value) }, el("option", { value: "" }, "all passes"), ...cycles.map((t) => el("option", { value: t.point }, `pass ${t.point}`)));
let now = [];
if (charts) force.plot.before(el("p", { class: "legend" }, el("label", { for: "pass" }, "Show "), select, button("CSV", () => save("forces.csv", "text/csv", csv(now)))));
else {
  for (const one of [force, ratio]) one.show(false);
  root.append(el("p", {}, "The record holds no cycle of a pass."));
}

// The chart of a kind of the dashboard, with what happened as lines.
function timed(plot, title, series) {
  const chart = traces(plot, title, series);
  const lines = { at: [], level: [] };
  chart.hooks.draw = [(u) => {
    const { ctx, bbox } = u;
    const grey = getComputedStyle(document.documentElement).getPropertyValue("--grey").trim();
    const warn = getComputedStyle(document.documentElement).getPropertyValue("--bad").trim();
    ctx.save();
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash([]);
    const line = (colour, x0, y0, x1, y1) => { ctx.strokeStyle = colour; ctx.beginPath(); ctx.moveTo(x0, y0); ctx.lineTo(x1, y1); ctx.stroke(); };
    for (const at of lines.at) {
      const x = u.valToPos(at, "x", true);
      if (x >= bbox.left && x <= bbox.left + bbox.width) line(grey, x, bbox.top, x, bbox.top + bbox.height);
    }
    for (const level of lines.level) {
      const y = u.valToPos(level, "y", true);
      if (y >= bbox.top && y <= bbox.top + bbox.height) line(warn, bbox.left, y, bbox.left + bbox.width, y);
    }
    ctx.restore();
  }];
  return { chart, lines };
}

function show(point) {
  const chosen = point === "" ? cycles : cycles.filter((t) => String(t.point) === String(point));
  const column = (of, scale) => chosen.flatMap((t) => [...of(t).map((v) => (v == null ? null : v / scale)), null]);
  const time = chosen.flatMap((t) => [...t.t_ms.map((ms) => ms / 1e3), (t.t_ms.at(-1) + 1) / 1e3]);
  const pair = (name, scale) => [1, 0].map((i) => column((t) => t[name][i], scale));
  const middle = ([high, low]) => high.map((v, i) => (v == null || low[i] == null ? null : (v + low[i]) / 2));
  const [lateral, normal, mu] = [pair("lateral", 1e4), pair("normal", 1e4), pair("mu", 1e3)];
  const inside = events.filter(([at]) => at >= time[0] && at <= time.at(-1));
  const from = chosen.length === 1 && chosen[0].measured_from_ms != null ? [chosen[0].measured_from_ms / 1e3] : [];
  for (const { chart, lines } of [charts.force, charts.ratio]) lines.at = [...inside.map(([at]) => at), ...from];
  charts.force.lines.level = limits ? [limits.lateral_n, -limits.lateral_n, limits.normal_n] : [];
  charts.force.chart.setData([time, ...lateral, middle(lateral), ...normal, middle(normal)]);
  charts.ratio.chart.setData([time, ...mu, middle(mu)]);
  now = time.map((t, i) => ({ time_s: t, lateral_low_n: lateral[1][i], lateral_high_n: lateral[0][i], normal_low_n: normal[1][i], normal_high_n: normal[0][i], mu_relative_low: mu[1][i], mu_relative_high: mu[0][i] })).filter((row) => row.lateral_low_n != null || row.normal_low_n != null);
  const pass = passes.find((p) => String(p.point) === String(point));
  const what = pass ? words(pass) : `all ${chosen.length} passes`;
  const happened = inside.map(([at, told]) => `${at.toFixed(1)} s ${told.split("\n")[0]}`).join("; ");
  const bounds = limits ? ` Limits: ${limits.lateral_n} N lateral, ${limits.normal_n} N normal${point === "" ? "" : ", where they are within the axis"}.` : "";
  force.say(`${what}. Solid: lateral; dashed: normal; bands from the least to the greatest cycle.${bounds}${from.length ? " Upright line: from here on the pass is averaged." : ""}${happened ? ` Events: ${happened}.` : ""}`);
  ratio.say(`${what}. Missing where no running ${MU} was known.`);
  select.value = point;
}

function choose(point) {
  show(point);
  select.scrollIntoView({ block: "center" });
  select.focus();
}
if (charts) show("");

// Every figure below as a file of its own.
for (const svg of document.querySelectorAll("figure div.wide svg")) {
  const place = svg.closest("figure");
  const name = `${(svg.getAttribute("aria-label") ?? "figure").slice(0, 40).replace(/[^A-Za-z0-9]+/g, "-")}.svg`;
  place.append(el("p", { class: "legend" }, button("SVG", () => {
    const copy = svg.cloneNode(true);
    copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
    save(name, "image/svg+xml", new XMLSerializer().serializeToString(copy));
  })));
}
root.hidden = false;
