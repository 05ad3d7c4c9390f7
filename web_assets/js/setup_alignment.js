// Do the cameras agree? How far silhouettes miss, camera by camera; turning the cameras until they
// do, and back.

import { fetchJson, post, remove, sessionPath } from "./api.js";
import {
  actions,
  button,
  dotted,
  drawProgress,
  element,
  failure,
  fill,
  hint,
  notice,
  optional,
  percent,
  table,
} from "./elements.js";
import { isGoing, timeLeft } from "./jobs.js";
import { complain } from "./messages.js";

const WHY =
  "A tripod that was touched after the calibration turns a camera by a degree, or twenty pixels. Silhouettes show it, without a board.";
const pixels = (value) => (value === null ? "–" : `${value.toFixed(1)} px`);

/**
 * The box in `place`; `changed()` is called when the session has other cameras. Returns {load,
 * measure, stop}.
 * @param {import("./setup.js").Setup} setup
 */
export function alignmentBox(setup, place, changed) {
  const here = /** @type {const} */ (`${sessionPath(setup.session)}/alignment`);
  /** @type {import("./api_types").Schemas["AlignmentAnswer"] | null} */
  let alignment = null;
  let failed = null;
  let busy = false;
  let stopped = false;
  let requested = false; // whether the user requested the measurement

  function verdict(job) {
    if (job.kept) return "The session uses the turned cameras.";
    if (!job.needed) return "The cameras agree: no correction is needed.";
    return job.better ? `${job.words} Lenses and positions stay as they are.` : job.words;
  }

  function turning(job, turned) {
    const turn =
      job?.needed &&
      job.better &&
      !job.kept &&
      button("Turn the cameras", () => change("keep"), "small", {
        disabled: busy,
        title: "The previous calibration is kept; results made with it are marked as out of date.",
      });
    const back =
      turned &&
      button("Turn them back", () => change("undo"), "small quiet", {
        disabled: busy,
        title: "Restore the calibration from before the cameras were turned.",
      });
    return (turn || back) && actions(turn, back);
  }

  function draw() {
    if (stopped || !alignment) return;
    const { job, possible, turned, notes } = alignment;
    place.hidden = !possible;
    const going = isGoing(job);
    const done = job?.state === "done" ? job : null;
    const error = failed ?? (job?.state === "failed" ? job : null);
    const bar = optional();
    fill(
      place,
      element(
        "div",
        { className: "head-line" },
        element("h2", {}, "Do the cameras agree?"),
        button(
          done ? "Measure again" : "Measure",
          () => {
            requested = true;
            return measure();
          },
          "small",
          { disabled: going || busy, ariaLabel: "Measure whether the cameras agree" },
        ),
      ),
      bar,
      done && [
        table(
          ["camera", "misses by", "turned by", done.kept ? "misses now by" : "would miss by"],
          done.cameras.map((line) => [
            line.camera,
            pixels(line.before_px),
            line.turn_degrees === null ? "–" : `${line.turn_degrees.toFixed(2)}°`,
            pixels(line.after_px),
          ]),
        ),
        (done.needed && !done.kept ? notice : hint)(verdict(done)),
      ],
      !done &&
        !going &&
        hint(turned ? "The cameras in use were turned by their silhouettes." : WHY),
      turning(done, turned),
      notes.map((note) => notice(note)),
      // What was measured unasked raises no alarm.
      requested || failed ? failure(error) : error && hint(`${error.message} ${error.hint ?? ""}`),
    );
    if (!job || !going) return;
    const measuring = !job.total || job.done < job.total;
    drawProgress(bar, {
      words: dotted(
        measuring ? job.step || "beginning" : "turning the cameras",
        measuring && job.done > 0 && percent(job.done / job.total),
        timeLeft(job.seconds_left),
      ),
      share: job.total ? job.done / job.total : null,
      cancel: () => remove(here).catch(complain),
    });
  }

  async function load() {
    alignment = await fetchJson(here);
    draw();
  }

  async function measure() {
    failed = null;
    try {
      const job = await post(here);
      if (alignment) alignment = { ...alignment, job, notes: [] };
    } catch (error) {
      failed = error;
    }
    draw();
  }

  /** @param {"keep" | "undo"} how */
  async function change(how) {
    failed = null;
    busy = true;
    draw();
    try {
      alignment = await post(`${here}/${how}`);
      changed();
    } catch (error) {
      failed = error;
    }
    busy = false;
    draw();
  }

  setup.on("alignment", (job) => {
    if (!alignment) return;
    alignment = { ...alignment, job };
    draw();
    if (!isGoing(job)) setup.refresh().catch(complain);
  });

  return {
    load,
    measure,
    stop: () => {
      stopped = true;
    },
  };
}
