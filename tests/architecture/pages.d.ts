// What the type check of the pages' scripts knows besides the types of a browser.

/** plotly.js, which a page loads before its scripts. */
declare const Plotly: {
  react(chart: Element, traces: object[], layout: object, config: object): Promise<unknown>;
  purge(chart: Element): void;
};

/** An element of a page, with what some kinds have: a link, a button, a field, a section, a slider. */
type Found = HTMLElement & {
  href?: string;
  disabled?: boolean;
  value?: string;
  open?: boolean;
  set?(index: number): void;
};

/** A chart: plotly.js gives it the traces and the events. */
type Chart = Found & {
  data?: object[];
  on?(name: "plotly_click", act: (event: { points: { customdata: number | number[] }[] }) => void): void;
};

/** The pages have HTML only, no other elements. */
interface ParentNode {
  querySelector(selectors: string): Found | null;
  querySelectorAll(selectors: string): NodeListOf<Found>;
}

interface Element {
  closest(selectors: string): Found | null;
}
