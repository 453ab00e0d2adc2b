import { button, el, figure, levels, marks, save, savePng, SERIES, tools, traces, WITHIN } from "/plots.js";

const MU = "\u03bc'";
const csv = (rows) => (rows.length ? [Object.keys(rows[0]), ...rows.map(Object.values)].map((r) => r.map((v) => v ?? "").join(",")).join("\n") + "\n" : "");
const saveCsv = (name, rows) => save(`${name}.csv`, new Blob([csv(rows)], { type: "text/csv" }));
const number = (v, digits) => (v == null ? "none" : v.toFixed(digits));
const words = (p) => `pass ${p.point}: w ${p.w_um.toFixed(2)} \u00b5m pp, ${p.f_khz.toFixed(1)} kHz, ${(p.u_mm_s * p.direction).toFixed(1)} mm/s, ${p.normal_n.toFixed(2)} N; ${MU} ${number(p.mu, 3)} \u00b1 ${number(p.mu_sd, 3)}, predicted ${number(p.predicted, 3)} \u00b1 ${number(p.predicted_sd, 3)}, surprise ${number(p.surprise, 1)} sd`;
const SIGNS = ["\u25cf", "\u25a0", "\u25b2", "\u25c6", "\u25cb", "\u25a1", "\u25b3", "\u25c7", "\u2715"];

// What a plan varies besides the amplitude: name, unit, value, and how far the values of one setting lie apart.
export const FACTORS = [
  { name: "speed", unit: "mm/s", of: (p) => p.u_mm_s, within: WITHIN.speed },
  { name: "frequency", unit: "kHz", of: (p) => p.f_khz, within: WITHIN.frequency },
  { name: "normal force", unit: "N", of: (p) => p.normal_n, within: WITHIN.force },
];
export const settings = (factor, passes) => levels(passes.map(factor.of), factor.within).names.length;

function seriesOf(x, factor, chosen) {
  const all = levels(chosen.map(factor.of), factor.within);
  return SERIES.slice(0, all.names.length).map((style, i) => {
    const names = i + 1 === SERIES.length ? all.names.slice(i) : [all.names[i]];
    const mine = chosen.filter((p) => Math.min(all.index(factor.of(p)), SERIES.length - 1) === i);
    const points = mine.map((p) => ({ x: x(p), y: p.mu, sd: p.mu_sd, predicted: p.predicted, predicted_sd: p.predicted_sd, ...style, pass: p }));
    return { label: `${names.join(", ")} ${factor.unit}`, sign: SIGNS[i], style, points };
  });
}

// A figure with a legend that shows and hides its series, words under the pointer, and its numbers as a file.
export function clickable(root, { title, x, y, log, zero, file, by, describe, rows, choose, note }) {
  const box = figure(root, title);
  const keys = el("p", { class: "legend" });
  const chosen = by && el("select", { "aria-label": `series of ${title}`, onchange: () => set(passes) }, ...FACTORS.map((f, i) => el("option", { value: i }, `by ${f.name}`)));
  const tip = el("div", { class: "tip", hidden: true });
  const off = new Set();
  let passes = [];
  let series = [];
  const inSight = () => series.filter((one) => !off.has(one.label)).flatMap((one) => one.points);
  const nearest = (u, event) => {
    const { left, top } = u.over.getBoundingClientRect();
    const far = (p) => Math.hypot(u.valToPos(p.x, "x") - event.clientX + left, u.valToPos(p.y, "y") - event.clientY + top);
    const best = inSight().reduce((b, p) => (b && far(b) <= far(p) ? b : p), null);
    return best && far(best) < 25 ? best : null;
  };
  const chart = marks(box.plot, x, y, zero, (u) => {
    u.over.addEventListener("mousemove", (event) => {
      const p = nearest(u, event);
      tip.hidden = !p;
      if (p) tip.textContent = describe(p.pass);
      u.over.style.cursor = p && choose ? "pointer" : "";
    });
    u.over.addEventListener("mouseleave", () => { tip.hidden = true; });
    u.over.addEventListener("click", (event) => { const p = nearest(u, event); if (p) choose?.(p.pass.point); });
  });
  box.plot.before(keys);
  box.plot.append(tip);
  const more = [...tools(chart.own, file, log), button("CSV", () => saveCsv(file, inSight().map((p) => (rows ? rows(p.pass) : p.pass))))];
  function legend() {
    keys.replaceChildren(...(chosen ? [chosen] : []), ...series.map((one) => button(`${one.sign} ${one.label}`, (event) => {
      if (!off.delete(one.label)) off.add(one.label);
      event.target.setAttribute("aria-pressed", String(!off.has(one.label)));
      chart.set(inSight());
    }, { "aria-pressed": String(!off.has(one.label)), style: `color: var(${one.style.colour})` })), ...more);
  }
  function set(all) {
    passes = all;
    const before = series.map((one) => one.label).join();
    series = by ? by(all, FACTORS[chosen.value || 0]) : all;
    if (before !== series.map((one) => one.label).join()) legend();
    chart.set(inSight());
    box.show(series.length > 0);
    box.say(note?.(all, series) ?? "");
  }
  legend();
  return { set, box };
}

// The figures of passes; `choose` gets the number of one that was clicked. What comes back takes more passes.
export function passFigures(root, choose) {
  const key = (all, series) => `${all.length} passes; ${series.map((one) => `${one.style.name}: ${one.label}`).join("; ")}. Strokes: predicted, with twice its standard uncertainty.`;
  const common = { y: `relative friction ${MU}`, zero: true, describe: words, choose, note: key };
  const w = clickable(root, { ...common, title: "Relative friction against amplitude", x: "amplitude w, \u00b5m peak to peak", log: [["x", "w"], ["y", MU]], file: "mu-against-amplitude", by: (all, factor) => seriesOf((p) => p.w_um, factor, all) });
  const psi = clickable(root, { ...common, title: "Relative friction against \u03a8", x: "\u03a8 (Eq. 17)", log: [["x", "\u03a8"], ["y", MU]], file: "mu-against-psi", by: (all, factor) => seriesOf((p) => p.psi, factor, all) });
  const drift = clickable(root, { title: "Friction without vibration over the run", x: "loop time, s", y: "\u03bc\u2080", log: [], zero: false, file: "mu0-drift", describe: words, choose });
  return (passes) => {
    const driven = passes.filter((p) => p.w_um > 0 && p.mu != null);
    w.set(driven);
    psi.set(driven.filter((p) => p.psi != null));
    const still = passes.filter((p) => p.mu0 != null);
    drift.set(still.length ? [{ label: "references", sign: SIGNS[0], style: SERIES[0], points: still.map((p) => ({ x: p.time_s, y: p.mu0, ...SERIES[0], pass: p })) }] : []);
  };
}

// Lines over a chart of time: what happened, and limits.
function lined(plot, title, series) {
  const lines = { at: [], level: [] };
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const draw = (u) => {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash([]);
    const line = (colour, x0, y0, x1, y1) => { ctx.strokeStyle = css(colour); ctx.beginPath(); ctx.moveTo(x0, y0); ctx.lineTo(x1, y1); ctx.stroke(); };
    for (const at of lines.at) {
      const x = u.valToPos(at, "x", true);
      if (x >= bbox.left && x <= bbox.left + bbox.width) line("--grey", x, bbox.top, x, bbox.top + bbox.height);
    }
    for (const level of lines.level) {
      const y = u.valToPos(level, "y", true);
      if (y >= bbox.top && y <= bbox.top + bbox.height) line("--bad", bbox.left, y, bbox.left + bbox.width, y);
    }
    ctx.restore();
  };
  return { own: traces(plot, title, series, null, null, draw), lines };
}

// Whole numbers from their text: see traces.rs.
const DIGITS = new Uint8Array(128);
[..."ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"].forEach((c, i) => { DIGITS[c.charCodeAt(0)] = i; });
function unpack(text) {
  const all = [];
  let before = 0;
  let left = 0;
  let scale = 1;
  for (let i = 0; i < text.length; i += 1) {
    const digit = DIGITS[text.charCodeAt(i)];
    left += (digit % 32) * scale;
    scale *= 32;
    if (digit >= 32) continue;
    if (left) before += left % 2 ? (left - 1) / 2 : -left / 2;
    all.push(left ? before : null);
    left = 0;
    scale = 1;
  }
  return all;
}
// The cycles of a pass, read when they are first shown.
const opened = (t) => (t.opened ??= { t_s: unpack(t.t).map((v) => v / 1e4), position: unpack(t.position), late: unpack(t.late), lateral: t.lateral.map(unpack), normal: t.normal.map(unpack), mu: t.mu.map(unpack) });

// Forces, mu', the loop of friction over the plate and how late the cycles were: of one pass, or of all one after the other. `finer` gets
// the recorded cycles of a window, where they are at hand.
function cycleFigures(root, { passes, traces: cycles, events, limits }, finer) {
  const force = figure(root, "Forces");
  const ratio = figure(root, "Relative friction in time");
  const loop = figure(root, "Friction loop");
  const late = figure(root, "Lateness of the loop");
  const band = [{ colour: "--a", band: true }, { colour: "--b", band: true, dash: [8, 4] }];
  const charts = { force: lined(force.plot, "force, N", band), ratio: lined(ratio.plot, `relative friction ${MU}`, band.slice(0, 1)), late: lined(late.plot, "latest cycle, ms", [{ colour: "--a" }]) };
  const loops = marks(loop.plot, "position of the plate, mm", "lateral force, N", false);
  const select = el("select", { id: "pass", onchange: () => show(select.value) }, el("option", { value: "" }, "all passes"), ...cycles.map((t) => el("option", { value: t.point }, `pass ${t.point}`)));
  const times = Object.values(charts).map(({ own }) => own);
  let now = () => [];
  force.plot.before(el("p", { class: "legend" }, el("label", { for: "pass" }, "Show "), select, button("CSV", () => saveCsv("forces", now())), ...tools(charts.force.own, "forces", [])));
  ratio.plot.before(el("p", { class: "legend" }, ...tools(charts.ratio.own, "mu-in-time", [])));
  loop.plot.before(el("p", { class: "legend" }, ...tools(loops.own, "friction-loop", [])));
  late.plot.before(el("p", { class: "legend" }, ...tools(charts.late.own, "lateness", [["y", "ms"]])));

  // `all` are the cycles of the page, or finer ones of a window, each point of which is of so many.
  function draw(point, all, stretch) {
    const chosen = point === "" ? all : all.filter((t) => String(t.point) === String(point));
    if (!chosen.length) return;
    const column = (of, scale) => chosen.flatMap((t) => [...of(opened(t)).map((v) => (v == null ? null : v / scale)), null]);
    const time = chosen.flatMap((t) => [...opened(t).t_s, opened(t).t_s.at(-1) + 1e-4]);
    const pair = (name, scale) => [1, 0].map((i) => column((t) => t[name][i], scale));
    const middle = ([high, low]) => high.map((v, i) => (v == null || low[i] == null ? null : (v + low[i]) / 2));
    const [lateral, normal, mu] = [pair("lateral", 1e4), pair("normal", 1e4), pair("mu", 1e3)];
    const [position, latest] = [column((t) => t.position, 1e3), column((t) => t.late, 1e3)];
    const inside = events.filter(([at]) => at >= time[0] && at <= time.at(-1));
    const from = chosen.length === 1 && chosen[0].measured_from_ms != null ? [chosen[0].measured_from_ms / 1e3] : [];
    for (const { lines } of Object.values(charts)) lines.at = [...inside.map(([at]) => at), ...from];
    charts.force.lines.level = limits ? [limits.lateral_n, -limits.lateral_n, limits.normal_n] : [];
    if (!stretch) for (const own of times) own.ends = [time[0], time.at(-1)];
    const bands = [...lateral, middle(lateral), ...normal, middle(normal)];
    charts.force.own.put([time, ...bands], [1, -1, 0, 1, -1, 0]);
    charts.ratio.own.put([time, ...mu, middle(mu)], [1, -1, 0]);
    charts.late.own.put([time, latest], [1]);
    for (const { plot } of [force, ratio, late]) plot.dataset.points = time.length - chosen.length;
    late.show(latest.some((v) => v > 0));
    const across = bands[2];
    const forward = new Map(passes.map((p) => [String(p.point), p.direction]));
    const places = chosen.flatMap((t) => opened(t).t_s.map(() => SERIES[forward.get(String(t.point)) < 0 ? 5 : 0]).concat(null));
    const points = places.map((style, i) => style && position[i] != null && across[i] != null && { x: position[i], y: across[i], ...style, size: 1.5 }).filter(Boolean);
    loops.set(points);
    loop.show(points.length > 0);
    now = () => time.map((t, i) => ({ time_s: t, position_mm: position[i], lateral_low_n: lateral[1][i], lateral_high_n: lateral[0][i], normal_low_n: normal[1][i], normal_high_n: normal[0][i], mu_relative_low: mu[1][i], mu_relative_high: mu[0][i] })).filter((row) => row.lateral_low_n != null || row.normal_low_n != null);
    const pass = passes.find((p) => String(p.point) === String(point));
    const what = pass ? words(pass) : `All ${cycles.length} passes`;
    const happened = inside.map(([at, event]) => `${at.toFixed(1)} s ${event.split("\n")[0]}`).join("; ");
    const bounds = limits ? ` Limits: ${limits.lateral_n} N lateral, ${limits.normal_n} N normal${point === "" ? "" : ", where they are within the axis"}.` : "";
    const each = stretch === 1 ? "every recorded cycle" : stretch ? `bands from the least to the greatest of ${stretch} cycles` : "bands from the least to the greatest cycle, a hundred stretches a pass";
    force.say(`${what}. Solid: lateral; dashed: normal; ${each}.${bounds}${from.length ? " Upright line: from here on the pass is averaged." : ""}${happened ? ` Events: ${happened}.` : ""}`);
    ratio.say(`${what}. Missing where no running ${MU} was known.`);
    loop.say(`${what}. Discs: forward; hollow squares: backward; each the middle of some cycles.`);
    late.say(`${what}. How late the latest cycle of each stretch began.`);
    select.value = point;
  }

  // What is shown beside its like; where finer cycles are at hand, they come when the figure has come to rest.
  let [timer, fetched, asked] = [0, null, 0];
  const coarse = () => { if (fetched) draw(select.value, cycles); fetched = null; };
  async function rest(range) {
    const mine = ++asked;
    const half = (range[1] - range[0]) / 2;
    const window = [Math.max(range[0] - half, 0), range[1] + half];
    try {
      const { stretch, traces: found } = await finer(window);
      if (mine !== asked || !found.length) return;
      fetched = window;
      draw(select.value, found, stretch);
    } catch (why) {
      if (mine === asked) force.say(`The recorded cycles were not fetched: ${why.message}`);
    }
  }
  for (const own of times) own.moved = (range) => {
    clearTimeout(timer);
    asked += 1;
    if (!range || (fetched && (range[0] < fetched[0] || range[1] > fetched[1]))) coarse();
    timer = setTimeout(() => {
      for (const other of times) if (other !== own) other.see(range);
      if (range && finer) rest(range);
    }, 150);
  };
  function show(point) {
    clearTimeout(timer);
    asked += 1;
    fetched = null;
    draw(point, cycles);
    for (const own of times) own.see(null);
  }
  show("");
  return (point) => {
    show(point);
    select.scrollIntoView({ block: "center" });
    select.focus();
  };
}

// A picture of a figure that needs no script, as a file of its own.
function staticFiles(within) {
  for (const svg of within.querySelectorAll("figure div.wide svg")) {
    const name = (svg.getAttribute("aria-label") ?? "figure").slice(0, 40).replace(/[^A-Za-z0-9]+/g, "-");
    const text = () => {
      const copy = svg.cloneNode(true);
      copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
      return new XMLSerializer().serializeToString(copy);
    };
    const png = () => {
      const { width, height } = svg.viewBox.baseVal;
      const picture = new Image();
      picture.onload = () => savePng(name, picture, 2 * width, 2 * height);
      picture.src = `data:image/svg+xml,${encodeURIComponent(text())}`;
    };
    svg.closest("figure").append(el("p", { class: "legend" }, button("SVG", () => save(`${name}.svg`, new Blob([text()], { type: "image/svg+xml" }))), button("PNG", png)));
  }
}

// The part of a run's page that is worked with; `finer` as in cycleFigures.
export function explore(root, data, page, finer) {
  root.append(el("h2", {}, "Look closer"), el("p", { class: "note" }, "Point at a mark for its pass, click it for its forces. Drag to enlarge, with Shift to move, double-click for the whole; or +, \u2212, arrows and 0. The buttons show and hide series."));
  // The figures of cycles are far down: they are made when a reader comes near.
  const below = el("div", { class: "below" });
  let choose = null;
  const make = () => { choose ??= cycleFigures(below, data, finer); below.className = ""; return choose; };
  passFigures(root, (point) => data.traces.length && make()(point))(data.passes);
  root.append(data.traces.length ? below : el("p", {}, "The record holds no cycle of a pass."));
  staticFiles(page);
  root.hidden = false;
  const near = new IntersectionObserver((seen) => { if (seen.some((one) => one.isIntersecting)) { near.disconnect(); make(); } }, { rootMargin: "400px" });
  if (data.traces.length) near.observe(below);
}

// The figures of groups of runs: a series a group, with the same conditions.
export function exploreGroups(root, { groups, conditions }, page) {
  root.append(el("h2", {}, "Look closer"), el("p", { class: "note" }, "Point at a mark for its condition. Drag to enlarge, double-click for the whole. The buttons show and hide groups."));
  const at = (c) => `w ${(c.amplitude_pp_m * 1e6).toFixed(2)} \u00b5m pp, ${(c.frequency_hz / 1e3).toFixed(1)} kHz, ${(c.velocity_m_s * 1e3).toFixed(1)} mm/s, ${c.normal_force_n.toFixed(2)} N`;
  const rows = ({ group, condition: c, value, ...rest }) => ({ group: `"${group.replaceAll("\"", "\"\"")}"`, w_um: c.amplitude_pp_m * 1e6, f_khz: c.frequency_hz / 1e3, u_mm_s: c.velocity_m_s * 1e3, normal_n: c.normal_force_n, value, ...rest });
  const series = (from, of) => groups.slice(from).map((group, i) => {
    const style = SERIES[Math.min(i + from, SERIES.length - 1)];
    const points = conditions.map((c) => [c, of(c, i + from)]).filter(([, found]) => found).map(([c, found]) => ({ x: c.amplitude_pp_m * 1e6, y: found.value, sd: found.half, ...style, pass: { group: group.name, condition: c, ...found } }));
    return { label: group.name, sign: SIGNS[Math.min(i + from, SIGNS.length - 1)], style, points };
  });
  const x = "amplitude w, \u00b5m peak to peak";
  const mean = (c, g) => c.means[g] && { value: c.means[g].mu_relative, half: c.means[g].sd, runs: c.means[g].runs };
  const less = (c, g) => { const d = c.differences[g - 1]; return d && { value: d.difference, half: (d.interval_95[1] - d.interval_95[0]) / 2 }; };
  clickable(root, { title: "Relative friction of each group", x, y: `relative friction ${MU}`, log: [["x", "w"], ["y", MU]], zero: true, file: "groups", rows, describe: (p) => `${p.group}, ${at(p.condition)}: ${MU} ${p.value.toFixed(3)} \u00b1 ${p.half.toFixed(3)}, runs ${p.runs}` }).set(series(0, mean));
  clickable(root, { title: `Difference from ${groups[0].name}`, x, y: `difference of ${MU}`, log: [["x", "w"]], zero: false, file: "differences", rows, describe: (p) => `${p.group} less ${groups[0].name}, ${at(p.condition)}: ${p.value.toFixed(3)}, 95 % within \u00b1 ${p.half.toFixed(3)}` }).set(series(1, less));
  staticFiles(page);
  root.hidden = false;
}
