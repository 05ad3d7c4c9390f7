// What `studio reproduce` found, drawn as in its own report.

import * as echarts from "../vendor/echarts.esm.min.js";
import { fetchJson } from "./api.js";
import { byId, element, fill, nothing } from "./elements.js";
import { drawFindings } from "./findings.js";
import { complain } from "./messages.js";
import { startTheme } from "./theme.js";

const FILES = { Report: "report.html", JSON: "results.json", Markdown: "summary.md" };

const empty = () => nothing("Nothing reproduced yet",
  element("p", {}, "The papers' figures and tables are run again by one command. A quick pass over all of them takes about a quarter of an hour; without --quick the full runs take hours, and resume where they stopped."),
  element("code", {}, "studio reproduce all --quick"), element("p", {}, "Results appear here, with the paper's claim beside every number."));

async function start() {
  startTheme();
  const { experiments } = await fetchJson("/api/reports");
  if (!experiments.length) return fill(byId("content"), empty());
  fill(byId("downloads"), Object.entries(FILES).map(([words, file]) => element("a", { className: "download", href: `/api/reports/${file}`, download: file }, words)));
  const column = element("div", { id: "findings" });
  fill(byId("content"), element("div", { className: "report-column" }, column));
  drawFindings(column, experiments, echarts);
}

start().catch(complain);
