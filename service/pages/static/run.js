// The page of a run.

import { data } from "./page.js";
import { Pictures } from "./pictures.js";

const { run } = data();
new Pictures(run).show(run);
