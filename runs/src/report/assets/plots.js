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

function kept(chart, plot) {
  new ResizeObserver(() => plot.isConnected && chart.setSize({ width: Math.max(plot.clientWidth, 200), height: HEIGHT })).observe(plot);
  return chart;
}

const plain = { legend: { show: false }, cursor: { show: false } };

// Values against loop time: bands between the least and the greatest of all cycles, and lines.
export function traces(plot, yTitle, series, right, fixed) {
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
  const options = { ...plain, width: Math.max(plot.clientWidth, 200), height: HEIGHT, scales: { x: { time: false }, ...(fixed && { y: { range: fixed } }) }, axes: axes("loop time, s", yTitle, right), series: drawn, bands };
  return kept(new uPlot(options, drawn.map(() => []), plot), plot);
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
export function marks(plot, xTitle, yTitle, yFromZero) {
  let points = [];
  const draw = (u) => {
    const ctx = u.ctx;
    const px = devicePixelRatio;
    const at = (x, y) => [u.valToPos(x, "x", true), u.valToPos(y, "y", true)];
    ctx.save();
    ctx.beginPath();
    // With room for a whole mark at the edge.
    const room = 14 * px;
    ctx.rect(u.bbox.left - room, u.bbox.top - room, u.bbox.width + 2 * room, u.bbox.height + 2 * room);
    ctx.clip();
    for (const p of points) {
      if (p.predicted != null) {
        const [x, y] = at(p.x, p.predicted);
        const half = u.valToPos(p.predicted - 2 * (p.predicted_sd ?? 0), "y", true) - y;
        ctx.fillStyle = css("--grey") + "33";
        ctx.fillRect(x - 5 * px, y - half, 10 * px, 2 * half);
        ctx.strokeStyle = css("--ink");
        ctx.lineWidth = 2 * px;
        ctx.beginPath();
        ctx.moveTo(x - 7 * px, y);
        ctx.lineTo(x + 7 * px, y);
        ctx.stroke();
      }
    }
    for (const p of points) {
      const colour = css(p.colour);
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
  const options = { ...plain, width: Math.max(plot.clientWidth, 200), height: HEIGHT, scales: { x: { time: false, range: range(true) }, y: { range: range(yFromZero) } }, axes: axes(xTitle, yTitle), series: [{}, { stroke: "transparent", points: { show: false } }, { stroke: "transparent", points: { show: false } }], hooks: { draw: [draw] } };
  const chart = kept(new uPlot(options, [[], [], []], plot), plot);
  return {
    plot: chart,
    set(all, yName) {
      points = all;
      const sorted = [...all].sort((a, b) => a.x - b.x);
      if (yName) chart.axes[1].label = yName;
      chart.setData([sorted.map((p) => p.x), sorted.map((p) => Math.max(p.y + (p.sd ?? 0), p.predicted ?? p.y)), sorted.map((p) => Math.min(p.y - (p.sd ?? 0), p.predicted ?? p.y))]);
    },
  };
}
