// The guide takes the theme that every page remembers; what is wider than its place can be scrolled
// by keys. Pages of its course know whether the runs are there that they lead to. The papers'
// claims are drawn of the findings' files.

import { fetchJson, post, readOnly } from "./api.js";
import { button, drawProgress, element, failure, fill, hint } from "./elements.js";
import { askOnEach } from "./events.js";
import { isGoing, progressOf } from "./jobs.js";
import { paced } from "./pacing.js";
import { startTheme } from "./theme.js";

/** @import { Schemas } from "./api_types" */

const PACE_MILLISECONDS = 300;
const RUN = /^course-/;

/**
 * Links of the page into runs of the course, by the runs' names.
 * @returns {[HTMLAnchorElement, string[]][]}
 */
function links() {
  return [...document.querySelectorAll("main a")].flatMap((link) => {
    const { searchParams } = new URL(/** @type {HTMLAnchorElement} */ (link).href);
    const runs = [
      searchParams.get("run"),
      ...(searchParams.get("compared") ?? "").split(",").map((name) => name.split("/")[1]),
    ].filter((name) => name && RUN.test(name));
    return runs.length ? [/** @type {[HTMLAnchorElement, string[]]} */ ([link, runs])] : [];
  });
}

/** Show whether the course's runs are there, and offer to make them. */
async function showCourse() {
  const place = element("div", { className: "course-runs", role: "status" });
  document.querySelector("main h1")?.after(place);
  const progress = element("div", {});
  let shown = "";

  /** @param {Schemas["CourseView"]} course */
  function draw({ runs, job }) {
    const missing = runs.filter((run) => !run.there);
    for (const [link, names] of links()) {
      const absent = names.some((name) => missing.some((run) => run.name === name));
      link.classList.toggle("absent", absent);
      link.title = absent ? "The course's runs are not made yet: see the top of this page." : "";
    }
    const key = isGoing(job) ? "going" : `${missing.length} ${job?.state ?? ""}`;
    if (isGoing(job)) drawProgress(progress, progressOf(job, "The course's runs are being made"));
    if (key === shown) return;
    shown = key;
    if (isGoing(job)) fill(place, progress);
    else if (missing.length) {
      fill(
        place,
        job?.state === "failed" && failure(job),
        hint(
          `${missing.length} of the course's ${runs.length} runs are not made yet; the links need them.`,
        ),
        !readOnly && button("Make the course's runs", begin, "primary"),
        hint("Forty frames each, a minute or two in all."),
      );
    } else fill(place, hint("The course's runs are there: every link opens one of them."));
  }

  async function begin() {
    try {
      await post("/api/course");
    } catch (error) {
      fill(place, failure(error));
    }
    look();
  }

  const look = paced(async () => {
    await fetchJson("/api/course").then(draw, console.error);
  }, PACE_MILLISECONDS);
  askOnEach("course", look);
  look();
}

/** Draw what the reproductions found. @param {HTMLElement} place */
async function showFindings(place) {
  const files = (place.dataset.files ?? "").split(" ").filter(Boolean);
  const [echarts, { drawFindings }, experiments] = await Promise.all([
    import("../vendor/echarts.esm.min.js"),
    import("./findings.js"),
    Promise.all(files.map(async (file) => (await fetch(file)).json())),
  ]);
  if (experiments.length) drawFindings(place, experiments, echarts);
}

startTheme();
const findings = document.getElementById("findings");
if (findings) showFindings(findings).catch(console.error);
for (const block of document.querySelectorAll("pre"))
  if (block.scrollWidth > block.clientWidth) block.tabIndex = 0;
if (links().length || location.pathname === "/guide/course") showCourse().catch(console.error);
