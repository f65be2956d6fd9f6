// The table of runs: its links and its form change the table alone, and what is drawn of its runs.

import { encoded, keep, renew, state } from "./page.js";
import { study, tell } from "./runs.js";

export async function filter(changes) {
  keep({ page: null, ...changes });
  tell("filter");
  await renew(document.location, ["table"]);
}

function turn(where) {
  const wanted = new URL(where, document.location.href);
  const own = (/** @type {[string, string]} */ [name]) => name === "sort" || name === "page" || name.startsWith("where.");
  const before = [...state].filter(own).map(([name]) => [name, null]);
  return filter(Object.fromEntries([...before, ...[...wanted.searchParams].filter(own)]));
}

document.addEventListener("click", (event) => {
  const link = /** @type {Element} */ (event.target).closest("a");
  if (!link || event.ctrlKey || event.metaKey || event.shiftKey) return;
  if (link.dataset.choose) {
    event.preventDefault();
    study.at = Number(link.dataset.choose);
    tell("chosen");
    document.getElementById("sweep-title").scrollIntoView({ block: "start", behavior: "smooth" });
  } else if (link.hasAttribute("data-turn") || link.closest("#table .pager") || link.closest(".counts")) {
    event.preventDefault();
    turn(link.href);
    if (link.closest(".counts")) document.getElementById("table").scrollIntoView({ behavior: "smooth" });
  }
});

document.addEventListener("submit", (event) => {
  const form = /** @type {HTMLFormElement} */ (event.target);
  if (!form.matches("[data-filters]")) return;
  event.preventDefault();
  turn(`?${encoded(new FormData(form))}`);
});
