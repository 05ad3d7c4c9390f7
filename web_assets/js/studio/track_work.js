// What is made of a run's poses in the background: a track refined or smoothed, a frame corrected.
// It stands over the scene while the run is open, with a way to stop it, in every window and after
// every reload; what comes of it is opened in the window that began it, once that shows the studio
// again.

import { fault, fetchJson, post, readOnly, remove, runPath } from "../api.js";
import { openForm } from "./dialogs.js";
import { byId, NAME } from "../elements.js";
import { listen } from "../events.js";
import { findJob, isGoing, progressOf, shareOf } from "../jobs.js";
import { complain, say } from "../messages.js";
import { openSession, refreshSessions } from "../sessions.js";
import { get, set, watch } from "../state.js";
import { loadTracks, RAW, trackWords } from "./tracks.js";
import { html, mount, signal } from "./component.js";
import { VERBS } from "./work_list.js";

/** @typedef {import("../api_types").Schemas["TrackJobState"]} TrackJob */
/**
 * What this window does with what comes of a job.
 * @typedef {{ frame?: number, starts?: boolean }} After
 */

const KEY = "track-jobs";
const MAKING = {
  refine: {
    action: "Refine",
    made: "refined",
    intro:
      "A local search on the silhouettes, frame by frame; no frame gets worse by the run's own likelihood.",
  },
  smooth: {
    action: "Smooth",
    made: "smoothed",
    intro:
      "A filter over time; frames that cannot be believed are left out, gaps filled and marked.",
  },
};

/** The newest job on the open run that goes on. */
const job = signal(/** @type {TrackJob | null} */ (null));

/** Jobs that were heard to end: an answer that was under way meanwhile does not bring them back. */
const ended = new Set();

/**
 * By identifier the jobs that this window began and what it does after them.
 * @returns {Record<string, After>}
 */
const begun = () => JSON.parse(sessionStorage.getItem(KEY) ?? "{}");

/** @param {Record<string, After>} jobs */
const keepBegun = (jobs) => sessionStorage.setItem(KEY, JSON.stringify(jobs));

/**
 * Follow a job that this window has begun.
 * @param {TrackJob} state
 * @param {After} [after] frame: to be shown of the corrected run; starts: whether that is tracked
 *   on
 */
export function followTrackJob(state, after = {}) {
  keepBegun({ ...begun(), [state.identifier]: after });
  job.value = state;
  // It may have ended before its beginning was heard of.
  catchUp();
}

/**
 * Let a job of this window go; what it wanted to do after it, null for a job of another one.
 * @param {string} identifier
 */
function letGo(identifier) {
  const { [identifier]: after = null, ...others } = begun();
  if (after) keepBegun(others);
  return after;
}

/** @param {{ session: string, run: string }} state */
const isHere = ({ session, run }) => session === get("session") && run === get("run");

/** @param {TrackJob} ended */
function sayMade(ended) {
  const [before, after] = [ended.jitter_before_mm ?? 0, ended.jitter_after_mm ?? 0];
  const jitter = `jitter ${before.toPrecision(2)} → ${after.toPrecision(2)} mm a frame²`;
  const changed =
    ended.verb === "refine"
      ? [`${ended.moved} frames moved`]
      : [
          ended.filled && `${ended.filled} frames filled`,
          ended.left_out && `${ended.left_out} left out`,
        ];
  const words = [...changed, jitter].filter(Boolean).join(", ");
  say(`Track ${ended.track} of ${ended.run} is made: ${words}.`);
}

/**
 * Open the corrected run, and track it on where that was wanted.
 * @param {TrackJob} ended
 * @param {After} after
 */
async function openCorrected(ended, { frame, starts }) {
  await refreshSessions();
  openSession(ended.session, ended.made_run);
  const far = ended.state === "cancelled" ? ", as far as it was tracked" : "";
  say(
    `Frame ${frame} of ${ended.run} is corrected in ${ended.made_run}${far}; ${ended.run} is unchanged.`,
  );
  if (starts) await post(`${runPath(ended.session, ended.made_run)}/start`);
  else set({ frame });
}

/** Show what came of a job; in the window that began it. @param {TrackJob} ended */
async function show(ended) {
  const after = letGo(ended.identifier);
  if (!after) return;
  if (ended.state === "failed") throw fault(ended.message, ended.hint);
  if (ended.made_run) return openCorrected(ended, after);
  if (ended.state !== "done") return;
  sayMade(ended);
  if (!isHere(ended)) return;
  await loadTracks();
  set({ track: ended.track });
}

/** Take a job's line away, and show what came of it. @param {TrackJob} state */
function end(state) {
  if (job.value?.identifier === state.identifier) job.value = null;
  return show(state);
}

/** Find what goes on of the open run. */
async function find() {
  const [session, run] = [get("session"), get("run")];
  job.value = null;
  if (!run) return;
  const found = await findJob(
    { session, kind: "track" },
    (line) => line.run === run && isGoing(line),
  );
  if (found && isHere(found) && isGoing(found) && !ended.has(found.identifier)) job.value = found;
}

/** What ended while this window showed another page, or none. */
async function catchUp() {
  for (const identifier of Object.keys(begun())) {
    try {
      const state = await fetchJson(`/api/track-jobs/${identifier}`);
      if (!isGoing(state)) await end(state);
    } catch (error) {
      letGo(identifier);
      // A studio that was started again knows of no job.
      if (error.status !== 404) complain(error);
    }
  }
}

/** @param {import("../api_types").Schemas["Knob"]} knob */
function fieldOf(knob) {
  const common = { name: knob.name, value: knob.default, hint: knob.help };
  if (knob.choices?.length) return { ...common, label: knob.label, choices: knob.choices };
  const label = knob.unit ? `${knob.label} (${knob.unit})` : knob.label;
  const kind = knob.kind === "bool" ? "check" : "number";
  return { ...common, label, kind, min: knob.low, max: knob.high, step: "any" };
}

/**
 * The form that makes a track of a run: refined on the silhouettes, or smoothed in time.
 * @param {string} session
 * @param {string} run
 * @param {"refine" | "smooth"} verb
 */
export async function makeTrackForm(session, run, verb) {
  const path = runPath(session, run);
  const { action, made, intro } = MAKING[verb];
  const known = await fetchJson(`${path}/tracks`).catch(complain);
  if (!known) return;
  const knobs = verb === "refine" ? known.refine_settings : known.smooth_settings;
  /** @type {string[]} */
  const names = known.tracks.map((/** @type {{ name: string }} */ track) => track.name);
  const usual =
    verb === "smooth" && names.includes("refined")
      ? "refined"
      : names.includes("sides")
        ? "sides"
        : RAW;
  const sources = names
    .filter((name) => name !== made)
    .map((name) => ({ value: name, label: trackWords(name) }));
  openForm({
    heading: `${action} ${run}`,
    action,
    intro: `${intro} The search's own poses stay.`,
    rows: [
      [
        { name: "source", label: "From", choices: sources, value: usual },
        { name: "into", label: "Kept as", value: made, ...NAME },
      ],
      ...knobs.map((/** @type {any} */ knob) => [fieldOf(knob)]),
      ...(names.includes(made)
        ? [[{ name: "replace", kind: "check", label: `make ${made} again`, value: true }]]
        : []),
    ],
    send: async (values) => {
      const moved = knobs.filter(
        (/** @type {any} */ knob) => String(values[knob.name]) !== String(knob.default),
      );
      const settings = Object.fromEntries(
        moved.map((/** @type {any} */ { name, kind }) => [
          name,
          ["int", "float"].includes(kind) ? Number(values[name]) : values[name],
        ]),
      );
      const { source, into, replace } = values;
      const request = { source, into, replace: Boolean(replace), settings };
      const state = await post(`${path}/${verb}`, request);
      openSession(session, run);
      followTrackJob(state);
    },
  });
}

function TrackWork() {
  const shown = job.value;
  if (!shown) return null;
  const { words } = progressOf(shown, shown.state === "queued" ? "waiting" : "beginning");
  const name = VERBS[shown.verb] ?? "work";
  return html`<div class="what-if track-work" role="status">
    <span><b>${name[0].toUpperCase() + name.slice(1)}</b> of ${shown.run}: ${words}</span>
    <div class="progress"><i style=${{ width: `${Math.round(100 * (shareOf(shown) ?? 0))}%` }}></i></div>
    ${
      !readOnly &&
      html`<button
        type="button"
        class="quiet small"
        disabled=${shown.state === "cancelling"}
        onClick=${() => remove(`/api/track-jobs/${shown.identifier}`).catch(complain)}
      >
        Cancel
      </button>`
    }
  </div>`;
}

/** Show what goes on over the scene, and what came of it. */
export function startTrackWork() {
  mount(byId("track-work"), html`<${TrackWork} />`);
  listen("track", (state) => {
    if (isGoing(state)) {
      if (isHere(state)) job.value = state;
      return;
    }
    ended.add(state.identifier);
    end(state).catch(complain);
  });
  let at = "";
  watch(["session", "run"], () => {
    const now = `${get("session")}/${get("run")}`;
    if (now === at) return;
    at = now;
    find().catch(complain);
    if (get("connected") && get("run")) catchUp();
  });
  // What this window began before it was loaded again, or while the studio was out of reach, may
  // have ended meanwhile.
  watch(["connected"], () => {
    if (!get("connected")) return;
    // What came of it is shown once the run that the address names is open.
    if (get("run") || !new URLSearchParams(location.search).get("run")) catchUp();
    find().catch(complain);
  });
}
