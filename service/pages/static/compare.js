// Runs compared: lines over each other, and the difference of two maps.

import { fail } from "./charts.js";
import { choice, data, json, keep, octets, root, rows, select, state, words } from "./page.js";
import { combinations, drawLines, drawMap, valuesOf } from "./pictures.js";

const { runs } = data();
const NAMES = "ABCDEF";
const charts = Object.fromEntries([...document.querySelectorAll("[data-chart]")].map((each) => [each.dataset.chart, each]));
const spot = (name) => document.querySelector(`[data-controls="${name}"]`);

async function start() {
  const fields = await Promise.all(runs.map((run) => json(`${root}/runs/${run}/fields`)));
  const common = (kind) => fields[0][kind].filter(({ name }) => fields.every((each) => each[kind].some((other) => other.name === name)));
  await Promise.all([showLine(common("lines")), showDifference(common("maps"))]);
}

async function showLine(known) {
  if (!known.length) return fail(charts.line, "These runs have no line in common.");
  const field = known.find(({ name }) => name === state.get("line")) ?? known.find(({ usual }) => usual.includes("depth")) ?? known[0];
  const components = field.components ?? [];
  const component = components.includes(state.get("line.component")) ? state.get("line.component") : components[0];
  const again = (changes) => { keep(changes); showLine(known); };
  const found = await Promise.all(runs.map((run) => octets(valuesOf(run, { field: field.name, component }))));
  const labels = combinations(found[0].head.over);
  const label = labels.includes(state.get("line.at")) ? state.get("line.at") : labels[largest(found)];
  const over = found[0].head.over.filter((each) => each.labels.length > 1).map(({ name }) => words(name)).join(", ");
  spot("line").replaceChildren(
    select("Line", known, field.name, (name) => again({ line: name })),
    ...(components.length ? [choice("Component", components.map((name) => ({ name, words: name })), component, (name) => again({ "line.component": name }))] : []),
    ...(labels.length > 1 ? [select(over, labels.map((name) => ({ name, words: name })), label, (name) => again({ "line.at": name }))] : []),
  );
  await drawLines(charts.line, found, runs.map((_, k) => NAMES[k]), label);
}

// The line that goes farthest from zero.
function largest(found) {
  const reach = found.map(({ head, arrays }) => rows(arrays[head.name]).map((line) => line.reduce((most, each) => Math.max(most, Math.abs(each) || 0), 0)));
  const most = reach[0].map((_, k) => Math.max(...reach.map((each) => each[k] ?? 0)));
  return most.indexOf(Math.max(...most));
}

async function showDifference(known) {
  if (!known.length) return fail(charts.difference, "These runs have no map in common.");
  const field = known.find(({ name }) => name === state.get("map")) ?? known[0];
  const components = field.components ?? [];
  const component = components.includes(state.get("map.component")) ? state.get("map.component") : components[0];
  const pair = [state.get("first") ?? "0", state.get("second") ?? "1"].map(Number);
  const letters = runs.map((_, k) => ({ name: String(k), words: NAMES[k] }));
  const again = (changes) => { keep(changes); showDifference(known); };
  spot("difference").replaceChildren(
    select("Map", known, field.name, (name) => again({ map: name })),
    ...(components.length ? [choice("Component", components.map((name) => ({ name, words: name })), component, (name) => again({ "map.component": name }))] : []),
    select("run", letters, String(pair[0]), (name) => again({ first: name })),
    select("minus", letters, String(pair[1]), (name) => again({ second: name })),
  );
  try {
    const found = await octets(valuesOf(runs[pair[0]], { field: field.name, component, minus: runs[pair[1]] }));
    await drawMap(charts.difference, found, found.head.high);
  } catch (error) {
    fail(charts.difference, error.message);
  }
}

if (runs.length > 1) start().catch((error) => fail(charts.line, error.message));
