// The page of a run.

import { data } from "./page.js";
import { Pictures } from "./pictures.js";

const { run, fields } = data();
new Pictures(run).show(run, fields);
