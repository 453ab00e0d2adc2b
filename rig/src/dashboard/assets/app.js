import { explore, exploreGroups, passFigures } from "/explore.js";
import { button, el, figure, levels, marks, save, shown, traces, WITHIN } from "/plots.js";

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
// A state comes every 0.1 s; from this on some are missing.
const GAP_S = 0.5;

const get = (address, options = {}) => fetch(address, { ...options, headers: { ...options.headers, Authorization: `Bearer ${token}` } });

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

const began = (run) => new Date(run.started_unix_s * 1000).toISOString().slice(0, 16).replace("T", " ");
const outcome = (run) => (run.live ? "goes on" : run.outcome.replaceAll("_", " ") || "no ending") + (run.departed ? ", disagrees with the model" : "");
const runLink = (name) => el("a", { href: `#/run/${part(name)}` }, name);
// What is not known has a reason in words, and comes last in every order.
const COLUMNS = [
  { name: "run", of: (r) => r.folder, cell: (r) => runLink(r.folder) }, { name: "began, UTC", of: (r) => r.started_unix_s, cell: began, wide: true },
  { name: "plan", of: (r) => r.plan, wide: true }, { name: "operator", of: (r) => r.operator }, { name: "sample", of: (r) => r.sample },
  { name: "tip", of: (r) => r.tip, wide: true }, { name: "setup", of: (r) => r.setup, wide: true }, { name: "model", of: (r) => r.model, wide: true },
  { name: "seed", of: (r) => r.seed, number: true, wide: true }, { name: "\u03bc\u2080", of: (r) => r.mu0, cell: (r) => r.mu0.toFixed(3), number: true },
  { name: "passes", of: (r) => r.passes, cell: (r) => `${r.passes} of ${r.planned}`, number: true }, { name: "outcome", of: outcome },
  { name: "verdict", of: (r) => r.verdict, without: "no diagnosis" }, { name: "tags", of: (r) => r.tags.join(", "), without: NONE }, { name: "note", of: (r) => r.note, without: NONE },
];
const empty = (value) => value == null || value === "";

function thumbnail(run) {
  if (!run.picture) return el("span", { class: "note" }, "no pass with \u03bc'");
  // The one markup that is taken as it comes: this program draws it, of numbers alone.
  const made = el("template");
  made.innerHTML = run.picture;
  return made.content;
}

async function catalogue() {
  const runs = await (await fetched("/api/runs")).json();
  const chosen = new Set();
  const compare = button("Compare the chosen runs", () => { location.hash = `#/compare/${[...chosen].map(part).join("/")}`; }, { disabled: true });
  const body = el("tbody");
  const count = el("p", { class: "note", role: "status" });
  const search = el("input", { type: "search", id: "search", autocomplete: "off" });
  const order = { column: COLUMNS[1], down: true };
  const row = (run) => {
    const box = el("input", { type: "checkbox", "aria-label": `choose ${run.folder}`, onchange: (event) => {
      if (event.target.checked) chosen.add(run.folder); else chosen.delete(run.folder);
      compare.disabled = chosen.size < 2;
    } });
    box.checked = chosen.has(run.folder);
    const pages = run.pages.map((page) => el("a", { href: `#/page/${part(run.folder)}/${part(page)}` }, page));
    const cell = (column) => {
      const value = column.of(run);
      return el("td", { class: `${column.number ? "n" : ""} ${column.wide ? "wide" : ""}` }, empty(value) ? column.without ?? "not stated" : column.cell ? column.cell(run) : String(value));
    };
    return el("tr", {}, el("td", {}, box), el("td", {}, thumbnail(run)), ...COLUMNS.map(cell), el("td", {}, ...pages.flatMap((page, i) => (i ? [", ", page] : [page]))));
  };
  const compared = (a, b) => (typeof a === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true }));
  const show = () => {
    const wanted = search.value.trim().toLowerCase().split(/\s+/);
    const found = runs.filter((run) => {
      const text = COLUMNS.map((c) => c.of(run) ?? "").join("\n").toLowerCase();
      return wanted.every((word) => text.includes(word));
    });
    const { of } = order.column;
    found.sort((a, b) => empty(of(a)) - empty(of(b)) || (empty(of(a)) ? 0 : compared(of(a), of(b)) * (order.down ? -1 : 1)));
    body.replaceChildren(...found.map(row));
    count.textContent = `${found.length} of ${runs.length} runs`;
    for (const head of heads) {
      const mine = head.column === order.column;
      head.cell.setAttribute("aria-sort", mine ? (order.down ? "descending" : "ascending") : "none");
    }
  };
  const heads = COLUMNS.map((column) => ({ column, cell: el("th", { scope: "col", class: `${column.number ? "n" : ""} ${column.wide ? "wide" : ""}` }, button(column.name, () => {
    order.down = order.column === column && !order.down;
    order.column = column;
    show();
  }, { class: "sort" })) }));
  search.addEventListener("input", show);
  show();
  const head = (text) => el("th", { scope: "col" }, text);
  main.replaceChildren(
    el("h1", {}, "Runs"),
    el("p", { class: "keys" }, el("label", { for: "search" }, "Search"), search, compare), count,
    el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Runs" },
      el("table", {}, el("thead", {}, el("tr", {}, head("choose"), head("\u03bc' against w"), ...heads.map((h) => h.cell), head("pages"))), body)));
}

// --- pages that were written, and those that are made here -----------------------------------------------------------

// A file of a folder may come from anywhere: it is shown without script and without an origin.
async function written(title, address) {
  const page = new DOMParser().parseFromString(await (await fetched(address)).text(), "text/html");
  for (const script of page.querySelectorAll("script")) script.remove();
  main.replaceChildren(el("h1", {}, title), el("iframe", { sandbox: "", srcdoc: `<!doctype html>${page.documentElement.outerHTML}`, title }));
}

// A page that this program has just made, as a part of this one, with the figures that it has as a file.
async function made(address, script) {
  const page = new DOMParser().parseFromString(await (await fetched(address)).text(), "text/html");
  const data = page.getElementById("run-data")?.textContent;
  for (const one of page.querySelectorAll("script, style")) one.remove();
  const report = el("div", { class: "report" }, ...page.querySelector("main").childNodes);
  return { report, start: () => { if (data) script(report.querySelector("#explore"), JSON.parse(data), report); } };
}

async function comparison(names) {
  const by = el("select", { id: "by", onchange: () => show() }, ...[["", "the runs themselves"], ["tip", "tip"], ["moisture", "moisture"], ["day", "day"], ["model", "model"]].map(([value, words]) => el("option", { value }, words)));
  const place = el("div", { role: "status" });
  const show = async () => {
    const query = `runs=${part(names.join("/"))}${by.value ? `&by=${by.value}` : ""}`;
    place.replaceChildren("The comparison is being made.");
    try {
      const { report, start } = await made(`/api/compare?${query}`, exploreGroups);
      place.replaceChildren(report);
      start();
    } catch (why) {
      place.replaceChildren(el("p", { role: "alert" }, why.message));
    }
  };
  main.replaceChildren(el("p", { class: "keys" }, el("label", { for: "by" }, "Compare by"), by, ...names.map(runLink)), place);
  await show();
}

// --- a run -----------------------------------------------------------------------------------------------------------

const post = (address, what) => get(address, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(what) });

// Tags and note, to be changed; they go into a file of their own in the run's folder.
function annotations({ folder, tags, note }) {
  const tagged = el("input", { id: "tags", autocomplete: "off", value: tags.join(", ") });
  const text = el("textarea", { id: "note", rows: 2 }, note);
  const result = el("span", { role: "status", class: "note" });
  const write = async () => {
    const answer = await post(`/api/runs/${part(folder)}/annotations`, { tags: tagged.value.split(","), note: text.value }).catch(() => null);
    result.textContent = !answer ? "not written: the dashboard does not answer" : answer.ok ? "written" : `not written: ${(await answer.text()) || answer.status}`;
  };
  return el("div", { class: "keys" }, el("label", { for: "tags" }, "Tags"), tagged, el("label", { for: "note" }, "Note"), text, button("Save", write), result);
}

async function download(address, name, result) {
  try {
    save(name, await (await fetched(address)).blob());
  } catch (why) {
    result.textContent = `${name}: ${why.message}`;
  }
}

// What can be done with a run that is over, what it led to, and its report.
async function finished({ run, diagnosing, undiagnosed }) {
  const name = run.folder;
  const address = `/api/runs/${part(name)}`;
  const result = el("span", { role: "status", class: "note" }, undiagnosed ? `no verdict: ${undiagnosed}` : "");
  let here = true;
  const waits = async () => {
    diagnose.disabled = true;
    result.textContent = "diagnosis under way";
    while (here && (await (await fetched(address)).json()).diagnosing) await new Promise((go) => setTimeout(go, 500));
    if (here) route();
  };
  const diagnose = button(run.verdict ? "Diagnose again" : "Diagnose", async () => {
    const answer = await post(`${address}/diagnose`, {}).catch(() => null);
    if (answer?.ok) waits().catch((why) => { result.textContent = why.message; });
    else result.textContent = `refused: ${answer ? (await answer.text()) || answer.status : "the dashboard does not answer"}`;
  });
  const choose = el("select", { id: "file" }, el("option", { value: "" }, "report"), ...run.files.map((file) => el("option", { value: file }, file)));
  const fetchFile = button("Download", () => (choose.value ? download(`${address}/files/${part(choose.value)}`, choose.value, result) : download(`${address}/report`, `${name}-report.html`, result)));
  const several = (words, items) => (items.length ? el("p", {}, words, ...items.flatMap((item, i) => (i ? [", ", item] : [" ", item]))) : null);
  const fileButton = (file) => button(file, () => download(`${address}/files/${part(file)}`, file, result));
  const followed = ["corrected-model.toml", "next-plan.toml"].filter((file) => run.files.includes(file));
  const finer = async ([from, to]) => (await fetched(`${address}/cycles?from_s=${from.toFixed(6)}&to_s=${to.toFixed(6)}`)).json();
  const { report, start } = await made(`${address}/report`, (root, data, page) => explore(root, data, page, finer));
  const parts = [
    el("p", { class: "keys" }, diagnose, el("label", { for: "file" }, "File"), choose, fetchFile, result), annotations(run),
    several("Verdict:", [run.verdict ?? "no diagnosis yet", ...run.pages.filter((page) => page !== "report.html").map((page) => el("a", { href: `#/page/${part(name)}/${part(page)}` }, page))]),
    several("From the verdict:", followed.map(fileButton)),
    several("Its model or plan comes from:", run.lineage.before.map(runLink)), several("Runs with its corrected model or next plan:", run.lineage.after.map(runLink)),
    report,
  ];
  main.replaceChildren(...parts.filter(Boolean));
  start();
  if (diagnosing) waits().catch((why) => { result.textContent = why.message; });
  return () => { here = false; };
}

// --- a run that goes on ---------------------------------------------------------------------------------------------

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

function runPage(name, control, listed) {
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
    el("thead", {}, el("tr", {}, ...["point", "w, \u00b5m", "f, kHz", "U, mm/s", "load, N", "\u03bc'", "predicted", "difference", "surprise, sd"].map(head))), rows));
  const over = el("p", { hidden: true }, button("Show the finished run", () => route()));
  main.replaceChildren(title, about, keys, said, trip, over, listed ? annotations(listed) : "", now, plots, el("h2", {}, "Events"), events, passes, el("p", { class: "note" }, "Difference: measured less predicted \u03bc'. Surprise: the force against what the model lets expect after the passes before, which have corrected its stiffnesses and \u03bc\u2080. The two can differ in sign."), table);

  const figures = {
    forces: figure(plots, "Forces"), mu: figure(plots, "Relative friction now"), map: figure(plots, "Surprise over the conditions"), late: figure(plots, "Lateness of the loop"),
  };
  const charts = {
    forces: traces(figures.forces.plot, "lateral force, N", [{ colour: "--a", band: true }, { colour: "--b", band: true, dash: [8, 4], right: true }], "normal force, N"),
    mu: traces(figures.mu.plot, "relative friction \u03bc'", [{ colour: "--a", band: true }, { colour: "--c", band: true, dash: [8, 4] }], null, [-0.1, 1.4]),
    map: marks(figures.map.plot, "amplitude w, \u00b5m peak to peak", FACTORS[0].name, false),
    late: traces(figures.late.plot, "latest of 0.1 s, \u00b5s", [{ colour: "--a" }]),
  };
  const ofPasses = passFigures(plots, null);

  function drawStates() {
    const states = picture.states;
    // Where states were left out for a slow page, nothing is drawn.
    const gap = (i) => i > 0 && states[i].time_s - states[i - 1].time_s > GAP_S;
    const seen = states.flatMap((s, i) => (gap(i) ? [{ time_s: states[i - 1].time_s + GAP_S / 2, extremes: {} }, s] : [s]));
    const x = seen.map((s) => s.time_s);
    const edge = (key, i) => seen.map((s) => s.extremes[key]?.[i] ?? null);
    const value = (key) => seen.map((s) => s[key] ?? null);
    const around = (k) => seen.map((s) => (s.predicted == null ? null : s.predicted + k * (s.predicted_sd ?? 0)));
    charts.forces.chart.setData([x, edge("lateral_force_n", 1), edge("lateral_force_n", 0), value("lateral_force_n"), edge("normal_force_n", 1), edge("normal_force_n", 0), value("normal_force_n")]);
    charts.mu.chart.setData([x, edge("mu_relative", 1), edge("mu_relative", 0), value("mu_relative"), around(2), around(-2), value("predicted")]);
    charts.late.chart.setData([x, seen.map((s) => (s.extremes.lateness_s == null ? null : s.extremes.lateness_s * 1e6))]);
    const s = states.at(-1);
    // Of a run that is over nothing is told of single cycles: its record has them.
    for (const one of ["forces", "mu", "late"]) figures[one].show(Boolean(s));
    for (const cell of ofTheLoop) cell.hidden = !s;
    if (!s) return;
    const span = (key, digits) => { const e = s.extremes[key]; return e ? `${e[0].toFixed(digits)} to ${e[1].toFixed(digits)}` : NONE; };
    figures.forces.say(`Line: lateral; dashes: normal (right). Bands: least and greatest of all cycles. Last 0.1 s: lateral ${span("lateral_force_n", 3)} N, normal ${span("normal_force_n", 3)} N.`);
    figures.mu.say(`Line: measured, with the least and the greatest of all cycles; dashes: predicted, with twice its standard uncertainty; what lies beyond the axis is a turn. Now ${fixed(s.mu_relative, 3)} and ${fixed(s.predicted, 3)}.`);
    figures.late.say(`How late the latest cycle of each 0.1 s began. Now ${fixed(s.extremes.lateness_s * 1e6, 0)} \u00b5s, over ${s.extremes.cycles} cycles.`);
    cells.phase.textContent = `${s.point === 4294967295 ? NONE : s.point}, ${s.phase}`;
    cells.mu.textContent = s.mu_relative == null ? NONE : `${fixed(s.mu_relative, 3)} \u00b1 ${fixed(s.mu_relative_sd, 3)}`;
    cells.predicted.textContent = s.predicted == null ? NONE : `${fixed(s.predicted, 3)} \u00b1 ${fixed(s.predicted_sd, 3)}`;
    cells.z.textContent = s.z == null ? NONE : `${signed(s.residual, 3)} (${signed(s.z, 1)} sd)`;
    cells.lateral.textContent = signed(s.lateral_force_n, 4, " N");
    cells.normal.textContent = fixed(s.normal_force_n, 4, " N");
    cells.w.textContent = fixed(s.amplitude_pp_m == null ? null : s.amplitude_pp_m * 1e6, 3, " \u00b5m");
    cells.f.textContent = fixed(s.frequency_hz == null ? null : s.frequency_hz / 1e3, 3, " kHz");
    cells.output.textContent = s.output_on == null ? "not read" : s.output_on ? "on" : "off";
    cells.temperature.textContent = fixed(s.temperature_c, 1, " \u00b0C");
    cells.late.textContent = fixed(Math.max(...states.slice(-10).map((one) => one.extremes.lateness_s)) * 1e6, 0, " \u00b5s");
  }

  function drawPasses() {
    const compared = picture.passes.filter((p) => p.comparison && p.comparison.mu_relative != null && p.pass.amplitude > 0);
    ofPasses(picture.passes.map(({ pass, comparison: c, psi_eq17 }) => ({
      point: pass.point, time_s: pass.time_s, w_um: pass.amplitude * 1e6, f_khz: pass.frequency_hz / 1e3, u_mm_s: pass.speed_m_s * 1e3, direction: pass.direction ?? 1,
      normal_n: pass.normal_force_n, lateral_n: pass.lateral_force_n, psi: psi_eq17, mu: c?.mu_relative, mu_sd: c?.mu_relative_sd, predicted: c?.predicted, predicted_sd: c?.predicted_sd, surprise: c?.z,
      mu0: pass.amplitude === 0 && pass.lateral_force_n != null ? (pass.direction ?? 1) * pass.lateral_force_n / pass.normal_force_n : null,
    })));
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
    over.hidden = !ended;
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
        // Nobody tells of it: it may be over.
        try { if (!(await (await fetched(`/api/runs/${part(name)}`)).json()).run.live) { route(); return; } } catch (why) { said.textContent = why.message; }
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
      // A run of which no pass is there yet has no entry: it is followed all the same.
      const found = await get(`/api/runs/${part(rest[0])}`);
      const described = found.ok ? await found.json() : null;
      if (!described && found.status !== 422) await fetched(`/api/runs/${part(rest[0])}`);
      leave = described && !described.run.live ? await finished(described) : runPage(rest[0], control, described?.run);
    } else if (page === "page") await written(rest[1], `/api/runs/${part(rest[0])}/pages/${part(rest[1])}`);
    else if (page === "compare") await comparison(rest);
    else await catalogue();
  } catch (why) {
    main.replaceChildren(el("h1", {}, "This cannot be shown"), el("p", { role: "alert" }, why.message), el("p", {}, el("a", { href: "#/" }, "All runs")));
  }
  main.focus();
}
// A link within a report is to a place on it, not to another page.
main.addEventListener("click", (event) => {
  const place = event.target.closest(".report a[href^='#']:not([href^='#/'])")?.getAttribute("href").slice(1);
  if (place == null) return;
  event.preventDefault();
  document.getElementById(place)?.scrollIntoView();
});
addEventListener("hashchange", route);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", route);
route();
