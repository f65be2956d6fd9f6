// The list of studies and the queue: renewed while something is computed.

import { renew } from "./page.js";

const REST = 2000;

async function look() {
  if (!document.querySelector('[data-poll="yes"]')) return;
  if (!document.hidden) await renew().catch(() => null);
  setTimeout(look, REST);
}
setTimeout(look, REST);
