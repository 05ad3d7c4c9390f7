// The arena: a race of optimisers begun, and the last one drawn as on its own page.

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
  number,
  optional,
  table,
} from "./elements.js";
import { listen } from "./events.js";
import { drawFindings } from "./findings.js";
import { isGoing, progressOf } from "./jobs.js";
import { complain } from "./messages.js";
import { drawRace } from "./race_drawing.js";
import { startTheme } from "./theme.js";

/** @import { Schemas } from "./api_types" */

const runner = element("section", {});
const picture = element("section", {});
const findings = element("div", { id: "findings" });
const progress = optional();
/** @type {Schemas["Arena"] | null} */
let known = null;
/** @type {Schemas["Arena"]["job"]} */
let job = null;
const chosen = { problems: new Set(), racers: new Set() };
let evaluations = 10_000;
let seeds = 5;
let failed = null;

async function begin() {
  failed = null;
  try {
    job = await post("/api/arena/race", {
      problems: [...chosen.problems],
      racers: [...chosen.racers],
      evaluations,
      seeds,
    });
  } catch (error) {
    failed = error;
  }
  drawRunner();
}

const [KIND, KEY] = ["race", "arena"].map(String);
const stop = () => remove(`/api/jobs/${KIND}/${KEY}`).catch(complain);

/** @param {Set<string>} names @param {string} name @param {string} words @param {string} [title] */
const choice = (names, name, words, title = "") =>
  check(
    words,
    {
      checked: names.has(name),
      disabled: isGoing(job),
      onchange: ({ target }) => (target.checked ? names.add(name) : names.delete(name)),
    },
    title,
  );

/** The form, or how far what was begun is. */
function drawRunner() {
  if (!known) return;
  const going = isGoing(job);
  const least = (value, few) => Math.max(few, Math.round(Number(value)) || few);
  fill(
    runner,
    card(
      "Race optimisers on frames",
      hint(
        "A frame's likelihood as a black box: every racer begins where the frame before ended and may weigh as many poses. No footage is needed. With nothing ticked all take part.",
      ),
      element(
        "div",
        { className: "race-choices" },
        element(
          "fieldset",
          {},
          element("legend", {}, "Racers"),
          known.racers.map((one) => choice(chosen.racers, one.name, one.label, one.name)),
        ),
        element(
          "fieldset",
          {},
          element("legend", {}, "Problems"),
          known.problems.map((one) =>
            choice(
              chosen.problems,
              one.name,
              `${one.name}, ${one.dimensions} parameters, ${one.kind}`,
              one.about,
            ),
          ),
        ),
        element(
          "div",
          { className: "race-numbers" },
          field(
            "Evaluations a problem",
            number(evaluations, {
              min: 10,
              step: 1,
              disabled: going,
              onchange: ({ target }) => {
                evaluations = least(target.value, 10);
              },
            }),
          ),
          field(
            "Seeds",
            number(seeds, {
              min: 1,
              step: 1,
              disabled: going,
              onchange: ({ target }) => {
                seeds = least(target.value, 1);
              },
            }),
          ),
        ),
      ),
      !going && !readOnly && actions(button("Race", begin, "primary")),
      progress,
      failure(failed ?? (job?.state === "failed" ? job : null)),
      job &&
        !going &&
        job.state !== "failed" &&
        hint(
          `The race is ${job.state}${job.state === "done" ? `: ${job.measured} trials run, ${job.kept} kept from before` : "; what was measured is kept"}.`,
        ),
      hint(
        "A racer of your own is one file: the guide's page ",
        element("a", { href: "/guide/adding#a-racer" }, "Adding your own"),
        " has it.",
      ),
    ),
  );
  drawProgress(progress, going ? progressOf(job, "beginning", stop) : null);
}

function drawLast() {
  const race = known?.race;
  fill(
    byId("downloads"),
    race &&
      element(
        "a",
        { className: "download", href: "/api/arena/race.html", download: "race.html" },
        "Page",
      ),
  );
  if (race) {
    drawRace(picture, race.drawn);
    drawFindings(findings, [race.findings], echarts);
    return;
  }
  fill(
    findings,
    lead(
      "No race yet. Profiles, expected running times and a picture of who is where appear here.",
    ),
    table(
      ["Problem", "Kind", "Parameters", "Likelihood", "From"],
      (known?.problems ?? []).map((one) => [
        one.name,
        one.kind,
        one.dimensions,
        one.weighting,
        one.about,
      ]),
    ),
  );
}

async function read() {
  known = await fetchJson("/api/arena");
  ({ job } = known);
  drawRunner();
  drawLast();
}

async function start() {
  startTheme();
  fill(byId("content"), element("div", { className: "report-column" }, runner, picture, findings));
  fill(runner, hint("The problems are being read …"));
  await read();
  listen("race", (now) => {
    const was = job;
    job = now;
    if (isGoing(was) && isGoing(now)) drawProgress(progress, progressOf(now, "beginning", stop));
    else drawRunner();
    if (!isGoing(now)) read().catch(complain);
  });
}

start().catch(complain);
