import { figure, levels, marks, SERIES, traces, WITHIN } from "/plots.js";

// The token comes with the address's fragment, which is never sent, and stays with this tab.
const given = new URLSearchParams(location.hash.slice(1)).get("token");
if (given) {
  sessionStorage.setItem("token", given);
  history.replaceState(null, "", "#/");
}
const token = sessionStorage.getItem("token") ?? "";
const main = document.getElementById("main");
const link = document.getElementById("link");
const where = document.getElementById("where");
const NONE = "none";
const STATES = 600;

const get = (address, options = {}) => fetch(address, { ...options, headers: { ...options.headers, Authorization: `Bearer ${token}` } });

// Marks that turn text round or that nobody sees are written out, as in the other views.
const hidden = /[\u061c\u200b\u200e\u200f\u2028-\u202e\u2060\u2066-\u2069\ufeff]/g;
const shown = (text) => (typeof text === "string" ? text.replace(hidden, (c) => `\\u${c.charCodeAt(0).toString(16).padStart(4, "0")}`) : text);

// Elements are made of text, never of markup: names in records may hold some.
function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value != null) made.setAttribute(name, value);
  }
  made.append(...children.filter((c) => c != null).map(shown));
  return made;
}

const fixed = (value, digits, unit = "") => (value == null ? NONE : `${value.toFixed(digits)}${unit}`);
const signed = (value, digits, unit = "") => (value == null ? NONE : `${value >= 0 ? "+" : ""}${value.toFixed(digits)}${unit}`);
const part = (name) => encodeURIComponent(name);

async function fetched(address) {
  let answer;
  try {
    answer = await get(address);
  } catch {
    throw new Error("The dashboard does not answer: its process may have ended.");
  }
  if (answer.status === 401) throw new Error("The token is wrong or missing: open the address that the dashboard printed at its start.");
  if (answer.status === 404) throw new Error("There is no such run.");
  if (!answer.ok) throw new Error((await answer.text()) || `refused (${answer.status})`);
  return answer;
}

// --- the catalogue -------------------------------------------------------------------------------------------------

async function catalogue() {
  const runs = await (await fetched("/api/runs")).json();
  const chosen = new Set();
  const compare = el("button", { type: "button", disabled: true, onclick: () => { location.hash = `#/compare/${[...chosen].map(part).join("/")}`; } }, "Compare the two chosen runs");
  const body = el("tbody");
  const count = el("p", { class: "note", role: "status" });
  const search = el("input", { type: "search", id: "search", autocomplete: "off" });
  const row = (run) => {
    const box = el("input", { type: "checkbox", "aria-label": `choose ${run.folder}`, onchange: (event) => {
      if (event.target.checked) chosen.add(run.folder); else chosen.delete(run.folder);
      compare.disabled = chosen.size !== 2;
    } });
    box.checked = chosen.has(run.folder);
    const pages = run.pages.map((page) => el("a", { href: `#/page/${part(run.folder)}/${part(page)}` }, page));
    const began = new Date(run.started_unix_s * 1000).toISOString().slice(0, 16).replace("T", " ");
    const outcome = run.live ? "goes on" : run.outcome.replaceAll("_", " ") || "no ending";
    return el("tr", {},
      el("td", {}, box),
      el("td", {}, el("a", { href: `#/run/${part(run.folder)}` }, run.folder)),
      el("td", { class: "wide" }, began), el("td", { class: "wide" }, run.plan), el("td", { class: "wide" }, run.setup),
      el("td", { class: "n" }, `${run.passes} of ${run.planned}`),
      el("td", {}, outcome + (run.departed ? ", disagrees with the model" : "")),
      el("td", {}, ...pages.flatMap((page, i) => (i ? [", ", page] : [page]))));
  };
  const show = () => {
    const wanted = search.value.trim().toLowerCase().split(/\s+/);
    const found = runs.filter((run) => {
      const text = `${run.folder} ${run.plan} ${run.setup} ${run.live ? "goes on" : run.outcome} ${run.departed ? "departed" : ""}`.toLowerCase();
      return wanted.every((word) => text.includes(word));
    });
    body.replaceChildren(...found.map(row));
    count.textContent = `${found.length} of ${runs.length} runs`;
  };
  search.addEventListener("input", show);
  show();
  const head = (text, kind) => el("th", { scope: "col", class: kind }, text);
  main.replaceChildren(
    el("h1", {}, "Runs"),
    el("p", { class: "keys" }, el("label", { for: "search" }, "Search"), search, compare), count,
    el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Runs" },
      el("table", {}, el("thead", {}, el("tr", {}, el("th", { scope: "col" }, "two"), head("run"), head("began, UTC", "wide"), head("plan", "wide"), head("setup", "wide"), head("passes", "n"), head("outcome"), head("pages"))), body)));
}

// --- pages that were written ---------------------------------------------------------------------------------------

// Without script and without an origin: a report asks for nothing.
async function written(title, address) {
  const page = new DOMParser().parseFromString(await (await fetched(address)).text(), "text/html");
  for (const script of page.querySelectorAll("script")) script.remove();
  main.replaceChildren(el("h1", {}, title), el("iframe", { sandbox: "", srcdoc: `<!doctype html>${page.documentElement.outerHTML}`, title }));
}

// --- a run ---------------------------------------------------------------------------------------------------------

class Picture {
  constructor() { this.clear(null); }
  clear(run) {
    this.run = run;
    this.states = [];
    this.passes = [];
    this.events = [];
    this.progress = { made: run?.made_before ?? 0, planned: run?.planned ?? 0, remaining_s: 0 };
    this.trip = null;
    this.paused = false;
    this.off = null;
    this.ended = null;
    this.changed = { passes: true, events: true, states: true };
  }
  take({ about, said }) {
    if (about === "run") this.clear(said);
    else if (about === "state") { this.states.push(said); if (this.states.length > STATES) this.states.shift(); this.changed.states = true; }
    else if (about === "pass") { this.passes.push(said); this.changed.passes = true; }
    else if (about === "progress") this.progress = said;
    else if (about === "off") this.off = said;
    else if (about === "ended") this.ended = said;
    else if (about === "event") {
      const what = said.event.event;
      // A stop that was asked for trips nothing: it is no alarm.
      if (what === "tripped" && said.event.cause !== "stopped") this.trip = said;
      if (what === "paused") this.paused = true;
      if (what === "resumed") this.paused = false;
      this.events.push(said);
      if (this.events.length > 500) this.events.shift();
      this.changed.events = true;
    }
  }
}

// What a plan varies besides the amplitude; `count` says at how many settings.
const regulated = (within) => (values) => levels(values, within).names.length;
const FACTORS = [
  { name: "frequency, kHz", of: (p) => p.pass.frequency_hz / 1e3, count: regulated(WITHIN.frequency) },
  { name: "speed, mm/s", of: (p) => p.pass.speed_m_s * 1e3, count: regulated(WITHIN.speed) },
  { name: "normal force, N", of: (p) => p.pass.normal_force_n, count: regulated(WITHIN.force) },
  { name: "position, mm", of: (p) => p.pass.position_m * 1e3, count: (values) => new Set(values.map((v) => Math.round(v / 10))).size },
];

function runPage(name, control) {
  const picture = new Picture();
  const title = el("h1", {}, name);
  const about = el("p", { class: "note" });
  const state = el("span", { class: "state", role: "status" }, "waiting");
  const said = el("p", { role: "status", class: "note" });
  const ask = async (what) => {
    said.textContent = `${what}: asked`;
    try {
      const answer = await get(`/api/runs/${part(name)}/ask`, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ ask: what }) });
      said.textContent = answer.ok ? `${what}: told to the run` : `${what}: refused, ${(await answer.text()) || answer.status}`;
    } catch {
      said.textContent = `${what}: the dashboard does not answer. Use the emergency stop, or Ctrl-C where the run was started.`;
    }
  };
  const stop = el("button", { type: "button", class: "stop", onclick: () => ask("stop") }, "Stop");
  const pause = el("button", { type: "button", onclick: () => ask(picture.paused ? "resume" : "pause") }, "Pause");
  const keys = el("p", { class: "keys" }, stop, control ? pause : null, state);
  const trip = el("div", { role: "alert" });
  const cells = {};
  const now = el("dl", { class: "now" });
  const ofTheLoop = [];
  for (const [key, words] of Object.entries({ passes: "passes", left: "remaining", phase: "point, phase", mu: "measured \u03bc'", predicted: "predicted \u03bc'", z: "residual", lateral: "lateral force", normal: "normal force", w: "amplitude w", f: "frequency", output: "output", temperature: "amplifier", late: "latest cycle" })) {
    cells[key] = el("dd", {}, NONE);
    const cell = el("div", {}, el("dt", {}, words), cells[key]);
    if (!["passes", "left"].includes(key)) ofTheLoop.push(cell);
    now.append(cell);
  }
  const plots = el("div", { class: "plots" });
  const events = el("ol", { class: "events", tabindex: "0", "aria-label": "Events" });
  const passes = el("h2", {}, "Passes");
  const rows = el("tbody");
  const head = (text) => el("th", { scope: "col", class: "n" }, text);
  const table = el("div", { class: "scroll passes", tabindex: "0", role: "region", "aria-label": "Passes" }, el("table", {},
    el("thead", {}, el("tr", {}, ...["point", "w, um", "f, kHz", "U, mm/s", "load, N", "\u03bc'", "predicted", "difference", "surprise, sd"].map(head))), rows));
  main.replaceChildren(title, about, keys, said, trip, now, plots, el("h2", {}, "Events"), events, passes, el("p", { class: "note" }, "Difference: measured less predicted \u03bc'. Surprise: the force against what the model lets expect after the passes before, which have corrected its stiffnesses and \u03bc\u2080. The two can differ in sign."), table);

  const figures = {
    forces: figure(plots, "Forces"), mu: figure(plots, "Relative friction now"), w: figure(plots, "Relative friction against amplitude"),
    psi: figure(plots, "Relative friction against \u03a8"), map: figure(plots, "Surprise over the conditions"), late: figure(plots, "Lateness of the loop"),
  };
  const charts = {
    forces: traces(figures.forces.plot, "lateral force, N", [{ colour: "--a", band: true }, { colour: "--b", band: true, dash: [8, 4], right: true }], "normal force, N"),
    mu: traces(figures.mu.plot, "relative friction \u03bc'", [{ colour: "--a", band: true }, { colour: "--c", band: true, dash: [8, 4] }], null, [-0.1, 1.4]),
    w: marks(figures.w.plot, "amplitude w, um peak to peak", "relative friction \u03bc'", true),
    psi: marks(figures.psi.plot, "\u03a8 (Eq. 17)", "relative friction \u03bc'", true),
    map: marks(figures.map.plot, "amplitude w, um peak to peak", FACTORS[0].name, false),
    late: traces(figures.late.plot, "latest of 0.1 s, us", [{ colour: "--a" }]),
  };

  function drawStates() {
    const states = picture.states;
    const x = states.map((s) => s.time_s);
    const edge = (key, i) => states.map((s) => s.extremes[key]?.[i] ?? null);
    const value = (key) => states.map((s) => s[key] ?? null);
    const around = (k) => states.map((s) => (s.predicted == null ? null : s.predicted + k * (s.predicted_sd ?? 0)));
    charts.forces.setData([x, edge("lateral_force_n", 1), edge("lateral_force_n", 0), value("lateral_force_n"), edge("normal_force_n", 1), edge("normal_force_n", 0), value("normal_force_n")]);
    charts.mu.setData([x, edge("mu_relative", 1), edge("mu_relative", 0), value("mu_relative"), around(2), around(-2), value("predicted")]);
    charts.late.setData([x, states.map((s) => s.extremes.lateness_s * 1e6)]);
    const s = states.at(-1);
    // Of a run that is over nothing is told of single cycles: its record has them.
    for (const one of ["forces", "mu", "late"]) figures[one].show(Boolean(s));
    for (const cell of ofTheLoop) cell.hidden = !s;
    if (!s) return;
    const span = (key, digits) => { const e = s.extremes[key]; return e ? `${e[0].toFixed(digits)} to ${e[1].toFixed(digits)}` : NONE; };
    figures.forces.say(`Line: lateral; dashes: normal (right). Bands: least and greatest of all cycles. Last 0.1 s: lateral ${span("lateral_force_n", 3)} N, normal ${span("normal_force_n", 3)} N.`);
    figures.mu.say(`Line: measured, with the least and the greatest of all cycles; dashes: predicted, with twice its standard uncertainty; what lies beyond the axis is a turn. Now ${fixed(s.mu_relative, 3)} and ${fixed(s.predicted, 3)}.`);
    figures.late.say(`How late the latest cycle of each 0.1 s began. Now ${fixed(s.extremes.lateness_s * 1e6, 0)} us, over ${s.extremes.cycles} cycles.`);
    cells.phase.textContent = `${s.point === 4294967295 ? NONE : s.point}, ${s.phase}`;
    cells.mu.textContent = s.mu_relative == null ? NONE : `${fixed(s.mu_relative, 3)} \u00b1 ${fixed(s.mu_relative_sd, 3)}`;
    cells.predicted.textContent = s.predicted == null ? NONE : `${fixed(s.predicted, 3)} \u00b1 ${fixed(s.predicted_sd, 3)}`;
    cells.z.textContent = s.z == null ? NONE : `${signed(s.residual, 3)} (${signed(s.z, 1)} sd)`;
    cells.lateral.textContent = signed(s.lateral_force_n, 4, " N");
    cells.normal.textContent = fixed(s.normal_force_n, 4, " N");
    cells.w.textContent = fixed(s.amplitude_pp_m == null ? null : s.amplitude_pp_m * 1e6, 3, " um");
    cells.f.textContent = fixed(s.frequency_hz == null ? null : s.frequency_hz / 1e3, 3, " kHz");
    cells.output.textContent = s.output_on == null ? "not read" : s.output_on ? "on" : "off";
    cells.temperature.textContent = fixed(s.temperature_c, 1, " \u00b0C");
    cells.late.textContent = fixed(Math.max(...states.slice(-10).map((one) => one.extremes.lateness_s)) * 1e6, 0, " us");
  }

  function drawPasses() {
    const compared = picture.passes.filter((p) => p.comparison && p.comparison.mu_relative != null && p.pass.amplitude > 0);
    const speed = (p) => p.pass.speed_m_s * 1e3;
    const speeds = levels(compared.map(speed), WITHIN.speed);
    // Speeds beyond the last mark share it, and the key says so: no mark stands for a speed that is not its own.
    const mark = (index) => SERIES[Math.min(index, SERIES.length - 1)];
    const place = (x) => (p) => ({ x: x(p), y: p.comparison.mu_relative, sd: p.comparison.mu_relative_sd, predicted: p.comparison.predicted, predicted_sd: p.comparison.predicted_sd, ...mark(speeds.index(speed(p))) });
    const key = SERIES.map((one) => [one.name, speeds.names.filter((_, i) => mark(i) === one)])
      .filter(([, of]) => of.length).map(([name, of]) => `${name}: ${of.join(", ")} mm/s`).join("; ");
    const tail = "All frequencies and loads. Strokes: predicted, with twice its standard uncertainty.";
    charts.w.set(compared.map(place((p) => p.pass.amplitude * 1e6)));
    figures.w.say(compared.length ? `${compared.length} passes; ${key}. ${tail}` : "No pass with vibration yet.");
    const known = compared.filter((p) => p.psi_eq17 != null);
    charts.psi.set(known.map(place((p) => p.psi_eq17)));
    figures.psi.say(known.length ? `${known.length} passes; ${key}. ${tail}` : "No pass with a \u03a8 yet: it needs vibration and a friction without it.");
    const judged = compared.filter((p) => Number.isFinite(p.comparison.z));
    const count = (factor) => factor.count(judged.map(factor.of));
    const factor = FACTORS.reduce((best, one) => (count(one) > count(best) ? one : best), FACTORS[0]);
    charts.map.set(judged.map((p) => {
      const z = p.comparison.z;
      return { x: p.pass.amplitude * 1e6, y: factor.of(p), kind: 0, size: 2 + 2.2 * Math.min(Math.abs(z), 5), hollow: z < 0, faint: true, colour: z < 0 ? "--b" : "--a" };
    }), factor.name);
    const worst = judged.reduce((w, p) => (w && Math.abs(w.comparison.z) >= Math.abs(p.comparison.z) ? w : p), null);
    figures.map.say(worst ? `Filled: more friction than the model and the passes before let expect; hollow: less; the larger, the more standard deviations (all alike from 5 on). Largest: ${signed(worst.comparison.z, 1)} at point ${worst.pass.point}.` : "No pass was judged yet.");
    passes.textContent = picture.passes.length > 200 ? `The last 200 of ${picture.passes.length} passes` : "Passes";
    rows.replaceChildren(...picture.passes.slice(-200).reverse().map((p) => {
      const c = p.comparison;
      return el("tr", {}, ...[String(p.pass.point), fixed(p.pass.amplitude * 1e6, 3), fixed(p.pass.frequency_hz / 1e3, 2), signed(p.pass.speed_m_s * (p.pass.direction ?? 1) * 1e3, 1), fixed(p.pass.normal_force_n, 3), fixed(c?.mu_relative, 3), fixed(c?.predicted, 3), signed(c?.mu_relative == null ? null : c.mu_relative - c.predicted, 3), signed(c?.z, 1)].map((text) => el("td", { class: "n" }, text)));
    }));
  }

  function drawWords() {
    const run = picture.run;
    if (run) {
      title.textContent = shown(`${run.plan} on ${run.setup}`);
      about.textContent = shown(`${run.guards?.nobody_touches_the_plate ? "NOBODY TOUCHES THE PLATE: the guards for a finger are off; " : ""}${name}; operator ${run.operator ?? "not stated"}; sample ${run.sample ?? "not stated"}; compared with ${run.model}${run.fast ? "; in virtual time" : ""}`);
    }
    const { made, planned, remaining_s } = picture.progress;
    cells.passes.textContent = `${made} of ${planned}`;
    cells.left.textContent = picture.ended ? "over" : `${Math.floor(remaining_s / 60)} min ${Math.round(remaining_s % 60)} s`;
    const last = picture.states.at(-1);
    const ended = picture.ended;
    state.textContent = ended ? (ended.outcome?.outcome ?? "failed").replaceAll("_", " ") : picture.trip ? "tripped" : picture.paused ? "paused" : last?.armed ? "armed" : last ? "not armed" : "waiting";
    stop.hidden = pause.hidden = Boolean(ended);
    pause.disabled = Boolean(run?.fast);
    pause.textContent = picture.paused ? "Go on" : "Pause";
    const lines = [picture.trip?.words, ended?.error, ended && !picture.trip && ended.outcome?.outcome !== "stopped" ? ended.remedy : null, ended?.off ?? picture.off, ended?.agreement].filter(Boolean);
    const key = lines.join("\n");
    if (trip.dataset.key !== key) {
      trip.dataset.key = key;
      trip.className = picture.trip || picture.off || ended?.error ? "trip" : "";
      trip.replaceChildren(...lines.map((line) => el("p", {}, line)));
    }
  }

  function draw() {
    const { changed } = picture;
    picture.changed = {};
    drawWords();
    if (changed.states) drawStates();
    if (changed.passes) drawPasses();
    if (changed.events) events.replaceChildren(...[...picture.events].reverse().map((told) => el("li", {}, `${told.at_s.toFixed(1)} s: ${told.words}`)));
  }
  draw();

  let open = true;
  let socket = null;
  let pauseMs = 500;
  let timer = setInterval(() => { if (document.visibilityState === "visible") draw(); }, 250);
  let heard = 0;
  async function past() {
    for (const message of await (await fetched(`/api/runs/${part(name)}/past`)).json()) picture.take(message);
    link.textContent = "";
  }
  function follow() {
    const address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/api/live/${part(name)}`;
    let any = false;
    socket = new WebSocket(address, ["muprime", token]);
    socket.onmessage = (event) => {
      any = true;
      heard = Date.now();
      pauseMs = 500;
      link.textContent = "live";
      picture.take(JSON.parse(event.data));
    };
    socket.onclose = async () => {
      if (!open) return;
      if (picture.ended) { link.textContent = "the run is over"; return; }
      if (!any && !picture.run) {
        // Nobody tells of it: it is over, or was run elsewhere.
        try { await past(); return; } catch (why) { said.textContent = why.message; }
      }
      link.textContent = heard ? `connection lost; the last word came ${Math.round((Date.now() - heard) / 1000)} s ago` : "waiting for the run";
      setTimeout(() => open && follow(), pauseMs);
      pauseMs = Math.min(2 * pauseMs, 5000);
    };
  }
  follow();
  return () => { open = false; clearInterval(timer); socket?.close(); link.textContent = ""; };
}

// --- where we are ----------------------------------------------------------------------------------------------------

let leave = () => {};
async function route() {
  leave();
  leave = () => {};
  const [page = "", ...rest] = location.hash.replace(/^#\//, "").split("/").map(decodeURIComponent);
  where.textContent = rest.length ? `/ ${rest.join(" / ")}` : "";
  document.title = rest.length ? `${rest.join(" ")} - muprime` : "muprime";
  try {
    if (page === "run") {
      const { control } = await (await fetched("/api/about")).json();
      leave = runPage(rest[0], control);
    } else if (page === "page") await written(rest[1], `/api/runs/${part(rest[0])}/pages/${part(rest[1])}`);
    else if (page === "compare") await written("Two runs", `/api/compare?a=${part(rest[0])}&b=${part(rest[1])}`);
    else await catalogue();
  } catch (why) {
    main.replaceChildren(el("h1", {}, "This cannot be shown"), el("p", { role: "alert" }, why.message), el("p", {}, el("a", { href: "#/" }, "All runs")));
  }
  main.focus();
}
addEventListener("hashchange", route);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", route);
route();
