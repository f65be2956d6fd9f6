// The runs of a study: a column each for places, numbers and statuses, asked for once.

import { colour, NUMBERS, plain, SIGNED, bar } from "./charts.js";
import { data, octets, root, rules, state, text, words } from "./page.js";

export const study = data();
export const address = `${root}/studies/${study.id}`;
export const STATUS = "status";
const SYMBOLS = {
  limit_load: "square-open", outside_theory: "triangle-up-open", not_converged: "x-thin-open", audit_failed: "cross-thin-open",
  error: "diamond-open", pending: "circle-open", ok: "circle-open-dot",
};
const heard = new EventTarget();
export const tell = (what) => heard.dispatchEvent(new Event(what));
export const on = (what, act) => heard.addEventListener(what, act);

let columns = new Map();
let before = new Map(); // until the new ones have come
let texts = {};
export function forget() {
  before = new Map([...before, ...columns]);
  columns = new Map();
}

export async function columnsOf(names) {
  const known = columns; // a change of the study begins anew: an answer under way is of before
  const missing = names.filter((name) => !known.has(name));
  if (missing.length) {
    const asked = new URLSearchParams(missing.map((name) => ["name", name]));
    const { head, arrays } = await octets(`${address}/numbers?${asked}`);
    texts = { ...texts, ...head.words };
    for (const name of missing) known.set(name, arrays[name].values);
  }
  return names.map((name) => known.get(name));
}

// Everything that is said of a run beside one number.
export const known = (...numbers) => columnsOf([...numbers.map(({ name }) => name), STATUS, ...study.places.map(({ name }) => name)]);

// The runs that meet the conditions in the address; null if there are none.
export async function met() {
  const where = [...state].filter(([name]) => name.startsWith("where."));
  if (!where.length) return null;
  const asked = new URLSearchParams([["name", STATUS], ...where.map(([name, value]) => [name.slice(6), value])]);
  const { arrays } = await octets(`${address}/numbers?${asked}`);
  return new Set(arrays.at.values);
}

export const number = () => [state.get("number"), study.number].map((each) => study.numbers.find(({ name }) => name === each)).find(Boolean) ?? study.numbers[0];
export const column = (name) => columns.get(name) ?? before.get(name);
export const statusOf = (run) => texts[STATUS][column(STATUS)[run]];
export const value = (run, { name }) => (statusOf(run) === "ok" ? column(name)[run] : NaN);
export const raw = (run, { name }) => column(name)[run];
export const wordsAt = (name) => texts[name];
export const unit = (said, { unit: its }) => (its ? `${said} ${its}` : said);
export const reason = (status) => rules.reasons[status] ?? words(status);

export function label(run, place) {
  const found = raw(run, place);
  if (!place.number) return words(texts[place.name][found]);
  return place.flags?.[found] ? words(place.flags[found]) : text(found);
}

export function told(run, what) {
  const found = value(run, what);
  const first = Number.isNaN(found) ? reason(statusOf(run)) : unit(label(run, what), what);
  return [first, ...study.places.map((place) => `${words(place.name)} ${unit(label(run, place), place)}`)];
}

export function hover(run, what) {
  const [first, ...rest] = told(run, what).map(plain);
  return `<b>${first}</b><br>${rest.join("<br>")}`;
}

// Colours of a number, from its values; flags have one colour each.
export function shades(what, values) {
  const codes = Object.keys(what.flags).map(Number);
  if (codes.length) {
    const ticks = { tickvals: codes, ticktext: codes.map((each) => words(what.flags[each])) };
    return { low: Math.min(...codes) - 0.5, high: Math.max(...codes) + 0.5, colours: NUMBERS, bar: { ...bar(""), ...ticks } };
  }
  let low = Infinity, high = -Infinity;
  for (const each of values) if (!Number.isNaN(each)) [low, high] = [Math.min(low, each), Math.max(high, each)];
  const signed = low < 0 && high > 0 && Math.min(-low, high) > 0.05 * Math.max(-low, high);
  const most = Math.max(-low, high);
  return { low: signed ? -most : low, high: signed ? most : high, colours: signed ? SIGNED : NUMBERS, bar: bar(plain(what.unit)) };
}

// Marks of the runs without a value, one trace for each reason.
export function holes(runs, what, spot) {
  const found = new Map();
  for (const run of runs) {
    if (!Number.isNaN(value(run, what))) continue;
    const status = statusOf(run);
    if (!found.has(status)) found.set(status, { x: [], y: [], customdata: [], text: [] });
    const each = found.get(status), [x, y] = spot(run);
    each.x.push(x);
    each.y.push(y);
    each.customdata.push(run);
    each.text.push(hover(run, what));
  }
  return [...found].map(([status, each]) => ({
    ...each, type: "scatter", mode: "markers", name: reason(status), showlegend: true, hovertemplate: "%{text}<extra></extra>",
    marker: { symbol: SYMBOLS[status] ?? "x", size: 9, color: colour("soft"), line: { width: 1.6, color: colour("soft") } },
  }));
}
