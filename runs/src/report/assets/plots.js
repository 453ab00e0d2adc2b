// The figures of a live run. Each has a text for who cannot see it; series differ by mark and dash as well as by colour.
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const HEIGHT = 260;

export function figure(parent, title) {
  const box = document.createElement("figure");
  const head = document.createElement("h2");
  const plot = document.createElement("div");
  const caption = document.createElement("figcaption");
  head.textContent = title;
  plot.className = "plot";
  plot.setAttribute("role", "img");
  plot.setAttribute("aria-label", title);
  box.append(head, plot, caption);
  parent.append(box);
  return {
    plot,
    show(shown) {
      box.hidden = !shown;
    },
    say(text) {
      caption.textContent = text;
      plot.setAttribute("aria-label", `${title}. ${text}`);
    },
  };
}

function axes(xTitle, yTitle, right) {
  const common = { stroke: css("--ink"), grid: { stroke: css("--line"), width: 0.5 }, ticks: { stroke: css("--line"), width: 0.5 }, font: "13px system-ui, sans-serif", labelFont: "13px system-ui, sans-serif", labelSize: 22 };
  const all = [{ ...common, label: xTitle, size: 34 }, { ...common, label: yTitle, size: 58 }];
  if (right) all.push({ ...common, label: right, scale: "right", side: 1, size: 58, grid: { show: false } });
  return all;
}

// What lies between two abscissae, about a point a column of the screen: of each series the greatest (1), the least (-1), or the middle of the
// two before it (0). Where nothing lies over more than two columns nothing is drawn.
function thinned([time, ...all], how, from, to, columns) {
  const place = (x) => {
    let [a, b] = [0, time.length];
    while (a < b) { const m = (a + b) >> 1; if (time[m] < x) a = m + 1; else b = m; }
    return a;
  };
  const [first, last] = [Math.max(place(from) - 1, 0), Math.min(place(to) + 1, time.length)];
  if (last - first <= 2 * columns) return [time, ...all].map((values) => values.slice(first, last));
  const made = [[], ...all.map(() => [])];
  let column = -Infinity;
  for (let i = first; i < last; i += 1) {
    const now = Math.floor((time[i] - from) / (to - from) * columns);
    if (now !== column) {
      if (now > column + 2 && i > first) { made[0].push((time[i - 1] + time[i]) / 2); for (let j = 1; j < made.length; j += 1) made[j].push(null); }
      column = now;
      made[0].push(time[i]);
      for (let j = 1; j < made.length; j += 1) made[j].push(null);
    }
    const k = made[0].length - 1;
    for (let j = 0; j < all.length; j += 1) {
      const [value, best] = [all[j][i], made[j + 1][k]];
      if (value != null && (best == null || (how[j] > 0 ? value > best : value < best))) made[j + 1][k] = value;
    }
  }
  how.forEach((one, j) => { if (one === 0) made[j + 1] = made[j - 1].map((high, i) => (high == null || made[j][i] == null ? null : (high + made[j][i]) / 2)); });
  return made;
}

// A chart that a drag enlarges, a drag with Shift moves and a double click shows whole, by keys too; whose axes may be logarithmic, and
// which follows its frame's width. `ready` gets the chart each time it is made; `moved` the part of x that is shown, none for the whole.
function chartOf(plot, options, ready) {
  const zoom = {};
  const log = {};
  const own = { chart: null, moved: null, ends: null };
  // Shows a part of x, or everything.
  own.see = (x) => {
    if (x) zoom.x = x;
    else for (const key of Object.keys(zoom)) delete zoom[key];
    own.chart.setData(own.data?.(zoom.x) ?? own.chart.data);
  };
  // Data of which only what is in view is drawn: see thinned.
  own.put = (data, how) => {
    own.data = (x) => thinned(data, how, ...(x ?? [data[0][0], data[0].at(-1)]), Math.max(plot.clientWidth, 200));
    own.chart.setData(own.data(zoom.x));
  };
  const seen = (x) => { own.see(x); own.moved?.(x); };
  const whole = () => seen(null);
  const part = () => zoom.x ?? [own.chart.scales.x.min, own.chart.scales.x.max];
  // Moves the part by a share of its width and widens it, within the data.
  const move = ([low, high], share, factor = 1) => {
    if (low == null) return;
    const [to, from] = log.x ? [Math.log, Math.exp] : [Number, Number];
    const [first, last] = (own.ends ?? [own.chart.data[0][0], own.chart.data[0].at(-1)]).map((x) => to(log.x ? Math.max(x, low) : x));
    const half = (to(high) - to(low)) * factor / 2;
    if (2 * half >= last - first) { whole(); return; }
    const middle = Math.min(Math.max((to(low) + to(high)) / 2 + share * (to(high) - to(low)), first + half), last - half);
    seen([from(middle - half), from(middle + half)]);
  };
  const KEYS = { ArrowLeft: [-0.2], ArrowRight: [0.2], "+": [0, 0.5], "=": [0, 0.5], "-": [0, 2] };
  plot.tabIndex = 0;
  plot.setAttribute("aria-keyshortcuts", "ArrowLeft ArrowRight + - 0");
  plot.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !(event.key in KEYS || event.key === "0")) return;
    event.preventDefault();
    if (event.key === "0") whole();
    else move(part(), ...KEYS[event.key]);
  });
  const grabbed = (u, event) => {
    const [start, width, from] = [event.clientX, u.over.clientWidth, part()];
    const drag = ({ clientX }) => move(from, (start - clientX) / width);
    const done = () => { removeEventListener("mousemove", drag); removeEventListener("mouseup", done); };
    addEventListener("mousemove", drag);
    addEventListener("mouseup", done);
  };
  const select = (u) => {
    const { left, top, width, height } = u.select;
    if (width < 8 && height < 8) return;
    zoom.x = [u.posToVal(left, "x"), u.posToVal(left + width, "x")];
    for (const key of Object.keys(u.scales)) if (key !== "x") zoom[key] = [u.posToVal(top + height, key), u.posToVal(top, key)];
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    seen(zoom.x);
  };
  const padded = (key) => (_, low, high) => {
    if (low == null) return log[key] ? [0.1, 1] : [0, 1];
    if (log[key]) return [(low > 0 ? low : high / 1e3) / 1.15, high * 1.15];
    const margin = 0.06 * (high - low || Math.abs(high) || 1);
    return [low - margin, high + margin];
  };
  const make = () => {
    const data = own.chart?.data ?? options.series.map(() => []);
    own.chart?.destroy();
    const scales = Object.fromEntries(Object.entries(options.scales).map(([key, scale]) => {
      const range = Array.isArray(scale.range) ? () => scale.range : !log[key] && scale.range ? scale.range : padded(key);
      return [key, { ...scale, distr: log[key] ? 3 : 1, range: (...all) => zoom[key] ?? range(...all) }];
    }));
    const cursor = { points: { show: false }, drag: { x: true, y: true, uni: 20, setScale: false }, bind: { dblclick: () => whole, mousedown: (u, over, plain) => (event) => (event.shiftKey ? grabbed(u, event) : plain(event)) }, ...options.cursor };
    const hooks = { ...options.hooks, setSelect: [select] };
    own.chart = new uPlot({ ...options, scales, cursor, hooks, legend: { show: false }, width: Math.max(plot.clientWidth, 200), height: HEIGHT }, data, plot);
    ready?.(own.chart);
  };
  own.log = (key, on) => { log[key] = on; delete zoom[key]; make(); };
  own.isLog = (key) => Boolean(log[key]);
  make();
  new ResizeObserver(() => plot.isConnected && own.chart.setSize({ width: Math.max(plot.clientWidth, 200), height: HEIGHT })).observe(plot);
  return own;
}

// Marks that turn text round or that nobody sees are written out, as in the other views.
const hidden = /[\u061c\u200b\u200e\u200f\u2028-\u202e\u2060\u2066-\u2069\ufeff]/g;
export const shown = (text) => (typeof text === "string" ? text.replace(hidden, (c) => `\\u${c.charCodeAt(0).toString(16).padStart(4, "0")}`) : text);

// Elements are made of text, never of markup: names in records may hold some.
export function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value != null) made.setAttribute(name, value);
  }
  made.append(...children.filter((c) => c != null).map(shown));
  return made;
}

export function save(name, content) {
  const link = el("a", { href: URL.createObjectURL(content), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// A picture on the page's ground, as a PNG.
export function savePng(name, source, width, height) {
  const canvas = el("canvas", { width, height });
  const ctx = canvas.getContext("2d");
  ctx.fillStyle = css("--paper");
  ctx.fillRect(0, 0, width, height);
  ctx.drawImage(source, 0, 0, width, height);
  canvas.toBlob((blob) => save(`${name}.png`, blob));
}

export const button = (text, click, more = {}) => el("button", { type: "button", onclick: click, ...more }, text);

// Under a chart: linear or logarithmic, the whole of it, a picture. Returns the line of buttons.
export function tools(own, name, axes) {
  const log = axes.map(([key, words]) => button(`log ${words}`, (event) => {
    own.log(key, !own.isLog(key));
    event.target.setAttribute("aria-pressed", String(own.isLog(key)));
  }, { "aria-pressed": "false", class: "switch" }));
  const png = button("PNG", () => { const { canvas } = own.chart.ctx; savePng(name, canvas, canvas.width, canvas.height); });
  return [...log, png];
}

// Values against loop time: bands between the least and the greatest of all cycles, and lines.
export function traces(plot, yTitle, series, right, fixed, over) {
  const drawn = [{}];
  const bands = [];
  for (const one of series) {
    const colour = css(one.colour);
    const scale = one.right ? "right" : "y";
    if (one.band) {
      drawn.push({ scale, stroke: "transparent", points: { show: false } }, { scale, stroke: "transparent", points: { show: false } });
      bands.push({ series: [drawn.length - 2, drawn.length - 1], fill: colour + "44" });
    }
    drawn.push({ scale, stroke: colour, width: 2, dash: one.dash, points: { show: false }, spanGaps: false });
  }
  const scales = { x: { time: false, range: (_, low, high) => (low == null ? [0, 1] : [low, high]) }, y: fixed ? { range: fixed } : {}, ...(right && { right: {} }) };
  // Charts of the same time have one crosshair.
  const cursor = { sync: { key: "time" } };
  return chartOf(plot, { scales, cursor, hooks: { draw: over ? [over] : [] }, axes: axes("loop time, s", yTitle, right), series: drawn, bands });
}

// How series differ: by mark, by whether it is filled, and by colour. No two are alike.
const NAMES = ["discs", "squares", "triangles", "diamonds"];
const COLOURS = ["--a", "--b", "--c", "--grey"];
export const SERIES = [false, true].flatMap((hollow) => NAMES.map((name, kind) => ({ name: hollow ? `hollow ${name}` : name, kind, hollow, colour: COLOURS[kind] })))
  .concat({ name: "crosses", kind: 4, hollow: true, colour: "--ink" });

function shape(ctx, kind, x, y, r, filled) {
  ctx.beginPath();
  if (kind === 4) {
    ctx.moveTo(x - r, y - r); ctx.lineTo(x + r, y + r); ctx.moveTo(x - r, y + r); ctx.lineTo(x + r, y - r);
    ctx.stroke();
    return;
  }
  if (kind === 0) ctx.arc(x, y, r, 0, 2 * Math.PI);
  else if (kind === 1) ctx.rect(x - r, y - r, 2 * r, 2 * r);
  else if (kind === 2) { ctx.moveTo(x, y - r * 1.3); ctx.lineTo(x + r * 1.2, y + r); ctx.lineTo(x - r * 1.2, y + r); ctx.closePath(); }
  else { ctx.moveTo(x, y - r * 1.4); ctx.lineTo(x + r * 1.4, y); ctx.lineTo(x, y + r * 1.4); ctx.lineTo(x - r * 1.4, y); ctx.closePath(); }
  if (filled) ctx.fill();
  ctx.stroke();
}

// How far, as a share, measured values of one setting lie apart: the same as in the figures that need no script.
export const WITHIN = { speed: 0.03, frequency: 0.01, force: 0.1 };

// The levels in some values, each named by its mean, and the one in which a value lies: fixed digits would cut through a setting's scatter.
export function levels(values, within) {
  const all = [];
  for (const value of [...values].sort((a, b) => a - b)) {
    if (all.length && value <= (1 + within) * all.at(-1)[0]) all.at(-1).push(value);
    else all.push([value]);
  }
  return {
    names: all.map((level) => String(Number((level.reduce((sum, v) => sum + v, 0) / level.length).toPrecision(3)))),
    index: (value) => Math.max(all.findLastIndex((level) => level[0] <= value), 0),
  };
}

// Marks at places: `points` of { x, y, sd, predicted, predicted_sd, kind, size, hollow, colour }.
export function marks(plot, xTitle, yTitle, yFromZero, ready) {
  let points = [];
  let own = null;
  // A logarithm shows nothing at zero and below.
  const drawable = (p) => !own || ((p.x > 0 || !own.isLog("x")) && (p.y > 0 || !own.isLog("y")));
  const draw = (u) => {
    const ctx = u.ctx;
    const px = devicePixelRatio;
    const colours = Object.fromEntries([...COLOURS, "--ink"].map((name) => [name, css(name)]));
    const at = (x, y) => [u.valToPos(x, "x", true), u.valToPos(y, "y", true)];
    ctx.save();
    ctx.beginPath();
    // With room for a whole mark at the edge.
    const room = 14 * px;
    ctx.rect(u.bbox.left - room, u.bbox.top - room, u.bbox.width + 2 * room, u.bbox.height + 2 * room);
    ctx.clip();
    const drawn = points.filter(drawable);
    for (const p of drawn) {
      if (p.predicted != null) {
        const [x, y] = at(p.x, p.predicted);
        const half = u.valToPos(p.predicted - 2 * (p.predicted_sd ?? 0), "y", true) - y;
        ctx.fillStyle = colours["--grey"] + "33";
        ctx.fillRect(x - 5 * px, y - half, 10 * px, 2 * half);
        ctx.strokeStyle = colours["--ink"];
        ctx.lineWidth = 2 * px;
        ctx.beginPath();
        ctx.moveTo(x - 7 * px, y);
        ctx.lineTo(x + 7 * px, y);
        ctx.stroke();
      }
    }
    for (const p of drawn) {
      const colour = colours[p.colour];
      const [x, y] = at(p.x, p.y);
      ctx.strokeStyle = colour;
      ctx.fillStyle = colour + (p.faint ? "77" : "");
      ctx.lineWidth = 1.5 * px;
      if (p.sd) {
        ctx.beginPath();
        ctx.moveTo(x, at(p.x, p.y - p.sd)[1]);
        ctx.lineTo(x, at(p.x, p.y + p.sd)[1]);
        ctx.stroke();
      }
      shape(ctx, p.kind, x, y, (p.size ?? 4) * px, !p.hollow);
    }
    ctx.restore();
  };
  const range = (fromZero) => (_, low, high) => {
    if (low == null) return [0, 1];
    const margin = 0.06 * (high - low || Math.abs(high) || 1);
    return [fromZero ? Math.min(0, low) : low - margin, high + margin];
  };
  const scales = { x: { time: false, range: range(true) }, y: { range: range(yFromZero) } };
  own = chartOf(plot, { scales, axes: axes(xTitle, yTitle), series: [{}, { stroke: "transparent", points: { show: false } }, { stroke: "transparent", points: { show: false } }], hooks: { draw: [draw] } }, (u) => {
    // An axis that became logarithmic holds fewer marks.
    if (own) show(u);
    ready?.(u);
  });
  const show = (u) => {
    const sorted = points.filter(drawable).sort((a, b) => a.x - b.x);
    const high = (p) => Math.max(p.y + (p.sd ?? 0), p.predicted ?? p.y);
    const low = (p) => Math.min(p.y - (p.sd ?? 0), p.predicted ?? p.y);
    u.setData([sorted.map((p) => p.x), sorted.map(high), sorted.map((p) => (own.isLog("y") ? p.y : low(p)))]);
  };
  return {
    own,
    set(all, yName) {
      points = all;
      if (yName) own.chart.axes[1].label = yName;
      show(own.chart);
    },
  };
}
