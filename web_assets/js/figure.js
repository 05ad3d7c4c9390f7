// A figure: a title, the question that it answers, its drawing with exact numbers, the same numbers
// as a table, and what it can be written as: SVG, a page to print (PDF), CSV, a link. Everything
// that is written carries the caption.

import * as echarts from "../vendor/echarts.esm.min.js";
import { addressOf } from "./address.js";
import { look, tooltip } from "./chart_looks.js";
import { button, byId, download, element, fill, shape, table } from "./elements.js";
import { complain, say } from "./messages.js";
import { drawSoon } from "./pacing.js";
import { studioPath } from "./sessions.js";
import { get } from "./state.js";
import { onTheme, theme } from "./theme.js";
import { Sheet } from "./view_sheet.js";

const MOST_ROWS = 400;
// Columns by which a row is a place in the run, the most telling first.
const LINKED = ["frame", "particle", "layer", "limb", "parameter", "camera"];
const EXPORT_WIDTH = 1180,
  EXPORT_ROOM = 420,
  MARGIN = 28,
  LINE = 17,
  CAPTION_LETTERS = 190;
const LEAST_ROOM = 170;

/**
 * What a figure shows. `draw`: fills a sheet and returns the exact numbers of what is chosen, in a
 * sentence. `tables`: the numbers behind it. `link`: its address, null where it has none.
 * @typedef {{ name: string, title: string, question: string, caption: string, notes: string[],
 *   tables: { name: string, title: string, columns: { key: string, label: string, unit?: string
 *   }[], rows: any[][] }[], draw: (sheet: Sheet, room: number) => string, choose: (changes:
 *   Record<string, any>) => void, link: (() => string) | null }} Shown
 */

/** A cell of a table as text, exact. */
const cellText = (value) =>
  value === null || value === undefined
    ? ""
    : typeof value === "number" && !Number.isInteger(value)
      ? String(Number(value.toPrecision(9)))
      : String(value);
const headText = (column) => (column.unit ? `${column.label} [${column.unit}]` : column.label);
const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

/**
 * A row's values as people read them: a layer, an index in the answer and in the address, is
 * counted from 1.
 */
const readable = (columns, row) =>
  row.map((value, at) =>
    columns[at].key === "layer" && Number.isInteger(value) ? value + 1 : value,
  );

/** What a row of a table speaks of, by the names that the address has. */
const chosenBy = (columns, row) =>
  Object.fromEntries(
    columns.flatMap(({ key }, at) =>
      LINKED.includes(key) && row[at] !== null && row[at] !== "" ? [[key, row[at]]] : [],
    ),
  );

/**
 * A row's cells; the first that can be chosen is a link to what the row speaks of, its frame before
 * all. A click chooses it here, where it is of this run.
 * @param {Shown} shown
 */
function linked(columns, row, shown) {
  const cells = readable(columns, row).map(cellText);
  const chosen = chosenBy(columns, row);
  const key = LINKED.find((name) => name in chosen);
  // A page that is given away has no studio behind it to lead to.
  if (!key || !shown.link) return cells;
  const named = columns.findIndex((column) => column.key === "run");
  const [session, run] = named < 0 ? [] : String(row[named]).split("/");
  const elsewhere = run && (session !== get("session") || run !== get("run"));
  const at = columns.findIndex((column) => column.key === key);
  const href = elsewhere
    ? studioPath(session, run, { ...chosen, panel: "why" })
    : addressOf(chosen);
  cells[at] = element(
    "a",
    {
      href,
      onclick: (event) => {
        if (elsewhere || event.button || event.ctrlKey || event.metaKey || event.shiftKey) return;
        event.preventDefault();
        shown.choose(chosen);
      },
    },
    cells[at],
  );
  return cells;
}

/** Tables as CSV: the caption and each table's title in lines of their own. @param {Shown} shown */
function csvOf({ caption, title, tables }) {
  const part = (one) => [
    `# ${one.title}`,
    one.columns.map((column) => quoted(column.key)).join(","),
    ...one.rows.map((row) =>
      readable(one.columns, row)
        .map((value) => quoted(value === null ? "" : String(value)))
        .join(","),
    ),
  ];
  return `${[`# ${title}. ${caption}`, ...tables.filter((one) => one.rows.length).flatMap(part)].join("\n")}\n`;
}

/** Text broken into lines. */
function wrapped(text, letters) {
  const lines = [""];
  for (const word of text.split(" ")) {
    const last = lines[lines.length - 1];
    if (last.length + word.length > letters) lines.push(word);
    else lines[lines.length - 1] = last ? `${last} ${word}` : word;
  }
  return lines;
}

/** Do something while the page has the light colours, which are those of paper. */
function onPaper(work) {
  const root = document.documentElement;
  const before = root.dataset.theme;
  root.dataset.theme = "light";
  try {
    return work();
  } finally {
    root.dataset.theme = before;
  }
}

/**
 * A drawing from its text. The page's policy allows no styles in a text: they are set one by one;
 * rules for a pointer are left out.
 */
function drawingOf(text) {
  const bare = text
    .replaceAll(/<style[^>]*>.*?<\/style>/gs, "")
    .replaceAll(' style="', ' data-style="');
  const drawing = new DOMParser().parseFromString(bare, "image/svg+xml").documentElement;
  for (const part of /** @type {NodeListOf<SVGElement>} */ (
    drawing.querySelectorAll("[data-style]")
  )) {
    part.style.cssText = part.dataset.style ?? "";
    delete part.dataset.style;
  }
  return drawing;
}

/**
 * The figure as a drawing with title, question and caption, in the light colours.
 * @param {Shown} shown
 * @returns {SVGElement}
 */
function svgOf(shown) {
  return onPaper(() => {
    const sheet = new Sheet(EXPORT_WIDTH);
    shown.draw(sheet, EXPORT_ROOM);
    const height = Math.max(sheet.height, EXPORT_ROOM) + 8;
    const made = echarts.init(null, null, {
      renderer: "svg",
      ssr: true,
      width: EXPORT_WIDTH,
      height,
    });
    made.setOption({ ...look(), ...sheet.option });
    const drawing = drawingOf(made.renderToSVGString());
    made.dispose();
    const lines = wrapped(shown.caption, CAPTION_LETTERS);
    const top = MARGIN + 52;
    const whole = [EXPORT_WIDTH + 2 * MARGIN, top + height + 14 + lines.length * LINE + MARGIN];
    const text = (words, y, size, colour, weight = 400) =>
      shape(
        "text",
        { x: MARGIN, y, "font-size": size, fill: colour, "font-weight": weight },
        words,
      );
    for (const [name, value] of Object.entries({ x: MARGIN, y: top, width: EXPORT_WIDTH, height }))
      drawing.setAttribute(name, String(value));
    return /** @type {SVGElement} */ (
      shape(
        "svg",
        {
          xmlns: "http://www.w3.org/2000/svg",
          viewBox: `0 0 ${whole[0]} ${whole[1]}`,
          width: whole[0],
          height: whole[1],
          "font-family": "Inter, Helvetica, Arial, sans-serif",
          role: "img",
        },
        shape("title", {}, shown.title),
        shape("desc", {}, shown.caption),
        shape("rect", { width: "100%", height: "100%", fill: "#ffffff" }),
        text(shown.title, MARGIN + 16, 17, "#171b22", 650),
        text(shown.question, MARGIN + 36, 12.5, "#5b6675"),
        drawing,
        ...lines.map((line, at) => text(line, top + height + 18 + at * LINE, 11.5, "#5b6675")),
      )
    );
  });
}

/**
 * Put the figure alone on the page and let the browser print it; there it can be kept as PDF.
 * @param {Shown} shown
 */
function print(shown) {
  const sheet = element("div", { id: "paper" }, svgOf(shown));
  const before = document.title;
  const end = () => {
    sheet.remove();
    document.title = before;
    removeEventListener("afterprint", end);
  };
  byId("paper")?.remove();
  document.body.append(sheet);
  document.title = fileName(shown);
  addEventListener("afterprint", end);
  window.print();
}

const fileName = (shown) => shown.name;

/** A figure in a place of the page. */
export class Figure {
  /** @type {Shown | null} */
  shown = null;
  /** @type {echarts.Chart | null} */
  chart = null;
  isTable = false;
  /** @type {Sheet | null} */
  sheet = null;
  redrawn = () => this.redraw();

  /** @param {HTMLElement} place */
  constructor(place) {
    this.title = element("h2", {});
    this.question = element("p", { className: "question" });
    // What can be chosen of this view is put there by whoever shows it.
    this.own = element("div", { className: "figure-tools" });
    this.numbers = element("output", { className: "readout" });
    this.chartPlace = element("div", { className: "figure-chart", role: "img" });
    this.words = element("div", { className: "figure-words", hidden: true });
    this.body = element(
      "div",
      { className: "figure-body", tabIndex: 0, role: "region", ariaLabel: "Drawing" },
      this.chartPlace,
      this.words,
    );
    this.asTable = button(
      "Table",
      () => {
        this.isTable = !this.isTable;
        this.redraw();
      },
      "quiet small",
      { ariaPressed: "false", title: "The exact numbers as a table (t)" },
    );
    this.linkButton = button("Link", () => this.save("link"), "quiet small", {
      title: "Copy the address of exactly this",
    });
    this.exports = element(
      "div",
      { className: "group figure-exports", role: "group", ariaLabel: "Take this figure along" },
      this.asTable,
      button("SVG", () => this.save("svg"), "quiet small", { title: "A drawing with its caption" }),
      button("PDF", () => this.save("pdf"), "quiet small", {
        title: "Print it, or keep it as PDF",
      }),
      button("CSV", () => this.save("csv"), "quiet small", { title: "The numbers behind it" }),
      this.linkButton,
    );
    fill(
      place,
      element(
        "header",
        { className: "figure-head" },
        element("div", { className: "figure-name" }, this.title, this.question),
        this.own,
        this.exports,
      ),
      this.numbers,
      this.body,
    );
    new ResizeObserver(() => drawSoon(this.redrawn)).observe(this.body);
    onTheme(this.redrawn);
    document.fonts.ready.then(this.redrawn);
  }

  /** Show a figure; null with words says why there is none. @param {Shown | null} shown */
  show(shown, words = "") {
    this.shown = shown;
    this.none = words;
    drawSoon(this.redrawn);
  }

  /** Draw again, because what is chosen changed. */
  refresh() {
    drawSoon(this.redrawn);
  }

  redraw() {
    const { shown } = this;
    this.title.textContent = shown?.title ?? "";
    this.title.hidden = !shown;
    this.question.textContent = shown?.question ?? "";
    this.exports.hidden = !shown?.draw;
    this.linkButton.hidden = !shown?.link;
    this.asTable.ariaPressed = String(this.isTable);
    const isTable = this.isTable && Boolean(shown?.tables);
    this.chartPlace.hidden = isTable || !shown?.draw;
    this.words.hidden = !isTable && Boolean(shown?.draw);
    if (!shown?.draw) {
      this.numbers.textContent = "";
      return fill(this.words, element("p", { className: "empty" }, this.none));
    }
    if (isTable) {
      fill(this.words, this.tables(shown));
      this.body.dataset.drawn = `${shown.name} table`;
      return;
    }
    if (this.body.clientWidth) this.draw(shown);
  }

  draw(shown) {
    const width = this.body.clientWidth;
    const sheet = new Sheet(width);
    let said = "";
    try {
      said = shown.draw(sheet, Math.max(LEAST_ROOM, this.body.clientHeight));
    } catch (error) {
      console.error(error);
      this.chartPlace.hidden = true;
      this.words.hidden = false;
      return fill(
        this.words,
        element(
          "p",
          { className: "empty" },
          "This view cannot draw these numbers; the table has them.",
        ),
      );
    }
    fill(this.words);
    this.sheet = sheet;
    this.numbers.textContent = said;
    this.numbers.title = said;
    this.chartPlace.ariaLabel = `${shown.title}. ${said}`;
    const height = Math.max(sheet.height, 60);
    this.chartPlace.style.height = `${height}px`;
    if (!this.chart) {
      this.chart = echarts.init(this.chartPlace, null, { renderer: "canvas" });
      this.chart.on("click", (event) => this.clicked(event));
      this.chart.getZr().on("click", (event) => this.clickedGround(event));
    }
    if (this.chart.getWidth() !== this.chartPlace.clientWidth || this.chart.getHeight() !== height)
      this.chart.resize({ width: "auto" });
    this.chart.setOption(
      {
        ...look(),
        ...sheet.option,
        tooltip: { ...tooltip(), ...sheet.option.tooltip, transitionDuration: 0 },
      },
      { notMerge: true },
    );
    this.body.dataset.drawn = `${shown.name} ${theme()} ${width}`;
  }

  clicked(event) {
    const changes = this.sheet?.clicks.get(event.seriesId)?.(event);
    if (changes) this.shown?.choose(changes);
  }

  /** A click on the ground of a plot, where nothing is. */
  clickedGround({ offsetX, offsetY, target }) {
    if (target && !target.silent && target.cursor === "pointer") return;
    for (const { box, index, act } of this.sheet?.grounds ?? []) {
      if (
        offsetX < box.left ||
        offsetX > box.left + box.width ||
        offsetY < (box.top ?? 0) ||
        offsetY > (box.top ?? 0) + box.height ||
        !this.chart
      )
        continue;
      const [x, y] = this.chart.convertFromPixel({ gridIndex: index }, [offsetX, offsetY]);
      const changes = act(x, y);
      if (changes) this.shown?.choose(changes);
      return;
    }
  }

  /** @param {Shown} shown */
  tables(shown) {
    return [
      element("p", { className: "caption-line" }, shown.caption),
      ...shown.notes.map((note) => element("p", { className: "hint" }, note)),
      ...shown.tables
        .filter((one) => one.rows.length)
        .map((one) => {
          const rows = one.rows.slice(0, MOST_ROWS).map((row) => linked(one.columns, row, shown));
          const made = table(one.columns.map(headText), rows);
          made.prepend(element("caption", {}, one.title));
          for (const head of made.querySelectorAll("th")) head.scope = "col";
          return element(
            "div",
            { className: "table-box" },
            made,
            one.rows.length > MOST_ROWS &&
              element(
                "p",
                { className: "hint" },
                `${one.rows.length - MOST_ROWS} more rows are in the CSV.`,
              ),
          );
        }),
    ];
  }

  /** Write the figure as something. @param {"svg" | "pdf" | "csv" | "link"} kind */
  async save(kind) {
    const { shown } = this;
    if (!shown?.draw) return;
    try {
      if (kind === "svg")
        download(
          `${fileName(shown)}.svg`,
          new Blob([new XMLSerializer().serializeToString(svgOf(shown))], {
            type: "image/svg+xml",
          }),
        );
      else if (kind === "csv")
        download(`${fileName(shown)}.csv`, new Blob([csvOf(shown)], { type: "text/csv" }));
      else if (kind === "pdf") print(shown);
      else if (shown.link) {
        await navigator.clipboard.writeText(location.origin + shown.link());
        say("The address of this view is copied.");
      }
    } catch (error) {
      complain(error);
    }
  }
}
