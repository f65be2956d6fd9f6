// The pictures of a run: a map, depth profiles, contact pressure, any other line.

import { bar, colour, draw, fail, KEYS, named, plain, SEQUENTIAL, SIGNED, titled } from "./charts.js";
import { choice, element, json, keep, octets, root, rows, select, state, text, words } from "./page.js";

const MOST_LINES = 8;
const GREEK = "σ";
const DASHES = ["solid", "dash", "dot", "dashdot"];
const PARTS = ["map", "depth", "contact", "history", "line"];

const query = (given) => new URLSearchParams(Object.entries(given).filter(([, value]) => value)).toString();

export const valuesOf = (run, given) => `${root}/runs/${run}/values?${query(given)}`;

export class Pictures {
  constructor(run) {
    this.stop = new AbortController();
    this.run = run;
    this.high = null;
    this.asked = {};
    this.shown = {};
  }

  async show(run, fields = null) {
    this.stop.abort();
    this.stop = new AbortController();
    this.run = run;
    const { signal } = this.stop;
    try {
      this.fields = fields ?? (await json(`${root}/runs/${run}/fields`, signal));
    } catch (error) {
      if (!signal.aborted) this.#each((chart) => fail(chart, error.message));
      return;
    }
    const empty = !this.fields.maps.length && !this.fields.lines.length;
    for (const each of document.querySelectorAll("[data-picture]")) each.hidden = empty;
    if (!empty) await Promise.all(PARTS.map((part) => this.#part(part)));
  }

  #each(act) {
    for (const chart of document.querySelectorAll("[data-chart]")) {
      if (PARTS.includes(chart.dataset.chart)) act(chart);
    }
  }

  async #part(part) {
    const chart = document.querySelector(`[data-chart="${part}"]`);
    if (!chart) return;
    const known = part === "map" ? this.fields.maps : this.fields.lines.filter(({ pictures }) => pictures.includes(part));
    chart.closest("figure").hidden = !known.length;
    if (!known.length) return;
    const others = part === "line" ? PARTS.slice(0, -1).map((each) => this.shown[each]) : []; // no picture twice
    const free = known.filter(({ name }) => !others.includes(name));
    const field = known.find((each) => each.name === state.get(part)) ?? free.find(({ usual }) => usual?.includes(part)) ?? free[0] ?? known[0];
    this.shown[part] = field.name;
    const components = field.components ?? [];
    const component = components.includes(state.get(`${part}.component`)) ? state.get(`${part}.component`) : components[0];
    const stages = (part === "map" && field.stages) || [];
    const stage = stages.includes(state.get(`${part}.stage`)) ? state.get(`${part}.stage`) : stages.at(-1);
    this.#controls(part, known, field, components, component, stages, stage);
    const title = document.querySelector(`[data-title="${part}"]`);
    title.textContent = field.words.charAt(0).toUpperCase() + field.words.slice(1);
    if (component) title.append(` ${GREEK}`, element("sub", {}, component));
    const { signal } = this.stop;
    const asked = (this.asked[part] = valuesOf(this.run, { field: field.name, component, stage }));
    chart.classList.add("busy");
    try {
      const found = await octets(asked, signal);
      if (this.asked[part] !== asked) return; // something else has been chosen meanwhile
      await (part === "map" ? this.#map(chart, found) : drawLines(chart, [found]));
    } catch (error) {
      if (!signal.aborted && this.asked[part] === asked) fail(chart, error.message);
    }
  }

  #controls(part, known, field, components, component, stages, stage) {
    const again = (changes) => {
      keep(changes);
      this.#part(part);
    };
    const options = known.map(({ name, words: said }) => ({ name, words: said }));
    const parts = [select(element("span", { className: "hidden" }, "Quantity"), options, field.name, (name) => again({ [part]: name }))];
    if (components.length) {
      parts.push(choice("Component", components.map((each) => ({ name: each, words: each })), component, (name) => again({ [`${part}.component`]: name })));
    }
    if (stages.length > 1) {
      parts.push(choice("Stage", stages.map((each) => ({ name: each, words: words(each) })), stage, (name) => again({ [`${part}.stage`]: name })));
    }
    if (part === "map") {
      const scales = [{ name: "", words: "of each run" }, { name: "shared", words: "shared" }];
      const now = state.has("scale") ? "shared" : "";
      parts.push(element("label", { title: "shared: other runs are drawn with the colours of this one" }, "colours", choice("Colours", scales, now, (name) => again({ scale: name && this.high?.toPrecision(6) }))));
    }
    document.querySelector(`[data-controls="${part}"]`).replaceChildren(...parts);
  }

  async #map(chart, found) {
    this.high = Number(state.get("scale")) || found.head.high;
    await drawMap(chart, found, this.high);
    const note = document.querySelector('[data-note="map"]');
    if (note) note.textContent = state.has("scale") ? `Colours end at ${text(this.high)} ${found.head.unit}, of all runs.` : found.head.note;
  }
}

export function drawMap(chart, { head, arrays }, high) {
  const { across, up, name, unit } = head;
  const x = arrays[across.name].values, y = arrays[up.name].values, z = rows(arrays[name]);
  const margin = { l: 62, r: 74, t: 10, b: 48 };
  const side = (values) => Math.abs(values[values.length - 1] - values[0]) || 1;
  const tall = () => { // the map fills the width, or the height: its colour bar is as tall as the map
    const [wide, most] = [chart.clientWidth - margin.l - margin.r, chart.clientHeight - margin.t - margin.b];
    return Math.min(most, (wide * side(y)) / side(x));
  };
  return draw(chart, () => ({
    traces: [{
      type: "heatmap", zsmooth: head.smooth && "best", x, y, z, zmin: head.signed ? -high : 0, zmax: high, hoverongaps: false,
      colorscale: head.signed ? SIGNED : SEQUENTIAL, colorbar: { ...bar(named(unit ? "" : head.words, unit).trim()), lenmode: "pixels", len: tall() + 20 },
      hovertemplate: `${across.name} %{x:.4~g} ${plain(across.unit)}, ${up.name} %{y:.4~g} ${plain(up.unit)}<br><b>%{z:.4~g} ${plain(unit)}</b><extra></extra>`,
    }, ...(head.edge ? [{
      type: "scatter", mode: "markers", x: [-head.edge, head.edge], y: [0, 0], cliponaxis: false,
      marker: { symbol: "triangle-down", size: 10, color: colour("ink"), line: { width: 1, color: colour("card") } },
      hovertemplate: `edge of contact under load<br>${across.name} %{x:.4~g} ${plain(across.unit)}<extra></extra>`,
    }] : [])],
    layout: {
      xaxis: { title: { text: named(across.words, across.unit) }, zeroline: false, showgrid: false, constrain: "domain" },
      yaxis: { title: { text: named(up.words, up.unit) }, zeroline: false, showgrid: false, scaleanchor: "x", constrain: "domain" },
      margin,
    },
  }));
}

// Lines of one run, or of several: each run then has its colour, else each label.
export function drawLines(chart, found, names = [], label = null) {
  const { head } = found[0];
  const { along, over } = head;
  const counted = along.whole && found[0].arrays[along.name].values.at(-1) <= 10;
  return draw(chart, () => {
    const traces = [];
    const keys = KEYS();
    found.forEach(({ head: own, arrays }, run) => {
      const at = arrays[own.along.name];
      const xs = rows(at);
      const all = rows(arrays[own.name]);
      const labels = combinations(own.over);
      const few = all.length > MOST_LINES ? spread(all.length, MOST_LINES) : all.map((_, i) => i);
      const shown = names.length ? [Math.max(labels.indexOf(label), 0)] : few;
      shown.forEach((i, k) => {
        const name = plain(names.length ? names[run] : labels[i] ?? "");
        traces.push({
          type: "scatter", mode: "lines", x: xs.length === all.length ? xs[i] : xs[0], y: all[i], name,
          line: { color: keys[(names.length ? run : k) % keys.length], width: 2, dash: DASHES[names.length ? 0 : Math.floor(k / keys.length)] },
          hovertemplate: `${name ? `${name}<br>` : ""}${plain(along.words)} %{x:.4~g} ${plain(along.unit)}<br><b>%{y:.4~g} ${plain(own.unit)}</b><extra></extra>`,
        });
      });
    });
    return {
      traces,
      layout: {
        xaxis: { title: titled(chart, along.words, along.unit), zeroline: false, showgrid: false, ...(counted && { dtick: 1 }) },
        yaxis: { title: { text: head.unit ? named("", head.unit).trim() : "" }, rangemode: constant(traces) ? "tozero" : "normal" },
        showlegend: traces.length > 1,
        legend: { title: { text: names.length ? "" : over.filter(({ labels }) => labels.length > 1).map(({ name }) => words(name)).join(", ") + "&nbsp;" } },
      },
    };
  });
}

// Whether all values are one: the axis would then reach from one below it to one above it.
function constant(traces) {
  let low = Infinity, high = -Infinity;
  for (const { y } of traces) for (const each of y) if (Number.isFinite(each)) { low = Math.min(low, each); high = Math.max(high, each); }
  return high - low <= 1e-9 * Math.max(Math.abs(low), Math.abs(high));
}

export function combinations(over) {
  let found = [""];
  for (const { labels, unit } of over) {
    const own = labels.length ? labels : [""];
    found = found.flatMap((before) => own.map((label) => {
      const said = own.length === 1 ? "" : `${text(label)}${unit ? ` ${unit}` : ""}`;
      return [before, said].filter(Boolean).join(", ");
    }));
  }
  return found;
}

function spread(count, most) {
  return Array.from({ length: most }, (_, k) => Math.round((k * (count - 1)) / (most - 1)));
}
