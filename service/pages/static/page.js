// What all pages share: where the resources are, the state in the address, parts that are renewed.

const found = document.location.pathname.match(/^(.*)\/ui(?:\/|$)/);
export const root = found ? found[1] : "";

export const rules = JSON.parse(document.getElementById("rules").textContent); // see studies/views/rules.py

export const data = (page = document) => JSON.parse(page.getElementById("data").textContent);

export const state = new Map(new URLSearchParams(document.location.search));

// Browsers bear few changes of the address: those of a slider are written when it rests.
let waiting = 0;
export function keep(changes, later = false) {
  for (const [name, value] of Object.entries(changes)) {
    const none = value === null || value === undefined || value === "";
    if (none) state.delete(name);
    else state.set(name, String(value));
    written.set(name, none ? null : String(value));
  }
  clearTimeout(waiting);
  if (later) waiting = setTimeout(write, 150);
  else write();
}

const written = new Map(); // other names may be there more than once
function write() {
  const address = new URL(document.location.href);
  for (const [name, value] of written) value === null ? address.searchParams.delete(name) : address.searchParams.set(name, value);
  written.clear();
  history.replaceState(null, "", address);
}

// What a form without files sends.
export const encoded = (/** @type {FormData} */ sent) => new URLSearchParams([...sent].map(([name, value]) => [name, String(value)]));

// Replace the parts of this page that the service has changed, by the same page read anew.
export async function renew(address, only) {
  const answer = await fetch(address ?? document.location, { headers: { accept: "text/html" } });
  if (!answer.ok || answer.redirected) return null;
  const fresh = new DOMParser().parseFromString(await answer.text(), "text/html");
  for (const part of document.querySelectorAll("[data-live]")) {
    if (only && !only.includes(part.dataset.live)) continue;
    const other = fresh.querySelector(`[data-live="${part.dataset.live}"]`);
    if (other && other.innerHTML !== part.innerHTML) part.replaceWith(document.importNode(other, true));
  }
  return fresh;
}

export function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key in made && key !== "list") made[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...children.filter((each) => each !== null));
  return made;
}

export function select(label, options, value, chosen) {
  const made = element("select", { onchange: () => chosen(made.value) });
  const groups = new Map();
  for (const { name, words, group } of options) {
    const option = element("option", { value: name, selected: name === value }, words);
    if (!group) made.append(option);
    else {
      if (!groups.has(group)) groups.set(group, made.appendChild(element("optgroup", { label: group })));
      groups.get(group).append(option);
    }
  }
  return element("label", {}, label, made);
}

export function choice(label, options, value, chosen) {
  const made = element("span", { className: "choice", role: "group" });
  made.setAttribute("aria-label", label);
  for (const { name, words } of options) {
    const button = element("button", { type: "button", onclick: () => chosen(name) }, words);
    button.setAttribute("aria-pressed", String(name === value));
    made.append(button);
  }
  return made;
}

export const words = (name) => String(name).replace(/^(peak_\w+)_([sxyz])$/, "$2 of $1").replaceAll("_", " ");

// Four digits, as `number_text` of studies/numbers.py has them.
export function text(value) {
  if (typeof value !== "number") return words(value);
  if (Number.isNaN(value)) return "–";
  const size = Math.abs(value);
  if (value !== 0 && (size < 1e-4 || size >= 1e6)) return value.toExponential(3).replace(/\.?0+e/, "e").replace(/(?<=e.)(?=\d$)/, "0").replaceAll("-", "−");
  return String(size < 1e4 ? Number(value.toPrecision(4)) : Math.round(value)).replace("-", "−");
}

for (const button of document.querySelectorAll("[data-copy]")) {
  button.hidden = !navigator.clipboard;
  button.addEventListener("click", async () => {
    await navigator.clipboard.writeText(button.closest(".code").querySelector("pre").textContent);
    button.textContent = "Copied";
    setTimeout(() => (button.textContent = "Copy"), 1500);
  });
}


// What the service sends as octets: a line of JSON, then arrays, little endian.

export async function octets(address, signal) {
  const answer = await fetch(address, { signal });
  if (!answer.ok) throw new Error(await reason(answer));
  const content = await answer.arrayBuffer();
  const end = new Uint8Array(content).indexOf(10);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(content, 0, end)));
  const arrays = {};
  let at = end + 1;
  for (const { name, type, shape } of head.arrays) {
    const length = shape.reduce((a, b) => a * b, 1);
    const Kind = type === "<f8" ? Float64Array : Float32Array;
    arrays[name] = { shape, values: new Kind(content, at, length) };
    at += length * Kind.BYTES_PER_ELEMENT;
  }
  return { head, arrays };
}

export async function json(address, signal) {
  const answer = await fetch(address, { signal });
  if (!answer.ok) throw new Error(await reason(answer));
  return answer.json();
}

async function reason(answer) {
  try {
    return (await answer.json()).detail;
  } catch {
    return `${answer.status} ${answer.statusText}`;
  }
}

// Rows of an array of two dimensions, without copies.
export function rows({ shape, values }) {
  const width = shape[shape.length - 1];
  return Array.from({ length: values.length / width }, (_, i) => values.subarray(i * width, (i + 1) * width));
}
