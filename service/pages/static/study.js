// The page of a study: a number over the sweep, the chosen run, the table.

import { octets, json } from "./octets.js";
import { bar, colour, draw, fail, KEYS, named, NUMBERS, ordered, plain, SIGNED } from "./charts.js";
import { choice, data, element, keep, renew, root, select, state, text, words } from "./page.js";
import { Pictures } from "./pictures.js";

const study = data();
const axes = study.axes;
const address = `${root}/studies/${study.id}`;
const chart = document.querySelector('[data-chart="sweep"]');
const strides = axes.map((_, k) => axes.slice(k + 1).reduce((size, { labels }) => size * labels.length, 1));
const several = axes.filter(({ labels }) => labels.length > 1);
const MARKS = {
  limit_load: ["square-open", "no equilibrium"], outside_theory: ["triangle-up-open", "outside small-strain theory"],
  not_converged: ["x", "not converged"], audit_failed: ["x", "audit failed"], error: ["x", "error"], pending: ["circle-open", "not computed yet"],
  ok: ["circle-open-dot", "no value"],
};
const COMPARED = "residua-compared";
const MOST_COMPARED = 6;
const pictures = new Pictures(study.run);
let statuses = [];
let columns = new Map();
let chosen = study.at;

const places = (at) => axes.map(({ labels }, k) => Math.floor(at / strides[k]) % labels.length);
const position = (place) => place.reduce((sum, index, k) => sum + index * strides[k], 0);
const number = () => study.numbers.find(({ name }) => name === state.get("number")) ?? study.numbers[0];
const axisOf = (name) => axes.findIndex((axis) => axis.name === name);
const label = (axis, index) => (axis.number ? text(axis.labels[index]) : words(axis.labels[index]));

function shownAxes() {
  const numeric = several.filter((axis) => axis.number);
  const first = numeric.length ? numeric : several;
  const x = several.find(({ name }) => name === state.get("x")) ?? first[0];
  const rest = several.filter((axis) => axis !== x);
  const y = rest.find(({ name }) => name === state.get("y")) ?? rest.find((axis) => axis.number) ?? rest[0];
  return { x, y, kind: state.get("kind") ?? (y && y.number ? "cells" : "lines") };
}

function held(x, y) {
  const now = chosen === null ? axes.map(() => 0) : places(chosen);
  return axes.map((axis, k) => {
    const given = axis.labels.findIndex((each) => String(each) === state.get(`at.${axis.name}`));
    return axis === x || axis === y ? 0 : given >= 0 ? given : now[k];
  });
}

async function columnsOf(names) {
  const known = columns; // a change of the study begins anew: an answer under way is of before
  const missing = names.filter((name) => !known.has(name));
  if (missing.length) {
    const asked = new URLSearchParams(missing.map((name) => ["name", name]));
    const { head, arrays } = await octets(`${address}/numbers?${asked}`);
    statuses = head.statuses;
    for (const name of missing) known.set(name, arrays[name].values);
  }
  return names.map((name) => known.get(name));
}

async function drawSweep() {
  const what = number();
  if (!what || !several.length) {
    fail(chart, what ? study.size > 1 ? "A search has no grid of runs: the table has them." : "Nothing is swept: the study has one run." : "No run has a number yet.");
    return;
  }
  const [values, codes] = await columnsOf([what.name, "status"]);
  const { x, y, kind } = shownAxes();
  controls(what, x, y, kind);
  const base = held(x, y);
  const kx = axisOf(x.name), ky = y ? axisOf(y.name) : -1;
  const at = (i, j) => {
    const place = [...base];
    place[kx] = i;
    if (y) place[ky] = j;
    return position(place);
  };
  const flagged = Object.keys(what.flags).length > 0;
  const value = (run) => (statuses[codes[run]] === "ok" ? values[run] : NaN);
  const told = (run) => {
    const place = places(run);
    const lines = axes.filter(({ labels }) => labels.length > 1).map((axis) => {
      const k = axisOf(axis.name);
      return plain(`${words(axis.name)} ${label(axis, place[k])}${axis.unit ? ` ${axis.unit}` : ""}`);
    });
    const found = value(run);
    const said = Number.isNaN(found) ? (MARKS[statuses[codes[run]]] ?? ["", words(statuses[codes[run]])])[1]
      : flagged ? words(what.flags[found]) : `${text(found)}${what.unit ? ` ${what.unit}` : ""}`;
    return `<b>${plain(said)}</b><br>${lines.join("<br>")}`;
  };
  const xs = x.number ? x.labels : x.labels.map((each) => plain(words(each)));
  const count = y ? y.labels.length : 1;
  const grid = Array.from({ length: count }, (_, j) => xs.map((_, i) => at(i, j)));
  const draws = kind === "cells" && y ? cells : lines;
  await draw(chart, () => draws({ what, x, y, xs, grid, value, told, codes, flagged }));
  if (!chart.dataset.ready) {
    chart.on("plotly_click", ({ points }) => points[0].customdata !== undefined && choose(runAt(points[0])));
    chart.dataset.ready = "yes";
  }
  const holes = grid.flat().filter((run) => Number.isNaN(value(run)));
  note(holes.map((run) => statuses[codes[run]]), grid.flat().length);
}

const runAt = ({ customdata }) => (Array.isArray(customdata) ? customdata[0] : customdata);

function note(reasons, size) {
  const count = new Map();
  for (const each of reasons) count.set(each, (count.get(each) ?? 0) + 1);
  const listed = [...count].map(([each, times]) => `${times} ${(MARKS[each] ?? ["", words(each)])[1]}`);
  document.querySelector('[data-note="sweep"]').textContent = listed.length ? `Of ${size} runs shown, without a value: ${listed.join(", ")}.` : "";
}

function axisLayout(axis, labels) {
  const title = { text: named(words(axis.name), axis.unit) };
  const few = labels.length <= 12;
  return axis.number ? { title, zeroline: false, showgrid: false, ...(few ? { tickvals: labels, ticktext: labels.map((each) => text(each)) } : {}) } : { title, type: "category", showgrid: false };
}

function marks({ x, y, xs, grid, value, codes, told }, height) {
  const found = new Map();
  grid.forEach((row, j) => row.forEach((run, i) => {
    if (!Number.isNaN(value(run))) return;
    const status = statuses[codes[run]];
    if (!found.has(status)) found.set(status, { x: [], y: [], customdata: [], text: [] });
    const each = found.get(status);
    each.x.push(xs[i]);
    each.y.push(height(j));
    each.customdata.push(run);
    each.text.push(told(run));
  }));
  return [...found].map(([status, each]) => ({
    ...each, type: "scatter", mode: "markers", name: (MARKS[status] ?? ["x", words(status)])[1], showlegend: true,
    marker: { symbol: (MARKS[status] ?? ["x"])[0], size: 9, color: colour("soft"), line: { width: 1.6, color: colour("soft") } },
    hovertemplate: "%{text}<extra></extra>",
  }));
}

function cells(shown) {
  const { what, x, y, xs, grid, value, told, flagged } = shown;
  const ys = y.number ? y.labels : y.labels.map((each) => plain(words(each)));
  const all = grid.flat().map(value).filter((each) => !Number.isNaN(each));
  const low = Math.min(...all), high = Math.max(...all), signed = low < 0 && high > 0;
  const most = Math.max(-low, high);
  const codes = Object.keys(what.flags).map(Number);
  const place = chosen === null ? null : places(chosen);
  const here = place && grid.some((row) => row.includes(chosen));
  const mark = here ? [{
    type: "scatter", mode: "markers", x: [xs[place[axisOf(x.name)]]], y: [ys[place[axisOf(y.name)]]], hoverinfo: "skip", showlegend: false,
    marker: { symbol: "square-open", size: 22, color: colour("ink"), line: { width: 3, color: colour("ink") } },
  }, {
    type: "scatter", mode: "markers", x: [xs[place[axisOf(x.name)]]], y: [ys[place[axisOf(y.name)]]], hoverinfo: "skip", showlegend: false,
    marker: { symbol: "square-open", size: 25, color: colour("card"), line: { width: 1.5, color: colour("card") } },
  }] : [];
  const range = flagged ? [Math.min(...codes) - 0.5, Math.max(...codes) + 0.5] : signed ? [-most, most] : [low, high];
  return {
    traces: [{
      type: "heatmap", x: xs, y: ys, z: grid.map((row) => row.map(value)), customdata: grid, text: grid.map((row) => row.map(told)),
      hovertemplate: "%{text}<extra></extra>", hoverongaps: false, xgap: 1, ygap: 1, zmin: range[0], zmax: range[1],
      colorscale: signed && !flagged ? SIGNED : NUMBERS,
      colorbar: flagged ? { ...bar(""), tickvals: codes, ticktext: codes.map((each) => words(what.flags[each])) } : bar(plain(what.unit)),
    }, ...marks(shown, (j) => ys[j]), ...mark],
    layout: { xaxis: axisLayout(x, x.labels), yaxis: axisLayout(y, y.labels), showlegend: true, margin: { r: 84, t: 26 } },
  };
}

function lines(shown) {
  const { what, x, y, xs, grid, value, told } = shown;
  const some = grid.length > 12 ? grid.filter((_, j) => j % Math.ceil(grid.length / 12) === 0) : grid;
  const keys = y?.number ? ordered(some.length) : KEYS();
  const traces = some.map((row, k) => ({
    type: "scatter", mode: "lines+markers", x: xs, y: row.map(value), customdata: row, text: row.map(told),
    name: y ? plain(label(y, grid.indexOf(row))) : "", hovertemplate: "%{text}<extra></extra>", showlegend: Boolean(y),
    line: { color: keys[k % keys.length], width: 2, dash: k < keys.length ? "solid" : "dash" }, marker: { size: row.length > 60 ? 3 : 7 },
  }));
  const known = grid.flat().map(value).filter((each) => !Number.isNaN(each));
  const low = Math.min(...known, 0);
  const place = chosen !== null && grid.flat().includes(chosen) ? places(chosen) : null;
  const ring = place && !Number.isNaN(value(chosen)) ? [{
    type: "scatter", mode: "markers", x: [xs[place[axisOf(x.name)]]], y: [value(chosen)], hoverinfo: "skip", showlegend: false,
    marker: { symbol: "circle-open", size: 16, color: colour("ink"), line: { width: 2.5, color: colour("ink") } },
  }] : [];
  return {
    traces: [...traces, ...marks(shown, () => low), ...ring],
    layout: {
      xaxis: axisLayout(x, x.labels), yaxis: { title: { text: named(what.words, what.unit) }, rangemode: "tozero" },
      showlegend: true, margin: { t: 26 }, legend: { title: { text: y ? `${words(y.name)}&nbsp;` : "" } },
    },
  };
}

function controls(what, x, y, kind) {
  const again = (changes) => {
    keep(changes);
    drawSweep();
  };
  const groups = { result: "Results", effort: "Effort", audit: "Audit" };
  const numbers = study.numbers.map(({ name, words: said, group }) => ({ name, words: said.length > 60 ? words(name) : said, group: groups[group] }));
  const options = several.map(({ name }) => ({ name, words: words(name) }));
  const parts = [select("Number", numbers, what.name, (name) => { again({ number: name }); if (chosen !== null) figures(); })];
  if (several.length > 1) {
    parts.push(select("across", options, x.name, (name) => again({ x: name, y: name === y.name ? x.name : y.name })));
    parts.push(select(kind === "cells" ? "up" : "a line for each", options.filter(({ name }) => name !== x.name), y.name, (name) => again({ y: name })));
    parts.push(choice("Kind", [{ name: "cells", words: "Cells" }, { name: "lines", words: "Lines" }], kind, (name) => again({ kind: name })));
  }
  document.querySelector('[data-controls="sweep"]').replaceChildren(...parts);
  const others = several.filter((axis) => axis !== x && axis !== y);
  const place = held(x, y);
  document.querySelector('[data-controls="others"]').replaceChildren(...others.map((axis) => {
    const k = axisOf(axis.name);
    const set = (index) => again({ [`at.${axis.name}`]: axis.labels[index] });
    if (!axis.number) {
      return element("label", {}, words(axis.name), choice(words(axis.name), axis.labels.map((each, i) => ({ name: i, words: words(each) })), place[k], set));
    }
    const said = element("output", {}, `${label(axis, place[k])} ${axis.unit}`);
    const slider = element("input", { type: "range", min: 0, max: axis.labels.length - 1, step: 1 });
    slider.value = place[k];
    slider.setAttribute("aria-label", words(axis.name));
    slider.addEventListener("input", () => {
      said.textContent = `${label(axis, slider.value)} ${axis.unit}`;
      keep({ [`at.${axis.name}`]: axis.labels[slider.value] });
      step();
    });
    return element("label", {}, words(axis.name), slider, said);
  }));
}

// A step of a slider draws anew, and leaves the slider that is being moved where it is.
function step() {
  cancelAnimationFrame(step.asked);
  step.asked = requestAnimationFrame(async () => {
    const active = document.activeElement;
    const name = active?.getAttribute?.("aria-label");
    await drawSweep();
    if (name && !active.isConnected) document.querySelector(`input[aria-label="${CSS.escape(name)}"]`)?.focus();
  });
}

async function choose(at) {
  chosen = at;
  const found = await json(`${address}?limit=1&offset=${at}`);
  if (chosen !== at) return; // another run has been chosen meanwhile
  const run = found.runs[0];
  keep({ run: run.status === "pending" ? null : run.id });
  const place = document.querySelector("[data-run-head]");
  const shown = several.length ? several : Object.keys(run.at).map((name) => ({ name, unit: "" }));
  const list = element("dl", { className: "place" }, ...shown.map((axis) => {
    const title = element("dt", {}, words(axis.name), axis.unit ? element("span", { className: "unit" }, ` ${axis.unit}`) : "");
    const said = several.length ? label(axis, places(at)[axisOf(axis.name)]) : text(run.at[axis.name]);
    return element("div", {}, title, element("dd", {}, said));
  }));
  const parts = [list];
  if (run.status !== "ok" || run.message) {
    const said = run.status === "pending" ? "This run has not been computed yet." : run.message;
    parts.push(element("p", { className: "message" }, element("span", { className: `status ${run.status}` }, words(run.status)), ` ${said}`));
  }
  place.replaceChildren(...parts);
  const open = document.querySelector("[data-run-link]");
  if (open) {
    open.hidden = run.status === "pending";
    open.href = `${root}/ui/runs/${run.id}`;
  }
  study.run = run.id;
  for (const row of document.querySelectorAll("tr[data-at]")) row.classList.toggle("chosen", Number(row.dataset.at) === at);
  drawSweep();
  figures();
  compareButtons();
  if (run.status !== "pending") await pictures.show(run.id);
}

async function figures() {
  const main = number();
  const place = document.querySelector("[data-run-figures]");
  if (!main || chosen === null) return;
  const shown = [main, ...study.numbers.filter((each) => each !== main && each.group === "result" && each.varies).slice(0, 3)];
  const values = await columnsOf(shown.map(({ name }) => name));
  place.replaceChildren(...shown.map((each, k) => {
    const value = values[k][chosen];
    const said = each.flags[value] ? words(each.flags[value]) : text(value);
    const unit = each.unit && !Number.isNaN(value) ? element("span", { className: "unit" }, ` ${each.unit}`) : "";
    return element("div", { className: k ? "" : "main" }, element("dt", {}, k ? words(each.name) : each.words), element("dd", {}, said, unit));
  }));
}

const compared = () => JSON.parse(sessionStorage.getItem(COMPARED) ?? "[]");

function compareButtons() {
  const add = document.querySelector("[data-compare]"), go = document.querySelector("[data-comparison]");
  const list = compared();
  add.hidden = study.run === null;
  const there = list.includes(study.run);
  add.textContent = there ? "Remove from comparison" : "Add to comparison";
  add.disabled = !there && list.length >= MOST_COMPARED;
  go.hidden = list.length < 2;
  go.textContent = `Compare ${list.length}`;
  go.href = `${root}/ui/compare?${new URLSearchParams(list.map((each) => ["run", each]))}`;
}

document.querySelector("[data-compare]").addEventListener("click", () => {
  const list = compared();
  const rest = list.filter((each) => each !== study.run);
  sessionStorage.setItem(COMPARED, JSON.stringify(rest.length < list.length ? rest : [...list, study.run]));
  compareButtons();
});

chart.addEventListener("keydown", (event) => {
  const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  if (!(event.key in moves) || chosen === null || !several.length) return;
  event.preventDefault();
  const { x, y } = shownAxes();
  const [dx, dy] = moves[event.key];
  const place = places(chosen);
  for (const [axis, by] of [[x, dx], [y, dy]]) {
    if (!axis) continue;
    const k = axisOf(axis.name);
    place[k] = Math.min(Math.max(place[k] + by, 0), axis.labels.length - 1);
  }
  if (position(place) !== chosen) choose(position(place));
});

// Links and the form of the table change the table alone.
async function turn(where) {
  const wanted = new URL(where, document.location);
  const own = ([name]) => name === "sort" || name === "page" || name.startsWith("where.");
  const before = [...state].filter(own).map(([name]) => [name, null]);
  keep(Object.fromEntries([...before, ...[...wanted.searchParams].filter(own)]));
  await renew(document.location, ["table"]);
}

document.addEventListener("click", (event) => {
  const link = event.target.closest("a");
  if (!link || event.ctrlKey || event.metaKey || event.shiftKey) return;
  if (link.dataset.choose) {
    event.preventDefault();
    choose(Number(link.dataset.choose));
    document.getElementById("sweep-title").scrollIntoView({ block: "start", behavior: "smooth" });
  } else if (link.hasAttribute("data-turn") || link.closest("#table .pager") || link.closest(".counts")) {
    event.preventDefault();
    turn(link.href);
    if (link.closest(".counts")) document.getElementById("table").scrollIntoView({ behavior: "smooth" });
  }
});

document.addEventListener("submit", (event) => {
  if (!event.target.matches("[data-filters]")) return;
  event.preventDefault();
  turn(`?${new URLSearchParams(new FormData(event.target))}`);
});

function watch() {
  const source = new EventSource(`${address}/events`);
  let last = 0;
  source.addEventListener("study", async (event) => {
    const now = JSON.parse(event.data);
    const final = !["accepted", "running"].includes(now.status);
    if (final) source.close();
    else if (Date.now() - last < 1000) return;
    last = Date.now();
    columns = new Map();
    const fresh = await renew(document.location, ["status", "progress", "table"]);
    if (fresh) study.numbers = JSON.parse(fresh.getElementById("data").textContent).numbers;
    const begun = chosen === null && fresh ? JSON.parse(fresh.getElementById("data").textContent).at : null;
    if (begun !== null) {
      if (!document.querySelector("[data-picture]")) document.location.reload();
      else choose(begun);
    } else drawSweep().then(figures);
  });
}

drawSweep().catch((error) => fail(chart, error.message));
figures();
compareButtons();
if (study.run) pictures.show(study.run);
if (study.live) watch();
