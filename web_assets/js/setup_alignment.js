// Do the cameras agree? How far silhouettes miss, camera by camera; turning the cameras until they
// do, and back.

import { fetchJson, post, remove, sessionPath } from "./api.js";
import { dotted, percent } from "./elements.js";
import { isGoing, timeLeft } from "./jobs.js";
import { complain } from "./messages.js";
import { attempting, html, signal } from "./studio/component.js";
import { Action, Failure, Progress, Table } from "./studio/parts.js";

/** @import { Schemas } from "./api_types" */
/** @typedef {NonNullable<Schemas["AlignmentAnswer"]["job"]>} Job */

const WHY =
  "A tripod that was touched after the calibration turns a camera by a degree, or twenty pixels. " +
  "Silhouettes show it, without a board.";
const pixels = (/** @type {number | null} */ value) =>
  value === null ? "–" : `${value.toFixed(1)} px`;
const degrees = (/** @type {number | null} */ value) =>
  value === null ? "–" : `${value.toFixed(2)}°`;

/**
 * What is known of the cameras' agreement, and what can be done; `changed()` is called when the
 * session has other cameras.
 * @param {import("./setup.js").Setup} setup
 * @param {() => void} changed
 */
export function alignmentOf(setup, changed) {
  const here = /** @type {const} */ (`${sessionPath(setup.session)}/alignment`);
  const alignment = signal(/** @type {Schemas["AlignmentAnswer"] | null} */ (null));
  const failed = signal(/** @type {any} */ (null));
  const attempt = attempting(failed);
  /** Whether the person asked for the measurement: what was measured unasked raises no alarm. */
  const isRequested = signal(false);

  const measure = () =>
    attempt(async () => {
      const job = await post(here);
      if (alignment.value) alignment.value = { ...alignment.value, job, notes: [] };
    });

  setup.on("alignment", (job) => {
    if (!alignment.value) return;
    alignment.value = { ...alignment.value, job };
    if (!isGoing(job)) setup.refresh().catch(complain);
  });

  return {
    alignment,
    failed,
    isRequested,
    measure,
    load: async () => {
      alignment.value = await fetchJson(here);
    },
    request: () => {
      isRequested.value = true;
      return measure();
    },
    /** Turn the cameras as measured, or back. @param {"keep" | "undo"} how */
    change: (how) =>
      attempt(async () => {
        alignment.value = await post(`${here}/${how}`);
        changed();
      }),
    cancel: () => remove(here).catch(complain),
  };
}

/** @param {Job} job */
function verdictOf(job) {
  if (job.kept) return "The session uses the turned cameras.";
  if (!job.needed) return "The cameras agree: no correction is needed.";
  return job.better ? `${job.words} Lenses and positions stay as they are.` : job.words;
}

/** How far a measurement is, as `Progress` takes it. @param {Job} job */
function standingOf(job) {
  const measuring = !job.total || job.done < job.total;
  return {
    words: dotted(
      measuring ? job.step || "beginning" : "turning the cameras",
      measuring && job.done > 0 && percent(job.done / job.total),
      timeLeft(job.seconds_left),
    ),
    share: job.total ? job.done / job.total : null,
  };
}

/** @param {{ job: Job }} properties */
const MissTable = ({ job }) => html`
  <${Table}
    heads=${["camera", "misses by", "turned by", job.kept ? "misses now by" : "would miss by"]}
    rows=${job.cameras.map((line) => [
      line.camera,
      pixels(line.before_px),
      degrees(line.turn_degrees),
      pixels(line.after_px),
    ])}
  />
  <p class=${job.needed && !job.kept ? "notice" : "hint"}>${verdictOf(job)}</p>
`;

/** The box. @param {{ model: ReturnType<typeof alignmentOf> }} properties */
export function AlignmentBox({ model }) {
  const known = model.alignment.value;
  if (!known?.possible) return null;
  const { job, turned, notes } = known;
  const isUnderWay = isGoing(job);
  const done = job?.state === "done" ? job : null;
  const failed = model.failed.value;
  const error = failed ?? (job?.state === "failed" ? job : null);
  const canTurn = done?.needed && done.better && !done.kept;
  return html`<section class="background-quality">
    <div class="head-line">
      <h2>Do the cameras agree?</h2>
      <${Action}
        kind="small"
        act=${model.request}
        disabled=${isUnderWay}
        aria-label="Measure whether the cameras agree"
      >
        ${done ? "Measure again" : "Measure"}
      </${Action}>
    </div>
    ${job && isUnderWay && html`<${Progress} ...${standingOf(job)} cancel=${model.cancel} />`}
    ${done && html`<${MissTable} job=${done} />`}
    ${
      !done &&
      !isUnderWay &&
      html`<p class="hint">
        ${turned ? "The cameras in use were turned by their silhouettes." : WHY}
      </p>`
    }
    ${
      (canTurn || turned) &&
      html`<div class="step-actions">
        ${
          canTurn &&
          html`<${Action}
            kind="small"
            act=${() => model.change("keep")}
            title="The previous calibration is kept; results made with it are marked as out of date."
          >
            Turn the cameras
          </${Action}>`
        }
        ${
          turned &&
          html`<${Action}
            kind="small quiet"
            act=${() => model.change("undo")}
            title="Restore the calibration from before the cameras were turned."
          >
            Turn them back
          </${Action}>`
        }
      </div>`
    }
    ${notes.map((note) => html`<p class="notice">${note}</p>`)}
    ${
      error &&
      (model.isRequested.value || failed
        ? html`<${Failure} error=${error} />`
        : html`<p class="hint">${error.message} ${error.hint ?? ""}</p>`)
    }
  </section>`;
}
