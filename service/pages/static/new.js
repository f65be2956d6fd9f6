// The form of a new study: what it costs, and what is wrong in it, as one types.

import { element, encoded } from "./page.js";

const form = /** @type {HTMLFormElement} */ (document.querySelector("[data-study]"));
const REST = 450;
const copies = form.querySelectorAll(".code pre");
let asked = null;

const figure = form.querySelector("[data-scene-picture]");
const picture = element("img", { alt: figure.dataset.words });
const sheet = element("a", { target: "_blank", hidden: true, title: "open it alone" }, picture);
const OF = {
  now: "The first run before loading; a click enlarges it.", before: "The first run of the last study without a mistake.",
  wait: "The picture comes with the first study without a mistake.", none: "Of this scene there is no picture.",
};
let drawn = "";

document.querySelector("[data-scene]").addEventListener("change", (event) => /** @type {HTMLSelectElement} */ (event.target).form.submit());
for (const each of document.querySelectorAll("[data-check], [data-take]")) each.hidden = true;

function told(wrong) {
  const places = new Map([...form.querySelectorAll("[data-wrong]")].map((each) => [each.dataset.wrong, each]));
  const rest = [];
  for (const [name, place] of places) {
    place.textContent = wrong[name] ?? "";
    const input = place.parentElement.querySelector("input:not([type=checkbox])");
    if (name && input) input.toggleAttribute("aria-invalid", false);
    if (name && input && wrong[name]) input.setAttribute("aria-invalid", "true");
    if (wrong[name]) place.closest("details")?.setAttribute("open", "");
  }
  for (const [name, reason] of Object.entries(wrong)) if (!places.has(name)) rest.push(reason);
  if (rest.length) places.get("").textContent = rest.join("; ");
}

function costs(estimate) {
  const rows = Object.entries(estimate ?? { runs: "–" });
  form.querySelector("[data-estimate]").replaceChildren(...rows.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]));
}

// The picture depends on the parameters alone; one with a mistake is not asked for.
function draw(checked) {
  const fields = [...checked].filter(([name, value]) => name === "scene" || (name.startsWith("p.") && value));
  const address = `${figure.dataset.address}?${new URLSearchParams(fields)}`;
  if (drawn !== address) {
    picture.src = sheet.href = drawn = address;
    figure.classList.add("busy");
  } else if (!sheet.hidden) said("now");
}

function said(which) {
  figure.classList.remove("busy");
  figure.classList.toggle("before", which === "before");
  sheet.hidden = ["wait", "none"].includes(which);
  figure.querySelector("figcaption").textContent = OF[which];
}

figure.prepend(sheet);
picture.addEventListener("load", () => said("now"));
picture.addEventListener("error", () => said("none"));

async function check() {
  asked?.abort();
  asked = new AbortController();
  const sent = new FormData(form); // one may type on before the answer comes
  try {
    const answer = await fetch(form.action, {
      method: "POST", body: encoded(sent), headers: { accept: "application/json" }, signal: asked.signal,
    });
    if (!answer.ok || answer.redirected) {
      costs(null);
      told({ "": answer.redirected ? "sign in again" : `no estimate: ${answer.status} ${answer.statusText}` });
      return;
    }
    const found = await answer.json();
    told(found.wrong);
    costs(found.estimate);
    if (found.estimate) draw(sent);
    else said(sheet.hidden ? "wait" : "before");
    [found.toml, found.curl, found.python].forEach((each, k) => (copies[k].textContent = each));
  } catch (error) {
    if (error.name === "AbortError") return;
    costs(null);
    told({ "": "no estimate: the service cannot be reached" });
    throw error;
  }
}

function mark() {
  for (const field of form.querySelectorAll("[data-field]")) {
    const input = field.querySelector("input:not([type=checkbox])");
    const many = input ? /,\s*\S|\.\./.test(input.value) && !/^[[{]/.test(input.value) : field.querySelectorAll("input:checked").length > 1;
    field.classList.toggle("swept", many && field.dataset.field !== "name");
  }
}

const chooser = form.querySelector("select[name=choose]");
function choose() {
  for (const each of form.querySelectorAll("[data-table]")) each.hidden = each.dataset.table !== chooser.value;
}
chooser.addEventListener("change", choose);
choose();

let timer = 0;
form.addEventListener("input", () => {
  mark();
  clearTimeout(timer);
  timer = setTimeout(check, REST);
});
mark();
check();

const drop = document.querySelector("[data-drop]");
for (const name of ["dragover", "dragleave", "drop"]) {
  drop?.addEventListener(name, (event) => {
    event.preventDefault();
    drop.classList.toggle("over", name === "dragover");
  });
}
drop?.addEventListener("drop", ({ dataTransfer }) => {
  const post = /** @type {HTMLFormElement} */ (drop.querySelector("form"));
  const files = [...dataTransfer.files];
  for (const [input, own] of [[post.scene, true], [post.meshes, false]]) {
    const list = new DataTransfer();
    for (const each of files) if (each.name.endsWith(".toml") === own) list.items.add(each);
    input.files = list.files;
  }
  drop.open = true;
  if (post.reportValidity()) post.requestSubmit();
});
// Sent by the script, so that the files stay chosen if they are refused.
drop?.querySelector("form").addEventListener("submit", async (event) => {
  event.preventDefault();
  const post = /** @type {HTMLFormElement} */ (event.target);
  let said = null;
  let reason = "not taken: the service cannot be reached";
  try {
    const answer = await fetch(post.action, { method: "POST", body: new FormData(post) });
    if (answer.redirected && answer.ok) {
      location.assign(answer.url);
      return;
    }
    const failed = `${answer.status} ${answer.statusText}`;
    reason = answer.redirected ? `taken, but its form is not shown: ${failed}` : `not taken: ${failed}`;
    said = new DOMParser().parseFromString(await answer.text(), "text/html").querySelector("[data-drop] [role=alert]");
  } catch {
    // the reason is known
  }
  drop.querySelector("[role=alert]")?.remove();
  drop.append(said ?? element("p", { className: "wrong", role: "alert" }, reason));
});
