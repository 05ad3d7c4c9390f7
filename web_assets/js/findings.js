// Results of experiments: a summary with all verdicts, then each with the paper's claim beside
// ours. Used by the report (garden/reproduction/report_document.py) and by the studio's pages;
// looks are in report.css.

import { duration, element, shape } from "./elements.js";
import { drawChart } from "./findings_charts.js";
import { figures } from "./findings_options.js";

const SIGNS = {
  reproduced: "✓",
  better: "▲",
  undecided: "?",
  "not reproduced": "✕",
  answered: "●",
  failed: "!",
};
const FOLDED_ROWS = 14;
const WIDE_COLUMNS = 9;
const MOST_OPEN = 4;

const disposals = new WeakMap();

/** Fill a place with the findings of `experiments` (documents of results.json, in their order). */
export function drawFindings(place, experiments, echarts) {
  for (const dispose of disposals.get(place) ?? []) dispose();
  const charts = [];
  place.classList.add("findings");
  const body = experiments.length
    ? [
        summary(experiments),
        ...experiments.map((experiment) => section(experiment, echarts, charts)),
      ]
    : [
        element(
          "p",
          { className: "findings-empty" },
          "Nothing has been run yet. Start with: studio reproduce all --quick",
        ),
      ];
  place.replaceChildren(
    ...(experiments.length > 1 ? [contents(experiments)] : []),
    element("div", { className: "findings-body" }, ...body),
  );
  disposals.set(place, charts);
}

const anchor = (experiment) => `experiment-${experiment.name}`;

const isQuestion = (experiment) => /open question/i.test(experiment.source);

/** A link that scrolls, and leaves the page's address alone. */
function link(experiment, ...content) {
  const onclick = (event) => {
    event.preventDefault();
    document.getElementById(anchor(experiment))?.scrollIntoView({ block: "start" });
  };
  return element("a", { href: `#${anchor(experiment)}`, onclick }, ...content);
}

/** The verdict as a coloured word with a sign of its own. */
export function badge(verdict, firm = true) {
  const made = element(
    "span",
    { className: "findings-badge", dataset: { verdict } },
    element("i", { ariaHidden: "true" }, SIGNS[verdict] ?? "●"),
    verdict,
  );
  if (!firm && verdict !== "failed") {
    made.append(element("small", {}, "not firm"));
    made.title = "Fewer than ten seeds";
  }
  return made;
}

function contents(experiments) {
  const groups = Map.groupBy(
    experiments,
    (experiment) =>
      experiment.source.match(/^.*?\b\d{4}\b/)?.[0] ??
      (isQuestion(experiment) ? "Open questions" : experiment.source),
  );
  const lists = [...groups].map(([source, members]) => [
    element("h3", {}, source),
    element(
      "ol",
      {},
      ...members.map((experiment) =>
        element("li", {}, link(experiment, sign(experiment.verdict), experiment.title)),
      ),
    ),
  ]);
  return element("nav", { className: "findings-contents", ariaLabel: "Contents" }, ...lists.flat());
}

const sign = (verdict) =>
  element(
    "i",
    { className: "findings-sign", dataset: { verdict }, title: verdict },
    SIGNS[verdict] ?? "●",
  );

function summary(experiments) {
  const counts = Object.keys(SIGNS).map((verdict) => [
    verdict,
    experiments.filter((experiment) => experiment.verdict === verdict).length,
  ]);
  const chips = counts
    .filter(([, count]) => count)
    .map(([verdict, count]) =>
      element("li", {}, element("b", {}, String(count)), " ", badge(verdict)),
    );
  const rows = experiments.map((experiment) =>
    element(
      "tr",
      {},
      element(
        "td",
        {},
        link(experiment, experiment.title),
        element("small", {}, experiment.source),
      ),
      element("td", {}, badge(experiment.verdict, experiment.firm)),
      element("td", {}, ...leading(experiment)),
      element("td", { className: "number" }, String(experiment.seeds)),
    ),
  );
  return element(
    "section",
    { className: "findings-summary" },
    element("h2", {}, "Summary"),
    element("ul", { className: "findings-counts" }, ...chips),
    element(
      "div",
      { className: "findings-scroll" },
      element(
        "table",
        {},
        element(
          "thead",
          {},
          head(
            ["experiment", "verdict", "leading numbers: ours [95 % interval], paper", "seeds"],
            [3],
          ),
        ),
        element("tbody", {}, ...rows),
      ),
    ),
  );
}

/** The first numbers that the paper prints too, else the first of ours. */
function leading(experiment) {
  const compared = experiment.numbers.filter((number) => number.paper !== null);
  const few = (compared.length ? compared : experiment.numbers).slice(0, 2);
  if (!few.length)
    return [
      element(
        "div",
        { className: "quiet" },
        experiment.words.split(". ")[0].replace(/\.$/, ""),
        ".",
      ),
    ];
  return few.map((number) =>
    element(
      "div",
      {},
      element("span", { className: "quiet" }, `${number.name}: `),
      value(number),
      interval(number),
      number.paper === null
        ? null
        : element("span", { className: "quiet" }, `, paper ${figures(number).paper}`),
    ),
  );
}

const value = (number) =>
  element(
    "b",
    {},
    figures(number).ours,
    number.unit ? element("small", {}, ` ${number.unit}`) : null,
  );
const interval = (number) =>
  element("span", { className: "quiet" }, ` [${figures(number).low}, ${figures(number).high}]`);

function head(names, numeric = []) {
  return element(
    "tr",
    {},
    ...names.map((name, index) =>
      element(
        "th",
        numeric.includes(index) ? { className: "number", scope: "col" } : { scope: "col" },
        name,
      ),
    ),
  );
}

function section(experiment, echarts, charts) {
  const facts = [
    experiment.source,
    `${experiment.seeds} seeds`,
    `${experiment.trials} trials`,
    duration(experiment.seconds),
    (experiment.measured || experiment.date).slice(0, 10),
  ];
  if (experiment.commits?.length) facts.push(`commit ${experiment.commits.join(", ")}`);
  const made = element(
    "section",
    { className: "findings-experiment", id: anchor(experiment) },
    element(
      "header",
      {},
      element(
        "div",
        {},
        element("h2", {}, experiment.title),
        element(
          "p",
          { className: "quiet" },
          facts.join(" · "),
          " · ",
          element("code", {}, experiment.name),
        ),
      ),
      badge(experiment.verdict, experiment.firm),
    ),
    refutations(experiment),
    element(
      "div",
      { className: "findings-words" },
      element(
        "blockquote",
        {},
        element("h3", {}, isQuestion(experiment) ? "The question" : "The paper's claim"),
        element("p", {}, experiment.claim),
      ),
      element(
        "div",
        {},
        element("h3", {}, "Our result"),
        element("p", {}, experiment.words),
        ...experiment.notes.map((note) => element("p", { className: "findings-note" }, note)),
      ),
    ),
    failures(experiment),
    numbers(experiment),
  );
  const grid = element("div", { className: "findings-charts" });
  for (const chart of experiment.charts) {
    const figureElement = element(
      "figure",
      isWide(chart, experiment.charts.length) ? { className: "wide" } : {},
    );
    grid.append(figureElement);
    charts.push(drawChart(figureElement, chart, echarts));
  }
  if (experiment.charts.length) made.append(grid);
  for (const table of experiment.tables) made.append(tableElement(table));
  if (Object.keys(experiment.settings).length) made.append(settings(experiment));
  return made;
}

/** What would refute the claim, by number; nothing for comparisons, which claim nothing. */
function refutations(experiment) {
  const judged = experiment.numbers.filter((number) => number.refuted);
  if (!judged.length) return null;
  return element(
    "details",
    { className: "findings-refuted", open: judged.length <= MOST_OPEN },
    element("summary", {}, "What would refute this"),
    element(
      "ul",
      {},
      ...judged.map((number) => element("li", {}, `${number.name}: where ${number.refuted}`)),
    ),
  );
}

const isWide = (chart, count) =>
  count === 1 ||
  (chart.heat ? chart.heat.columns.length > WIDE_COLUMNS : chart.categories.length > WIDE_COLUMNS);

function failures(experiment) {
  if (!experiment.failures.length) return null;
  const few = experiment.failures
    .slice(0, 5)
    .map(({ label, reason }) =>
      element("li", {}, label ? element("b", {}, `${label}: `) : null, reason),
    );
  const more = experiment.failures.length - few.length;
  return element(
    "ul",
    { className: "findings-failures" },
    ...few,
    more > 0 ? element("li", {}, `and ${more} more`) : null,
  );
}

function numbers(experiment) {
  if (!experiment.numbers.length) return null;
  const rows = experiment.numbers.map((number) =>
    element(
      "tr",
      {},
      element("td", {}, number.name),
      element("td", { className: "number" }, value(number)),
      element("td", { className: "number" }, interval(number)),
      element("td", { className: "number" }, figures(number).paper),
      element("td", { className: "picture" }, whisker(number)),
      element("td", { className: "number" }, String(number.seeds)),
      element("td", {}, number.verdict === "answered" ? "" : badge(number.verdict, number.firm)),
    ),
  );
  return element(
    "div",
    { className: "findings-scroll" },
    element(
      "table",
      { className: "findings-numbers" },
      element(
        "thead",
        {},
        head(["number", "ours", "95 % interval", "paper", "", "seeds", "verdict"], [1, 2, 3, 5]),
      ),
      element("tbody", {}, ...rows),
    ),
  );
}

/** Our value and its interval, the paper's as a dashed stroke, on a scale of its own. */
function whisker(number) {
  const picture = shape("svg", {
    viewBox: "0 0 150 18",
    class: "findings-whisker",
    "data-verdict": number.verdict,
  });
  const known = [number.ours, number.low, number.high, number.paper].filter(
    (entry) => entry !== null,
  );
  if (number.ours === null || known.length < 2) return picture;
  const [least, most] = [Math.min(...known), Math.max(...known)];
  const place = (entry) => (most > least ? 8 + (134 * (entry - least)) / (most - least) : 75);
  if (number.paper !== null)
    picture.append(
      shape("line", {
        class: "paper",
        x1: place(number.paper),
        x2: place(number.paper),
        y1: 1,
        y2: 17,
      }),
    );
  if (number.low !== null && number.high !== null)
    picture.append(
      shape("line", {
        class: "interval",
        x1: place(number.low),
        x2: place(number.high),
        y1: 9,
        y2: 9,
      }),
    );
  picture.append(shape("circle", { cx: place(number.ours), cy: 9, r: 3.6 }));
  return picture;
}

function tableElement(table) {
  const numeric = table.columns
    .map((_, index) => index)
    .filter(
      (index) =>
        table.rows.some((row) => typeof row[index] === "number") &&
        table.rows.every((row) => row[index] === null || typeof row[index] === "number"),
    );
  const cell = (entry, index) =>
    element(
      "td",
      numeric.includes(index) ? { className: "number" } : {},
      typeof entry === "number" ? exact(entry) : String(entry ?? "–"),
    );
  const made = element(
    "div",
    { className: "findings-scroll" },
    element(
      "table",
      {},
      element("thead", {}, head(table.columns, numeric)),
      element("tbody", {}, ...table.rows.map((row) => element("tr", {}, ...row.map(cell)))),
    ),
  );
  if (table.rows.length <= FOLDED_ROWS)
    return element("div", { className: "findings-table" }, element("h3", {}, table.title), made);
  return element(
    "details",
    { className: "findings-table" },
    element("summary", {}, `${table.title} (${table.rows.length} rows)`),
    made,
  );
}

/** A number of a table as it was given, up to four significant figures behind the point. */
const exact = (entry) =>
  Number.isInteger(entry)
    ? String(entry)
    : String(Number(entry.toPrecision(Math.abs(entry) >= 1000 ? 5 : 4)));

function settings(experiment) {
  const text = (entry) => (typeof entry === "object" ? JSON.stringify(entry) : String(entry));
  const lines = Object.entries(experiment.settings).flatMap(([name, entry]) => [
    element("dt", {}, name),
    element("dd", {}, text(entry)),
  ]);
  return element(
    "details",
    { className: "findings-settings" },
    element("summary", {}, "Settings"),
    element(
      "dl",
      {},
      ...lines,
      element("dt", {}, "studio"),
      element("dd", {}, experiment.software),
    ),
  );
}
