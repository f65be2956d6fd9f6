// A number over the runs of a study: cells, contours or lines over its axes, or marks over any two places.

import { colour, draw, fail, KEYS, named, ordered, plain } from "./charts.js";
import { choice, element, keep, rules, select, state, text, words } from "./page.js";
import { holes, hover, known, met, number, on, shades, statusOf, study, reason, tell, unit, value, raw, wordsAt } from "./runs.js";

const { axes, grid } = study;
const chart = /** @type {Chart} */ (document.querySelector('[data-chart="sweep"]'));
const spot = (name) => document.querySelector(`[data-controls="${name}"]`);
const strides = axes.map((_, k) => axes.slice(k + 1).reduce((size, { labels }) => size * labels.length, 1));
const several = axes.filter(({ labels }) => labels.length > 1);
const KINDS = { cells: "Cells", contours: "Contours", lines: "Lines", marks: "Marks" };
const GROUPS = { result: "Results", effort: "Effort", audit: "Audit" };
const MOST_MARKS = 2500;

const places = (run) => axes.map(({ labels }, k) => Math.floor(run / strides[k]) % labels.length);
const position = (place) => place.reduce((sum, index, k) => sum + index * strides[k], 0);
const axisOf = (name) => axes.findIndex((axis) => axis.name === name);
const said = (axis, index) => (axis.number ? text(axis.labels[index]) : words(axis.labels[index]));

function kinds() {
  const found = several.length > 1 ? ["cells", "lines"] : several.length ? ["lines"] : [];
  if (several.filter((axis) => axis.number).length > 1) found.splice(1, 0, "contours");
  return study.places.length > 1 || !grid ? [...found, "marks"] : found;
}

function kindNow(possible) {
  if (possible.includes(state.get("kind"))) return state.get("kind");
  const { y } = shownAxes();
  return !grid || !several.length ? "marks" : y?.number ? "cells" : "lines";
}

function shownAxes() {
  const numeric = several.filter((axis) => axis.number);
  const first = numeric.length ? numeric : several;
  const x = several.find(({ name }) => name === state.get("x")) ?? first[0];
  const rest = several.filter((axis) => axis !== x);
  const y = rest.find(({ name }) => name === state.get("y")) ?? rest.find((axis) => axis.number) ?? rest[0];
  return { x, y };
}

// Both places of the marks, what a search seeks up; without a second one the number itself is drawn up.
function markedPlaces() {
  const of = (name) => study.places.find((place) => place.name === name);
  const sorted = [...study.places].reverse().sort((a, b) => b.number - a.number); // the load comes last
  const x = of(state.get("x")) ?? sorted.findLast(({ name, number: a }) => study.sought && name !== study.sought && a) ?? sorted[0];
  const along = !axes.length && (!study.sought || study.places.length < 2); // a search goes along one place
  const number = (state.get("y") ?? (along ? "value" : "")) === "value";
  const y = number ? undefined : of(state.get("y")) ?? (x.name === study.sought ? undefined : of(study.sought)) ?? sorted.find((place) => place !== x && place.number);
  return { x, y: y === x ? undefined : y };
}

function held(x, y) {
  const now = study.at === null ? axes.map(() => 0) : places(study.at);
  return axes.map((axis, k) => {
    const given = axis.labels.findIndex((each) => String(each) === state.get(`at.${axis.name}`));
    return axis === x || axis === y ? 0 : given >= 0 ? given : now[k];
  });
}

let latest = null, frame = 0;

async function drawSweep() {
  const what = number(), possible = kinds();
  if (!what || !possible.length) {
    document.querySelector(".study .sweep").classList.add("bare");
    fail(chart, what ? "Nothing is swept: the study has one run." : study.live ? "The first numbers come with the first run." : "No run has a number.");
    return;
  }
  document.querySelector(".study .sweep").classList.remove("bare");
  const kind = kindNow(possible);
  const asked = (latest = Symbol(kind));
  const [values] = await known(what);
  const kept = kind === "marks" ? await met() : null;
  if (latest !== asked) return; // something else has been chosen meanwhile
  const shown = kind === "marks" ? marked(what, values.length, kept) : gridded();
  document.getElementById("sweep-title").textContent = what.words.charAt(0).toUpperCase() + what.words.slice(1);
  controls(what, kind, possible, shown);
  const range = state.get("span") === "shown" ? shown.runs.map((run) => value(run, what)) : Array.from(values, (_, run) => value(run, what));
  shown.shade = shades(what, range);
  await draw(chart, () => ({ cells, contours, lines, marks })[kind](what, shown));
  if (!chart.dataset.ready) {
    chart.on("plotly_click", ({ points: [{ customdata }] }) => {
      const run = Array.isArray(customdata) ? customdata[0] : customdata;
      if (run !== undefined) choose(run);
    });
    chart.dataset.ready = "yes";
  }
  note(what, shown);
}

function choose(run) {
  study.at = run;
  tell("chosen");
}

function gridded() {
  const { x, y } = shownAxes();
  const base = held(x, y), kx = axisOf(x.name), ky = y ? axisOf(y.name) : -1;
  const at = (i, j) => position(base.map((index, k) => (k === kx ? i : k === ky ? j : index)));
  const rows = Array.from({ length: y ? y.labels.length : 1 }, (_, j) => x.labels.map((_, i) => at(i, j)));
  const ticks = (axis) => (axis.number ? axis.labels : axis.labels.map((each) => plain(words(each))));
  const spotOf = (run) => [ticks(x)[places(run)[kx]], y && ticks(y)[places(run)[ky]]];
  return { x, y, rows, runs: rows.flat(), xs: ticks(x), ys: y && ticks(y), spotOf };
}

function marked(what, count, kept) {
  const { x, y } = markedPlaces();
  const at = (run, place) => (place.number ? raw(run, place) : plain(words(wordsAt(place.name)[raw(run, place)])));
  const every = Array.from({ length: count }, (_, run) => run).filter((run) => kept === null || kept.has(run));
  const runs = every.length > MOST_MARKS ? every.filter((run, k) => k % Math.ceil(every.length / MOST_MARKS) === 0 || run === study.at) : every;
  return { x, y, runs, of: every.length, spotOf: (run) => [at(run, x), y ? at(run, y) : value(run, what)] };
}

function note(what, { runs, of = runs.length }) {
  const count = new Map();
  for (const run of runs) if (Number.isNaN(value(run, what))) count.set(statusOf(run), (count.get(statusOf(run)) ?? 0) + 1);
  const listed = [...count].map(([each, times]) => `${times} ${reason(each)}`);
  const some = of > runs.length ? [`${runs.length} of ${of} runs are drawn: a filter of the table makes them fewer.`] : [];
  if (listed.length) some.push(`Of ${runs.length} runs shown, without a value: ${listed.join(", ")}.`);
  document.querySelector('[data-note="sweep"]').textContent = some.join(" ");
}

function axisLayout(axis, labels) {
  const title = { text: named(words(axis.name), axis.unit) };
  if (!axis.number) return { title, type: "category", showgrid: false };
  const few = labels && labels.length <= 12 && apart(labels);
  return { title, zeroline: false, showgrid: false, ...(few ? { tickvals: labels, ticktext: labels.map((each) => text(each)) } : {}) };
}

// Whether labels are far enough from each other for all of them to be written.
function apart(labels) {
  const sorted = [...labels].sort((a, b) => a - b), width = sorted.at(-1) - sorted[0];
  return sorted.every((each, k) => !k || each - sorted[k - 1] > width / 20);
}

function ring(shown, size, symbol = "square-open") {
  if (study.at === null || !shown.runs.includes(study.at)) return [];
  const [x, y] = shown.spotOf(study.at);
  return [["ink", size, 3], ["card", size + 3, 1.5]].map(([name, wide, line]) => ({
    type: "scatter", mode: "markers", x: [x], y: [y], hoverinfo: "skip", showlegend: false,
    marker: { symbol, size: wide, color: colour(name), line: { width: line, color: colour(name) } },
  }));
}

function filled(what, { rows, xs, ys, shade }) {
  return {
    x: xs, y: ys, z: rows.map((row) => row.map((run) => value(run, what))), zmin: shade.low, zmax: shade.high,
    colorscale: shade.colours, colorbar: shade.bar,
  };
}

function plane(shown, traces) {
  const layout = { xaxis: axisLayout(shown.x, shown.xs), yaxis: axisLayout(shown.y, shown.ys), showlegend: true, margin: { r: 84, t: 26 } };
  return { traces, layout };
}

function cells(what, shown) {
  const texts = shown.rows.map((row) => row.map((run) => hover(run, what)));
  const gap = shown.runs.length > 900 ? 0 : 1;
  return plane(shown, [{
    ...filled(what, shown), type: "heatmap", customdata: shown.rows, text: texts,
    hovertemplate: "%{text}<extra></extra>", hoverongaps: false, xgap: gap, ygap: gap,
  }, ...holes(shown.runs, what, shown.spotOf), ...ring(shown, 22)]);
}

function contours(what, shown) {
  const there = shown.runs.filter((run) => !Number.isNaN(value(run, what)));
  return plane(shown, [{
    ...filled(what, shown), type: "contour", hoverinfo: "skip", connectgaps: false, ncontours: 14,
    line: { width: 0.8, color: colour("card") }, contours: { showlabels: true, labelfont: { size: 11, color: "#ffffff" } },
  }, dots(what, there, shown, { size: 5, color: colour("card"), line: { width: 1, color: colour("ink") } }),
  ...holes(shown.runs, what, shown.spotOf), ...ring(shown, 16, "circle-open")]);
}

function dots(what, runs, { spotOf }, marker) {
  const at = runs.map(spotOf);
  return {
    type: "scatter", mode: "markers", x: at.map(([x]) => x), y: at.map(([, y]) => y),
    customdata: runs, text: runs.map((run) => hover(run, what)), hovertemplate: "%{text}<extra></extra>", showlegend: false, marker,
  };
}

function marks(what, shown) {
  const { x, y, shade } = shown;
  const there = shown.runs.filter((run) => !Number.isNaN(value(run, what)));
  const size = there.length > 400 ? 6 : 12;
  const lowest = there.reduce((low, run) => Math.min(low, value(run, what)), Infinity);
  const shading = y ? { color: there.map((run) => value(run, what)), cmin: shade.low, cmax: shade.high, colorscale: shade.colours, colorbar: shade.bar } : { color: colour("accent") };
  const where = y ? shown.spotOf : (run) => [shown.spotOf(run)[0], Number.isFinite(lowest) ? lowest : 0];
  return {
    traces: [dots(what, there, shown, { size, line: { width: 1, color: colour("card") }, ...shading }), ...holes(shown.runs, what, where), ...ring(shown, size + 8, "circle-open"), ...(y ? answers(x, y) : [])],
    layout: {
      xaxis: axisLayout(x), yaxis: y ? axisLayout(y) : { title: { text: named(what.words, what.unit) } }, showlegend: true, margin: { r: y ? 84 : 16, t: 26 },
      ...(y ? {} : limits(x)),
    },
  };
}

const certain = ({ name }, [value, low, high]) => `${words(name)} ${text(value)}${low === null ? "" : ` (${text(low)} – ${high === null ? "" : text(high)})`}`;

// What the study found, as marks with what is known of it; a curve where each place has one answer.
function answers(...places) {
  const there = study.found.filter((each) => places.every(({ name }) => name in each));
  if (!there.length) return [];
  const of = (place, k) => there.map((each) => each[place.name][k]);
  const axis = places.find((place) => place.number && of(place, 1).every((low) => low === null));
  const curve = axis && new Set(of(axis, 0)).size === there.length && there.length > 1;
  if (curve) there.sort((a, b) => a[axis.name][0] - b[axis.name][0]);
  const part = (place, side) => {
    const at = of(place, 0).map((each) => (place.number ? each : plain(words(each))));
    const ends = place.number ? [2, 1].map((k) => of(place, k).map((end, i) => (end === null ? 0 : Math.abs(end - at[i])))) : [];
    return { [side]: at, [`error_${side}`]: { visible: ends.flat().some(Boolean), type: "data", array: ends[0], arrayminus: ends[1], color: colour("k2"), thickness: 1.6, width: 5 } };
  };
  return [{
    ...part(places[0], "x"), ...part(places[1], "y"), type: "scatter", mode: curve ? "lines+markers" : "markers", name: "found", showlegend: true,
    text: there.map((each) => `<b>found</b><br>${places.map((place) => plain(certain(place, each[place.name]))).join("<br>")}`), hovertemplate: "%{text}<extra></extra>",
    line: { color: colour("k2"), width: 2 }, marker: { symbol: "diamond", size: 10, color: colour("k2"), line: { width: 1, color: colour("card") } },
  }];
}

// The same where the number is drawn up: a line across it, and a band.
function limits(x) {
  const there = study.found.map((each) => each[x.name]).filter((each) => each && each[1] !== null);
  const own = { yref: "paper", y0: 0, y1: 1, layer: "below" };
  return {
    shapes: there.flatMap(([value, low, high]) => [
      { ...own, type: "line", x0: value, x1: value, line: { color: colour("k2"), width: 1.6 } },
      ...(high === null ? [] : [{ ...own, type: "rect", x0: low, x1: high, fillcolor: colour("k2"), opacity: 0.18, line: { width: 0 } }]),
    ]),
    annotations: there.map(([value]) => ({ x: value, y: 1, yref: "paper", yanchor: "bottom", showarrow: false, text: `found ${text(value)}`, font: { color: colour("k2") } })),
  };
}

function lines(what, shown) {
  const { x, y, rows, xs } = shown;
  const some = rows.length > rules.most_lines ? rows.filter((_, j) => j % Math.ceil(rows.length / rules.most_lines) === 0) : rows;
  const keys = y?.number ? ordered(some.length) : KEYS();
  const traces = some.map((row, k) => ({
    type: "scatter", mode: x.number ? "lines+markers" : "markers", x: xs, y: row.map((run) => value(run, what)), customdata: row, text: row.map((run) => hover(run, what)),
    name: y ? plain(unit(said(y, rows.indexOf(row)), y)) : "", hovertemplate: "%{text}<extra></extra>", showlegend: Boolean(y),
    line: { color: keys[k % keys.length], width: 2, dash: k < keys.length ? "solid" : "dash" }, marker: { size: row.length > 60 ? 3 : 7 },
  }));
  const low = Math.min(0, ...shown.runs.map((run) => value(run, what)).filter((each) => !Number.isNaN(each)));
  const up = { ...shown, spotOf: (run) => [shown.spotOf(run)[0], value(run, what)] };
  return {
    traces: [...traces, ...holes(shown.runs, what, (run) => [shown.spotOf(run)[0], low]), ...ring(up, 16, "circle-open")],
    layout: {
      xaxis: axisLayout(x, x.labels), yaxis: { title: { text: named(what.words, what.unit) }, rangemode: "tozero" },
      showlegend: true, margin: { t: 26 }, legend: { title: { text: y ? `${words(y.name)}&nbsp;` : "" } },
    },
  };
}

function again(changes) {
  keep(changes);
  drawSweep();
}

function controls(what, kind, possible, { x, y }) {
  const numbers = study.numbers.map(({ name, words: own, group }) => ({ name, words: own.length > 60 ? words(name) : own, group: GROUPS[group] }));
  const parts = [select("Number", numbers, what.name, (name) => { keep({ number: name }); tell("number"); })];
  const options = (kind === "marks" ? study.places : several).map(({ name }) => ({ name, words: words(name) }));
  const swapped = (name) => again({ x: name, y: name === y?.name ? x.name : y?.name ?? "value" });
  if (options.length > 1) {
    const up = options.filter(({ name }) => name !== x.name);
    if (kind === "marks") up.push({ name: "value", words: "the number" });
    parts.push(select("across", options, x.name, swapped));
    parts.push(select(kind === "lines" ? "a line for each" : "up", up, y?.name ?? "value", (name) => again({ y: name })));
  }
  if (possible.length > 1) parts.push(choice("Kind", possible.map((name) => ({ name, words: KINDS[name] })), kind, (name) => again({ kind: name })));
  spot("sweep").replaceChildren(...parts);
  navigator(kind, x, y);
}

// What holds the axes that are not drawn. A slider that is moved stays where it is.
function navigator(kind, x, y) {
  const others = kind === "marks" ? [] : several.filter((axis) => axis !== x && axis !== y);
  const place = spot("others"), key = JSON.stringify([...others.map(({ name }) => name), state.get("span")]);
  const now = held(x, y);
  if (place.dataset.key === key) {
    for (const each of place.querySelectorAll("[data-axis]")) each.set(now[axisOf(each.dataset.axis)]);
    return;
  }
  place.dataset.key = key;
  const parts = others.map((axis) => holder(axis, now[axisOf(axis.name)]));
  if (parts.length && kind !== "lines") {
    const spans = [{ name: "all", words: "all runs" }, { name: "shown", words: "these" }];
    parts.push(element("label", {}, "colours of", choice("Colours of", spans, state.get("span") ?? "all", (name) => again({ span: name === "all" ? null : name }))));
  }
  place.replaceChildren(...parts);
}

function holder(axis, at) {
  const made = element("label", { className: "holder" }, words(axis.name));
  made.dataset.axis = axis.name;
  const hold = (index) => {
    keep({ [`at.${axis.name}`]: axis.labels[index] }, true);
    made.set(index);
    step();
  };
  if (!axis.number && axis.labels.length <= 4) {
    const options = axis.labels.map((each, i) => ({ name: i, words: words(each) }));
    made.set = (index) => made.replaceChildren(words(axis.name), choice(words(axis.name), options, index, hold));
  } else if (!axis.number) {
    const options = axis.labels.map((each, i) => ({ name: String(i), words: words(each) }));
    made.set = (index) => made.replaceChildren(select(words(axis.name), options, String(index), hold));
  } else {
    const output = element("output");
    const slider = element("input", { type: "range", min: 0, max: axis.labels.length - 1, step: 1, ariaLabel: words(axis.name), oninput: () => hold(Number(slider.value)) });
    made.append(slider, output);
    made.set = (index) => {
      if (Number(slider.value) !== index) slider.value = index;
      output.textContent = unit(said(axis, index), axis);
      slider.setAttribute("aria-valuetext", output.textContent);
    };
  }
  made.set(at);
  return made;
}

function step() {
  cancelAnimationFrame(frame);
  frame = requestAnimationFrame(drawSweep);
}

chart.addEventListener("keydown", (event) => {
  const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  if (!(event.key in moves) || study.at === null) return;
  event.preventDefault();
  const [dx, dy] = moves[event.key];
  let next = study.at + dx + dy;
  if (kindNow(kinds()) !== "marks") {
    const { x, y } = shownAxes();
    const place = places(study.at);
    for (const [axis, by] of [[x, dx], [y, dy]]) {
      const k = axis ? axisOf(axis.name) : -1;
      if (axis) place[k] = Math.min(Math.max(place[k] + by, 0), axis.labels.length - 1);
    }
    next = position(place);
  }
  next = Math.min(Math.max(next, 0), study.size - 1);
  if (next !== study.at) choose(next);
});

const redraw = () => drawSweep().catch((error) => fail(chart, error.message));
for (const what of ["number", "chosen", "runs"]) on(what, redraw);
on("filter", () => kindNow(kinds()) === "marks" && redraw());
redraw();
