// The chosen run of a study: where it is, its main numbers, its pictures, and the list to compare.

import { element, json, keep, root, state, words } from "./page.js";
import { Pictures } from "./pictures.js";
import { address, columnsOf, known, label, number, on, study } from "./runs.js";

const COMPARED = "residua-compared";
const MOST_COMPARED = 6;
const pictures = new Pictures(study.run);

async function choose() {
  const { at } = study;
  const { runs: [run] } = await json(`${address}?limit=1&offset=${at}`);
  if (study.at !== at) return; // another run has been chosen meanwhile
  const held = [...state.keys()].filter((name) => name.startsWith("at."));
  const pending = run.status === "pending";
  keep({ run: pending ? null : run.id, ...Object.fromEntries(held.map((name) => [name, null])) });
  study.run = run.id;
  await columnsOf(study.places.map(({ name }) => name));
  const list = element("dl", { className: "place" }, ...study.places.map((place) => {
    const title = element("dt", {}, words(place.name), place.unit ? element("span", { className: "unit" }, ` ${place.unit}`) : "");
    return element("div", {}, title, element("dd", {}, label(at, place)));
  }));
  const parts = [list];
  if (run.status !== "ok" || run.message) {
    const said = pending ? "This run has not been computed yet." : run.message;
    parts.push(element("p", { className: "message" }, element("span", { className: `status ${run.status}` }, words(run.status)), ` ${said}`));
  }
  document.querySelector("[data-run-head]").replaceChildren(...parts);
  const open = document.querySelector("[data-run-link]");
  if (open) {
    open.hidden = pending;
    open.href = `${root}/ui/runs/${run.id}`;
  }
  for (const row of document.querySelectorAll("tr[data-at]")) row.classList.toggle("chosen", Number(row.dataset.at) === at);
  figures();
  compareButtons();
  if (pending) for (const each of document.querySelectorAll("[data-picture]")) each.hidden = true;
  else await pictures.show(run.id);
}

async function figures() {
  const main = number(), { at } = study;
  if (!main || at === null) return;
  const shown = [main, ...study.numbers.filter((each) => each !== main && each.group === "result" && each.varies).slice(0, 3)];
  await known(...shown);
  if (study.at !== at) return;
  document.querySelector("[data-run-figures]").replaceChildren(...shown.map((each, k) => {
    const said = label(at, each);
    const unit = each.unit && said !== "–" ? element("span", { className: "unit" }, ` ${each.unit}`) : "";
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

on("chosen", choose);
for (const each of ["number", "runs"]) on(each, figures);

figures();
compareButtons();
if (study.run) pictures.show(study.run);
