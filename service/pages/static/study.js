// The page of a study: its parts hear of each other by what they tell; a study that runs is watched.

import "./chosen.js";
import "./parallel.js";
import { data, renew } from "./page.js";
import { address, forget, study, tell } from "./runs.js";
import "./sweep.js";
import "./table.js";

const REST = 1000;

function watch() {
  const source = new EventSource(`${address}/events`);
  let last = 0;
  source.addEventListener("study", async (event) => {
    const final = !["accepted", "running"].includes(JSON.parse(event.data).status);
    if (final) source.close();
    else if (Date.now() - last < REST) return;
    last = Date.now();
    const fresh = await renew(document.location, ["status", "progress", "found", "table"]);
    if (!fresh) return;
    const now = data(fresh);
    const begun = study.at === null && now.at !== null;
    if (begun && !document.querySelector("[data-picture]")) return document.location.reload();
    forget();
    Object.assign(study, { numbers: now.numbers, places: now.places, size: now.size, found: now.found, number: now.number }, final ? { live: false } : {}, begun ? { at: now.at } : {});
    tell(begun ? "chosen" : "runs");
  });
}

if (study.live) watch();
