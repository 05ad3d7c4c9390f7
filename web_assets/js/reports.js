// What `studio reproduce` found, drawn as in its own report.

import * as echarts from "../vendor/echarts.esm.min.js";
import { fetchJson } from "./api.js";
import { element } from "./elements.js";
import { drawFindings } from "./findings.js";
import { complain } from "./messages.js";
import { startTheme } from "./theme.js";

const content = document.getElementById("content");
const FILES = [["Report", "report.html"], ["JSON", "results.json"], ["Markdown", "summary.md"]];

function nothing() {
  content.replaceChildren(element("div", { className: "nothing" },
    element("h1", { textContent: "Nothing reproduced yet" }),
    element("p", { textContent: "The papers' figures and tables are run again by one command. A look at all of them takes about a quarter of an hour; without --quick the full runs take hours, and go on where they stopped." }),
    element("code", { textContent: "studio reproduce all --quick" }),
    element("p", { textContent: "What it finds appears here, with the paper's claim beside every number." })));
}

async function start() {
  startTheme();
  try {
    const told = await fetchJson("/api/reports");
    if (!told.experiments.length) return nothing();
    document.getElementById("downloads").append(...FILES.map(([words, file]) => {
      const link = element("a", { className: "download", href: `/api/reports/${file}`, textContent: words });
      link.setAttribute("download", file);
      return link;
    }));
    const column = element("div", { id: "findings" });
    content.replaceChildren(element("div", { className: "report-column" }, column));
    drawFindings(column, told.experiments, echarts);
  } catch (error) { complain(error); }
}

start();
