// The work in the background, wherever it was begun: how far it is, a way to stop it, and where its
// answer is. Every page that shows this finds a job again after a reload, in another window and
// after Back.

import { fetchJson, readOnly, remove } from "../api.js";
import { listenToAll, listenToGaps } from "../events.js";
import { isGoing, shareOf, standing, timeLeft } from "../jobs.js";
import { complain } from "../messages.js";
import { paced } from "../pacing.js";
import { html, mount, signal, useEffect, useSignal } from "./component.js";

/** @typedef {import("../api_types").Schemas["JobLine"]} JobLine */

const PACE_MILLISECONDS = 700;
/** What a job on a run's poses does. @type {Record<string, string>} */
export const VERBS = {
  refine: "refining",
  smooth: "smoothing",
  check: "check of the motion",
  correct: "correction",
  pose: "search around a pose",
};
/** @type {Record<string, string>} */
const ENDS = { done: "done", failed: "failed", cancelled: "cancelled" };

const lines = signal(/** @type {JobLine[]} */ ([]));

const load = paced(async () => {
  try {
    lines.value = (await fetchJson("/api/jobs")).jobs.toReversed();
  } catch (error) {
    complain(error);
  }
}, PACE_MILLISECONDS);

/** @param {JobLine} job */
const nameOf = (job) => (job.verb && VERBS[job.verb]) || job.noun;

/** @param {JobLine} job */
const placeOf = (job) => [job.session, job.run || job.name].filter(Boolean).join(" / ");

/** @param {JobLine} job */
const stop = (job) =>
  remove(`/api/jobs/${encodeURIComponent(job.kind)}/${job.key}`).then(load, complain);

/** How far a job is, in words. @param {JobLine} job */
function wordsOf(job) {
  if (!isGoing(job)) return [ENDS[job.state], job.state === "failed" && job.message];
  return [
    standing(job, job.state === "queued" ? "waiting" : "beginning"),
    timeLeft(job.seconds_left),
  ];
}

/** @param {{ job: JobLine }} properties */
function JobRow({ job }) {
  const going = isGoing(job);
  return html`<li data-state=${job.state}>
    <div class="job-name"><b>${nameOf(job)}</b> <span>${placeOf(job)}</span></div>
    <div class="hint">${wordsOf(job).filter(Boolean).join(" · ")}</div>
    ${
      going &&
      html`<div class="long-progress">
        <i style=${{ width: `${Math.round(100 * (shareOf(job) ?? 0))}%` }}></i>
      </div>`
    }
    <div class="group">
      ${job.page && html`<a class="download small" href=${job.page}>${going ? "Look" : "Open"}</a>`}
      ${
        going &&
        !readOnly &&
        html`<button
          type="button"
          class="quiet small"
          disabled=${job.state === "cancelling"}
          aria-label=${`Cancel the ${nameOf(job)} of ${placeOf(job)}`}
          onClick=${() => stop(job)}
        >
          Cancel
        </button>`
      }
    </div>
  </li>`;
}

/** The button in the header and its list. */
function WorkList() {
  const open = useSignal(false);
  useEffect(() => {
    /** @param {KeyboardEvent | PointerEvent} event */
    const close = (event) => {
      const inside = event.target instanceof Element && event.target.closest(".work-list");
      if (event instanceof KeyboardEvent ? event.key === "Escape" : !inside) open.value = false;
    };
    document.addEventListener("keydown", close);
    document.addEventListener("pointerdown", close);
    return () => {
      document.removeEventListener("keydown", close);
      document.removeEventListener("pointerdown", close);
    };
  }, []);
  const going = lines.value.filter(isGoing);
  if (!lines.value.length) return null;
  const share = going.length === 1 ? shareOf(going[0]) : null;
  const count = going.length === 1 ? "1 job" : `${going.length} jobs`;
  const words = going.length
    ? `${count}${share === null ? "" : ` ${Math.round(100 * share)} %`}`
    : "Jobs";
  const title = going.length
    ? going.map((job) => `${nameOf(job)} of ${placeOf(job)}`).join(", ")
    : "Work in the background: how it ended, and where its answer is";
  return html`<div class="work-list">
    <button
      type="button"
      class="quiet small"
      data-going=${going.length || null}
      aria-expanded=${String(open.value)}
      title=${title}
      onClick=${() => {
        open.value = !open.value;
      }}
    >
      ${words}
    </button>
    ${
      open.value &&
      html`<section class="work-lines" aria-label="Work in the background">
        <ul>
          ${lines.value.map((job) => html`<${JobRow} key=${`${job.kind}/${job.key}`} job=${job} />`)}
        </ul>
      </section>`
    }
  </div>`;
}

/** Show the list in the page's header. */
export function startWorkList() {
  const place = document.getElementById("work-list");
  if (!place) return;
  // The reports of a job have a step; the end of anything else may have begun or ended one.
  listenToAll((event) => {
    if ("at" in event || event.type === "sessions") load();
  });
  listenToGaps((isOpen) => isOpen && load());
  mount(place, html`<${WorkList} />`);
  load();
}
