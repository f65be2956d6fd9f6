// Charts in the colours of the page, drawn by plotly.js.

import { rules } from "./page.js";

const scale = (colours) => colours.map((each, i) => [i / (colours.length - 1), each]);
export const SIGNED = scale(rules.signed);
export const SEQUENTIAL = scale(rules.sequential);
export const NUMBERS = scale(rules.numbers);

const own = () => getComputedStyle(document.documentElement);
export const colour = (name) => own().getPropertyValue(`--${name}`).trim();
export const KEYS = () => [1, 2, 3, 4, 5, 6].map((k) => colour(`k${k}`));

/** @type {Map<Chart, (chart: Chart) => { traces: object[], layout: object }>} */
const drawn = new Map();
const sizes = new ResizeObserver((changes) => {
  const changed = new Set(changes.map(({ target }) => target));
  for (const [chart, make] of drawn) if (changed.has(chart) && chart.data && chart.clientWidth) draw(chart, make);
});

function axis() {
  return {
    gridcolor: colour("grid"), zerolinecolor: colour("zero"), linecolor: colour("line"),
    tickcolor: colour("line"), ticks: "outside", ticklen: 4, automargin: true, exponentformat: "power",
    title: { standoff: 8, font: { size: 13 } },
  };
}

function merged(base, more) {
  const found = { ...base };
  for (const [key, value] of Object.entries(more)) {
    const both = value && base[key] && typeof value === "object" && !Array.isArray(value);
    found[key] = both ? merged(base[key], value) : value;
  }
  return found;
}

export async function draw(chart, make) {
  const again = drawn.has(chart);
  drawn.set(chart, make);
  if (!again) {
    chart.replaceChildren();
    sizes.observe(chart);
  }
  const { traces, layout } = make(chart);
  const base = {
    font: { family: own().getPropertyValue("--sans"), size: 12.5, color: colour("soft") },
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    margin: { l: 62, r: 16, t: 10, b: 48 }, xaxis: axis(), yaxis: axis(), showlegend: false,
    legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0, font: { size: 12 } },
    hoverlabel: { bgcolor: colour("card"), bordercolor: colour("line"), font: { family: own().getPropertyValue("--sans"), size: 13, color: colour("ink") }, align: "left" },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: colour("zero"), activecolor: colour("accent") },
    hovermode: "closest", dragmode: "zoom", separators: ".",
  };
  const buttons = [["toImage", "zoom2d", "pan2d", "resetScale2d"]];
  const size = { width: chart.clientWidth, height: chart.clientHeight };
  await Plotly.react(chart, traces, { ...merged(base, layout), ...size }, {
    displaylogo: false, modeBarButtons: buttons, displayModeBar: "hover",
  });
  chart.classList.remove("busy");
}

export function fail(chart, reason) {
  drawn.delete(chart);
  if (chart.data) Plotly.purge(chart);
  chart.classList.remove("busy");
  const said = document.createElement("p");
  said.className = "problem";
  said.textContent = reason;
  chart.replaceChildren(said);
}

export function bar(title) {
  return {
    thickness: 12, outlinewidth: 0, ticks: "outside", ticklen: 4, tickcolor: colour("line"),
    title: { text: title, side: "right", font: { size: 12.5 } }, len: 1, y: 0.5, x: 1.01,
  };
}

// The title of an axis, in lines that fit the chart.
export function titled(chart, words, unit) {
  const most = Math.max(16, Math.floor((chart.clientWidth - 90) / 6.8));
  const lines = [""];
  for (const word of named(words, unit).split(" ")) {
    const last = lines.length - 1;
    if (lines[last] && lines[last].length + word.length >= most) lines.push(word);
    else lines[last] += (lines[last] ? " " : "") + word;
  }
  return { text: lines.join("<br>") };
}

// The colour of a scale at a share of its length.
export function mixed(colours, share) {
  const at = share * (colours.length - 1), low = Math.min(Math.floor(at), colours.length - 2);
  const [a, b] = [colours[low][1], colours[low + 1][1]].map((each) => [1, 3, 5].map((i) => parseInt(each.slice(i, i + 2), 16)));
  return `rgb(${a.map((each, i) => Math.round(each + (b[i] - each) * (at - low))).join(",")})`;
}

// Colours in an order, such as those of rising loads; all stand out from the page.
export function ordered(count) {
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  const [first, last] = dark ? [0.33, 1] : [0, 0.82];
  return Array.from({ length: count }, (_, k) => mixed(NUMBERS, first + ((last - first) * k) / Math.max(count - 1, 1)));
}

// Charts take tags in a text, such as links: text of others stays text.
export const plain = (said) => String(said).replaceAll("&", "&amp;").replaceAll("<", "&lt;");

export const named = (words, unit) => plain(unit ? `${words} [${unit}]` : words);

// In the colours of a new scheme, and in the size of a sheet of paper.
const redraw = () => [...drawn].forEach(([chart, make]) => draw(chart, make));
for (const each of ["(prefers-color-scheme: dark)", "print"]) matchMedia(each).addEventListener("change", redraw);
