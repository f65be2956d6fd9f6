// All runs as lines over parallel axes; a range drawn on an axis is a condition of the table.

import { colour, mixed } from "./charts.js";
import { element, state, text, words } from "./page.js";
import { column, known, met, number, on, raw, shades, study, tell, told, value, wordsAt } from "./runs.js";
import { filter } from "./table.js";

const TOP = 74, BOTTOM = 16, SIDE = 66, NEAR = 14, WIDE = 10, MOST = 9, NARROW = 96, SHADES = 24, MOVED = 4, END = 0.03;
const canvas = /** @type {HTMLCanvasElement} */ (document.querySelector("[data-parallel]"));
const tip = document.querySelector("[data-tip]");
const section = canvas.closest("section");
const pen = canvas.getContext("2d");
const picture = document.createElement("canvas");
let axes = [], lines = [], paints = [], brush = null, what = null;

async function draw() {
  what = number();
  section.hidden = !what || study.size < 3;
  if (section.hidden) return;
  const rest = study.numbers.filter((each) => each !== what && each.group === "result" && each.varies);
  const numbers = [...rest.slice(0, Math.max(1, MOST - 1 - study.places.length)), what];
  await known(...numbers);
  const kept = await met();
  axes = [...study.places, ...numbers].map(scaled).filter(Boolean);
  const runs = Array.from(column(what.name), (_, run) => run);
  const { low, high, colours } = shades(what, runs.map((run) => value(run, what)));
  paints = Array.from({ length: SHADES }, (_, k) => mixed(colours, (k + 0.5) / SHADES));
  lines = runs.map((run) => {
    const share = (value(run, what) - low) / (high - low || 1);
    const paint = Number.isNaN(share) ? "none" : Math.min(Math.floor(share * SHADES), SHADES - 1);
    const there = kept === null || kept.has(run);
    return { run, there, paint: there ? paint : "off", shares: axes.map((axis) => axis.share(raw(run, axis))) };
  });
  canvas.setAttribute("aria-label", `${lines.length} runs as lines over ${axes.map(({ name }) => words(name)).join(", ")}`);
  section.classList.add("drawn");
  paint();
}

// A column with the share of the height at which a value is; null if no run has a value.
function scaled(own) {
  const labels = wordsAt(own.name);
  let low = Infinity, high = -Infinity;
  for (const each of labels ? labels.keys() : column(own.name)) if (!Number.isNaN(each)) [low, high] = [Math.min(low, each), Math.max(high, each)];
  if (low > high) return null;
  const share = (at) => (high === low ? 0.5 : (at - low) / (high - low));
  return { ...own, labels, low, high, share, at: (up) => low + up * (high - low) };
}

const size = () => [Math.max(canvas.parentElement.clientWidth - 2, 2 * SIDE + (axes.length - 1) * NARROW), 330];
const across = (k) => SIDE + (k * (size()[0] - 2 * SIDE)) / Math.max(axes.length - 1, 1);
const up = (share) => size()[1] - BOTTOM - share * (size()[1] - TOP - BOTTOM);

function paint() {
  const [width, height] = size(), dense = window.devicePixelRatio || 1;
  for (const each of [canvas, picture]) [each.width, each.height] = [width * dense, height * dense];
  Object.assign(canvas.style, { width: `${width}px`, height: `${height}px` });
  const at = picture.getContext("2d");
  at.scale(dense, dense);
  /** @type {Map<string | number, object[]>} */
  const groups = new Map();
  for (const key of ["off", "none", ...paints.keys()]) groups.set(key, []);
  for (const line of lines) groups.get(line.paint).push(line);
  const thin = lines.length > 300;
  for (const [key, group] of groups) {
    at.globalAlpha = key === "off" ? 0.35 : thin ? 0.5 : 0.9;
    at.strokeStyle = key === "off" ? colour("line") : key === "none" ? colour("zero") : paints[key];
    at.lineWidth = thin ? 0.8 : 1.6;
    at.setLineDash(key === "none" ? [4, 4] : []);
    at.beginPath();
    for (const line of group) trace(at, line);
    at.stroke();
  }
  axesDrawn(at);
  show(null);
}

function trace(at, { shares }) {
  let drawing = false;
  shares.forEach((share, k) => {
    if (Number.isNaN(share)) drawing = false;
    else if (drawing) at.lineTo(across(k), up(share));
    else {
      at.moveTo(across(k), up(share));
      drawing = true;
    }
  });
}

function axesDrawn(at) {
  Object.assign(at, { globalAlpha: 1, lineWidth: 1, font: `12px ${getComputedStyle(document.body).fontFamily}` });
  at.setLineDash([]);
  axes.forEach((axis, k) => {
    const x = across(k);
    at.strokeStyle = colour("zero");
    at.beginPath();
    at.moveTo(x, up(0));
    at.lineTo(x, up(1));
    at.stroke();
    at.textAlign = "center";
    at.fillStyle = axis.name === what.name ? colour("ink") : colour("soft");
    const title = [...wrapped(words(axis.name)), ...(axis.unit ? [`[${axis.unit}]`] : [])];
    title.forEach((line, i) => at.fillText(line, x, TOP - 14 - 15 * (title.length - 1 - i)));
    at.textAlign = "left";
    at.fillStyle = colour("ink");
    for (const [share, said] of ticks(axis)) {
      const wide = at.measureText(said).width, beyond = x + 6 + wide > size()[0];
      const from = beyond ? x - 6 - wide : x + 6; // a long word stays on the canvas
      at.fillStyle = colour("card");
      at.globalAlpha = 0.9;
      at.fillRect(from - 1, up(share) - 8, wide + 3, 15);
      at.globalAlpha = 1;
      at.fillStyle = colour("ink");
      at.fillText(said, from, up(share) + 4);
    }
    for (const [from, to] of brushed(axis)) {
      at.fillStyle = colour("accent");
      at.globalAlpha = 0.3;
      at.fillRect(x - WIDE / 2, up(to), WIDE, up(from) - up(to));
      at.globalAlpha = 1;
    }
  });
}

function wrapped(said) {
  const found = [""];
  for (const word of said.split(" ")) {
    if (found.at(-1) && `${found.at(-1)} ${word}`.length > 15) found.push(word);
    else found.push([found.pop(), word].filter(Boolean).join(" "));
  }
  return found.slice(0, 3);
}

function ticks(axis) {
  if (axis.labels) return axis.labels.length <= 12 ? axis.labels.map((each, k) => [axis.share(k), words(each)]) : [];
  const flags = Object.entries(axis.flags ?? {}).filter(([code]) => code >= axis.low && code <= axis.high);
  if (flags.length) return flags.map(([code, word]) => [axis.share(Number(code)), words(word)]);
  const own = study.axes.find(({ name }) => name === axis.name)?.labels ?? [];
  const values = own.length && own.length <= 9 ? own : round(axis);
  return values.map((each) => [axis.share(each), text(each)]);
}

// Three to six round numbers between the ends of an axis.
function round({ low, high }) {
  if (low === high) return [low];
  const rough = (high - low) / 5, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((each) => each * power).find((each) => each >= rough);
  const first = Math.ceil(low / step - 1e-9), count = Math.floor(high / step + 1e-9) - first + 1;
  return Array.from({ length: count }, (_, k) => Number(((first + k) * step).toPrecision(6)));
}

// The parts of an axis that its condition in the address keeps.
function brushed(axis) {
  const said = state.get(`where.${axis.name}`);
  if (!said) return [];
  const range = said.match(/^(.*?)\.\.(.*)$/);
  if (range && !axis.labels) return [[range[1] ? axis.share(Number(range[1])) : 0, range[2] ? axis.share(Number(range[2])) : 1].map((each) => Math.min(Math.max(each, 0), 1))];
  const values = said.split(",").map((each) => (axis.labels ? axis.labels.indexOf(each.trim()) : Number(each)));
  return values.filter((each) => each >= 0).map((each) => [axis.share(each) - 0.02, axis.share(each) + 0.02]);
}

function show(line) {
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.drawImage(picture, 0, 0);
  const dense = window.devicePixelRatio || 1;
  pen.scale(dense, dense);
  const chosen = lines[study.at];
  for (const [each, name, wide] of [[chosen, "ink", 2.4], [line, "accent", 3]]) {
    if (!each) continue;
    Object.assign(pen, { strokeStyle: colour(name), lineWidth: wide });
    pen.beginPath();
    trace(pen, each);
    pen.stroke();
  }
  if (brush) {
    pen.fillStyle = colour("accent");
    pen.globalAlpha = 0.45;
    const [from, to] = [up(brush.from), up(brush.to)];
    pen.fillRect(across(brush.axis) - WIDE / 2, Math.min(from, to), WIDE, Math.abs(from - to));
    pen.globalAlpha = 1;
  }
}

function place(event) {
  const box = canvas.getBoundingClientRect(), x = event.clientX - box.x, y = event.clientY - box.y;
  const [, height] = size();
  const axis = axes.findIndex((_, k) => Math.abs(across(k) - x) < NEAR);
  const share = Math.min(Math.max((height - BOTTOM - y) / (height - TOP - BOTTOM), 0), 1);
  return { x, y, axis, share };
}

function nearest({ x, y }) {
  const width = across(1) - across(0), k = Math.min(Math.max(Math.floor((x - SIDE) / width), 0), axes.length - 2);
  const part = (x - across(k)) / width;
  let found = null, least = 8;
  for (const line of lines) {
    if (!line.there) continue;
    const [a, b] = [line.shares[k], line.shares[k + 1] ?? line.shares[k]];
    const away = Math.abs(up(a + part * (b - a)) - y);
    if (away < least) [found, least] = [line, away];
  }
  return found;
}

function hint(line, { x, y }) {
  tip.hidden = !line;
  if (!line) return;
  const [first, ...rest] = told(line.run, what);
  tip.replaceChildren(element("b", {}, first), ...rest.map((each) => element("span", {}, each)));
  const left = x - canvas.parentElement.scrollLeft;
  Object.assign(tip.style, { left: `${left > canvas.parentElement.clientWidth / 2 ? left - tip.offsetWidth - 14 : left + 14}px`, top: `${y + canvas.offsetTop - 10}px` });
}

canvas.addEventListener("pointerdown", (event) => {
  const at = place(event);
  if (at.axis < 0) return;
  canvas.setPointerCapture(event.pointerId);
  brush = { axis: at.axis, from: at.share, to: at.share, y: at.y };
  hint(null, at);
});
canvas.addEventListener("pointermove", (event) => {
  const at = place(event);
  if (brush) {
    brush.to = at.share;
    show(null);
    return;
  }
  canvas.style.cursor = at.axis >= 0 ? "row-resize" : "default";
  const line = at.axis < 0 ? nearest(at) : null;
  show(line);
  hint(line, at);
});
canvas.addEventListener("pointercancel", () => { // the finger moves the page
  brush = null;
  show(null);
});
canvas.addEventListener("pointerleave", (event) => {
  show(null);
  hint(null, place(event));
});
canvas.addEventListener("pointerup", (event) => {
  const at = place(event);
  if (!brush) {
    const line = nearest(at);
    if (line) {
      study.at = line.run;
      tell("chosen");
    }
    return;
  }
  const axis = axes[brush.axis], [from, to] = [brush.from, brush.to].map(snapped).sort((a, b) => a - b);
  const moved = Math.abs(at.y - brush.y) > MOVED;
  brush = null;
  filter({ [`where.${axis.name}`]: moved ? condition(axis, from, to) : null });
});

const snapped = (share) => (share < END ? 0 : share > 1 - END ? 1 : share);

// What keeps the runs between two shares of an axis: its ends are exact, the rest are parts of its length.
function condition(axis, from, to) {
  const { low: least, high: most } = axis, [low, high] = [from, to].map(axis.at);
  const words = axis.labels ?? (Object.keys(axis.flags ?? {}).length ? axis.flags : null);
  if (words) return Object.entries(words).filter(([code]) => Number(code) > low - 0.3 && Number(code) < high + 0.3).map(([, word]) => word).join(",") || null;
  const step = 10 ** Math.floor(Math.log10((most - least) / 1000));
  const said = (share, at) => (least === most || share === 0 ? least : share === 1 ? most : Number((Math.round(at / step) * step).toPrecision(12)));
  return `${said(from, low)}..${said(to, high)}`;
}

// Drawn when it comes into view, and again when what it shows has changed.
let seen = false;
section.hidden = study.size < 3;
new IntersectionObserver(([{ isIntersecting }]) => {
  if (!isIntersecting || seen) return;
  seen = true;
  draw();
}, { rootMargin: "200px" }).observe(section);
new ResizeObserver(() => axes.length && paint()).observe(canvas.parentElement);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => axes.length && paint());
for (const each of ["number", "filter", "runs"]) on(each, () => seen && draw());
on("chosen", () => axes.length && show(null));
