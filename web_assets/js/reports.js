// What was found when the papers' experiments were run again, drawn as in the command's own report;
// and the form that runs one.

import * as echarts from "../vendor/echarts.esm.min.js";
import { fetchJson, post, readOnly, remove } from "./api.js";
import {
  actions,
  button,
  byId,
  card,
  check,
  drawProgress,
  element,
  failure,
  field,
  fill,
  hint,
  lead,
  optional,
  select,
} from "./elements.js";
import { listen } from "./events.js";
import { drawFindings } from "./findings.js";
import { isGoing, progressOf } from "./jobs.js";
import { complain } from "./messages.js";
import { startTheme } from "./theme.js";

/** @import { Schemas } from "./api_types" */

const FILES = { Report: "report.html", JSON: "results.json", Markdown: "summary.md" };
const ALL = "all";

const column = element("div", { id: "findings" });
const runner = element("section", {});
const progress = optional();
/** @type {Schemas["ExperimentList"]["experiments"]} */
let experiments = [];
/** @type {Schemas["ExperimentList"]["job"]} */
let job = null;
let chosen = ALL;
let quick = true;
let failed = null;

async function begin() {
  failed = null;
  try {
    job = await post("/api/reports/experiments", { name: chosen, quick });
  } catch (error) {
    failed = error;
  }
  drawRunner();
}

const KIND = String("reproduction");
const stop = () => remove(`/api/jobs/${KIND}/${KIND}`).catch(complain);

/** The form, or how far what was begun is, whichever page or window it was begun in. */
function drawRunner() {
  const going = isGoing(job);
  const one = experiments.find((entry) => entry.name === chosen);
  const name = select(
    [
      [ALL, `all ${experiments.length}`],
      ...experiments.map(
        (entry) =>
          /** @type {[string, string]} */ ([entry.name, `${entry.source}: ${entry.title}`]),
      ),
    ],
    chosen,
    {
      ariaLabel: "Experiment",
      disabled: going,
      onchange: ({ target }) => {
        chosen = target.value;
        drawRunner();
      },
    },
  );
  fill(
    runner,
    card(
      "Run an experiment again",
      field("Experiment", name),
      one && hint(one.claim),
      check("a quick look, with fewer seeds, frames and settings", {
        checked: quick,
        disabled: going,
        onchange: ({ target }) => {
          quick = target.checked;
          drawRunner();
        },
      }),
      hint(
        quick
          ? "All of them take about a quarter of an hour."
          : one && !one.is_long
            ? "Ten seeds of every setting."
            : "Ten seeds of every setting take hours. What is measured is kept: it goes on where it was stopped.",
      ),
      !going && !readOnly && actions(button("Run it", begin, "primary")),
      progress,
      failure(failed ?? (job?.state === "failed" ? job : null)),
      job &&
        !going &&
        job.state !== "failed" &&
        hint(
          `${job.name}: ${job.state}${job.state === "done" ? `, ${job.measured} trials run, ${job.kept} kept from before${job.failed ? `, ${job.failed} failed` : ""}` : "; what was measured is kept"}.`,
        ),
    ),
  );
  drawProgress(progress, going ? progressOf(job, "beginning", stop) : null);
}

async function drawReports() {
  const made = (await fetchJson("/api/reports")).experiments;
  const files =
    made.length > 0 &&
    Object.entries(FILES).map(([words, file]) =>
      element("a", { className: "download", href: `/api/reports/${file}`, download: file }, words),
    );
  fill(byId("downloads"), files);
  if (made.length) return drawFindings(column, made, echarts);
  fill(
    column,
    lead(
      "Nothing is reproduced yet. Results appear here, with the paper's claim beside every number.",
    ),
  );
}

async function start() {
  startTheme();
  fill(byId("content"), element("div", { className: "report-column" }, runner, column));
  fill(runner, hint("The experiments are being read …"));
  ({ experiments, job } = await fetchJson("/api/reports/experiments"));
  drawRunner();
  await drawReports();
  listen("reproduction", (now) => {
    const was = job;
    job = now;
    if (isGoing(was) && isGoing(now)) drawProgress(progress, progressOf(now, "beginning", stop));
    else drawRunner();
    if (!isGoing(now)) drawReports().catch(complain);
  });
}

start().catch(complain);
