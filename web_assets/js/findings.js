// What experiments found: a summary with all verdicts, then each with the paper's claim beside what was seen.
// Used by the report (experiments/report_document.py) and by the studio's pages; looks are in report.css.

import { drawChart, figures, make } from "./findings_charts.js";

const SIGNS = { reproduced: "✓", better: "▲", "not reproduced": "✕", answered: "●", failed: "!" };
const FOLDED_ROWS = 14;
const WIDE_COLUMNS = 9;

let disposals = new WeakMap();

/** Fill `element` with the findings of `experiments` (documents of results.json, in their order). */
export function drawFindings(element, experiments, echarts) {
  for (const dispose of disposals.get(element) ?? []) dispose();
  const charts = [];
  element.classList.add("findings");
  const body = experiments.length
    ? [summary(experiments), ...experiments.map((experiment) => section(experiment, echarts, charts))]
    : [make("p", { class: "findings-empty" }, "Nothing has been run yet. Start with: studio reproduce all --quick")];
  element.replaceChildren(
    ...(experiments.length > 1 ? [contents(experiments)] : []), make("div", { class: "findings-body" }, ...body),
  );
  disposals.set(element, charts);
}

const anchor = (experiment) => `experiment-${experiment.name}`;

const isQuestion = (experiment) => /open question/i.test(experiment.source);

/** A link that scrolls, and leaves the page's address alone. */
function link(experiment, ...content) {
  const made = make("a", { href: `#${anchor(experiment)}` }, ...content);
  made.onclick = (event) => {
    event.preventDefault();
    document.getElementById(anchor(experiment))?.scrollIntoView({ block: "start" });
  };
  return made;
}

/** The verdict as a coloured word with a sign of its own. */
export function badge(verdict, firm = true) {
  const made = make("span", { class: "findings-badge", "data-verdict": verdict }, make("i", { "aria-hidden": "true" }, SIGNS[verdict] ?? "●"), verdict);
  if (!firm && verdict !== "failed") {
    made.append(make("small", {}, "not firm"));
    made.title = "Fewer than ten seeds";
  }
  return made;
}

function contents(experiments) {
  const groups = Map.groupBy(experiments, (experiment) => experiment.source.match(/^.*?\b\d{4}\b/)?.[0] ?? (isQuestion(experiment) ? "Open questions" : experiment.source));
  const lists = [...groups].map(([source, members]) => [
    make("h3", {}, source),
    make("ol", {}, ...members.map((experiment) => make("li", {}, link(experiment, sign(experiment.verdict), experiment.title)))),
  ]);
  return make("nav", { class: "findings-contents", "aria-label": "Contents" }, ...lists.flat());
}

const sign = (verdict) => make("i", { class: "findings-sign", "data-verdict": verdict, title: verdict }, SIGNS[verdict] ?? "●");

function summary(experiments) {
  const counts = Object.keys(SIGNS).map((verdict) => [verdict, experiments.filter((experiment) => experiment.verdict === verdict).length]);
  const chips = counts.filter(([, count]) => count).map(([verdict, count]) => make("li", {}, make("b", {}, String(count)), " ", badge(verdict)));
  const rows = experiments.map((experiment) => make("tr", {},
    make("td", {}, link(experiment, experiment.title), make("small", {}, experiment.source)),
    make("td", {}, badge(experiment.verdict, experiment.firm)),
    make("td", {}, ...leading(experiment)),
    make("td", { class: "number" }, String(experiment.seeds)),
  ));
  return make("section", { class: "findings-summary" },
    make("h2", {}, "Summary"), make("ul", { class: "findings-counts" }, ...chips),
    make("div", { class: "findings-scroll" }, make("table", {},
      make("thead", {}, head(["experiment", "verdict", "leading numbers: ours [95 % interval], paper", "seeds"], [3])),
      make("tbody", {}, ...rows))));
}

/** The first numbers that the paper prints too, else the first of ours. */
function leading(experiment) {
  const compared = experiment.numbers.filter((number) => number.paper !== null);
  const few = (compared.length ? compared : experiment.numbers).slice(0, 2);
  if (!few.length) return [make("div", { class: "quiet" }, experiment.words.split(". ")[0].replace(/\.$/, ""), ".")];
  return few.map((number) => make("div", {}, make("span", { class: "quiet" }, `${number.name}: `), value(number), interval(number),
    number.paper === null ? null : make("span", { class: "quiet" }, `, paper ${figures(number).paper}`)));
}

const value = (number) => make("b", {}, figures(number).ours, number.unit ? make("small", {}, ` ${number.unit}`) : null);
const interval = (number) => make("span", { class: "quiet" }, ` [${figures(number).low}, ${figures(number).high}]`);

function head(names, numeric = []) {
  return make("tr", {}, ...names.map((name, index) => make("th", numeric.includes(index) ? { class: "number", scope: "col" } : { scope: "col" }, name)));
}

function section(experiment, echarts, charts) {
  const facts = [experiment.source, `${experiment.seeds} seeds`, `${experiment.trials} trials`, duration(experiment.seconds), experiment.date.slice(0, 10)];
  const made = make("section", { class: "findings-experiment", id: anchor(experiment) },
    make("header", {}, make("div", {}, make("h2", {}, experiment.title), make("p", { class: "quiet" }, facts.join(" · "), " · ", make("code", {}, experiment.name))),
      badge(experiment.verdict, experiment.firm)),
    make("div", { class: "findings-words" },
      make("blockquote", {}, make("h3", {}, isQuestion(experiment) ? "The question" : "The paper's claim"), make("p", {}, experiment.claim)),
      make("div", {}, make("h3", {}, "What we see"), make("p", {}, experiment.words), ...experiment.notes.map((note) => make("p", { class: "findings-note" }, note)))),
    failures(experiment), numbers(experiment));
  const grid = make("div", { class: "findings-charts" });
  for (const chart of experiment.charts) {
    const figureElement = make("figure", isWide(chart, experiment.charts.length) ? { class: "wide" } : {});
    grid.append(figureElement);
    charts.push(drawChart(figureElement, chart, echarts));
  }
  if (experiment.charts.length) made.append(grid);
  for (const table of experiment.tables) made.append(tableElement(table));
  if (Object.keys(experiment.settings).length) made.append(settings(experiment));
  return made;
}

const isWide = (chart, count) => count === 1 || (chart.heat ? chart.heat.columns.length > WIDE_COLUMNS : chart.categories.length > WIDE_COLUMNS);

function duration(seconds) {
  if (seconds < 90) return `${Math.round(seconds)} s`;
  return seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${(seconds / 3600).toFixed(1)} h`;
}

function failures(experiment) {
  if (!experiment.failures.length) return null;
  const few = experiment.failures.slice(0, 5).map(({ label, reason }) => make("li", {}, label ? make("b", {}, `${label}: `) : null, reason));
  const more = experiment.failures.length - few.length;
  return make("ul", { class: "findings-failures" }, ...few, more > 0 ? make("li", {}, `and ${more} more`) : null);
}

function numbers(experiment) {
  if (!experiment.numbers.length) return null;
  const rows = experiment.numbers.map((number) => make("tr", {},
    make("td", {}, number.name),
    make("td", { class: "number" }, value(number)),
    make("td", { class: "number" }, interval(number)),
    make("td", { class: "number" }, figures(number).paper),
    make("td", { class: "picture" }, whisker(number)),
    make("td", { class: "number" }, String(number.seeds)),
    make("td", {}, number.paper === null && number.verdict === "answered" ? "" : badge(number.verdict, number.firm)),
  ));
  return make("div", { class: "findings-scroll" }, make("table", { class: "findings-numbers" },
    make("thead", {}, head(["number", "ours", "95 % interval", "paper", "", "seeds", "verdict"], [1, 2, 3, 5])), make("tbody", {}, ...rows)));
}

const SVG = "http://www.w3.org/2000/svg";

/** Our value and its interval, the paper's as a dashed stroke, on a scale of its own. */
function whisker(number) {
  const picture = document.createElementNS(SVG, "svg");
  picture.setAttribute("viewBox", "0 0 150 18");
  picture.setAttribute("class", "findings-whisker");
  picture.dataset.verdict = number.verdict;
  const known = [number.ours, number.low, number.high, number.paper].filter((entry) => entry !== null);
  if (number.ours === null || known.length < 2) return picture;
  const least = Math.min(...known), most = Math.max(...known);
  const place = (entry) => (most > least ? 8 + (134 * (entry - least)) / (most - least) : 75);
  const stroke = (name, attributes) => {
    const part = document.createElementNS(SVG, name);
    for (const [key, entry] of Object.entries(attributes)) part.setAttribute(key, String(entry));
    picture.append(part);
  };
  if (number.paper !== null) stroke("line", { class: "paper", x1: place(number.paper), x2: place(number.paper), y1: 1, y2: 17 });
  if (number.low !== null && number.high !== null) stroke("line", { class: "interval", x1: place(number.low), x2: place(number.high), y1: 9, y2: 9 });
  stroke("circle", { cx: place(number.ours), cy: 9, r: 3.6 });
  return picture;
}

function tableElement(table) {
  const numeric = table.columns.map((_, index) => index).filter((index) => table.rows.some((row) => typeof row[index] === "number") && table.rows.every((row) => row[index] === null || typeof row[index] === "number"));
  const cell = (entry, index) => make("td", numeric.includes(index) ? { class: "number" } : {}, typeof entry === "number" ? exact(entry) : String(entry ?? "–"));
  const made = make("div", { class: "findings-scroll" }, make("table", {}, make("thead", {}, head(table.columns, numeric)),
    make("tbody", {}, ...table.rows.map((row) => make("tr", {}, ...row.map(cell))))));
  if (table.rows.length <= FOLDED_ROWS) return make("div", { class: "findings-table" }, make("h3", {}, table.title), made);
  return make("details", { class: "findings-table" }, make("summary", {}, `${table.title} (${table.rows.length} rows)`), made);
}

/** A number of a table as it was given, up to four significant figures behind the point. */
const exact = (entry) => (Number.isInteger(entry) ? String(entry) : String(Number(entry.toPrecision(Math.abs(entry) >= 1000 ? 5 : 4))));

function settings(experiment) {
  const text = (entry) => (typeof entry === "object" ? JSON.stringify(entry) : String(entry));
  const lines = Object.entries(experiment.settings).flatMap(([name, entry]) => [make("dt", {}, name), make("dd", {}, text(entry))]);
  return make("details", { class: "findings-settings" }, make("summary", {}, "Settings"), make("dl", {}, ...lines, make("dt", {}, "studio"), make("dd", {}, experiment.software)));
}
