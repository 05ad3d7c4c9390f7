// The run's tracks: which one scene, charts and views show; refining and smoothing, with progress and a way to stop.

import { fetchJson, post, remove, runPath } from "../api.js";
import { openForm, whileOpen } from "./dialogs.js";
import { byId, NAME } from "../elements.js";
import { followJob, standing } from "../jobs.js";
import { onEvent } from "../live.js";
import { complain, say } from "../messages.js";
import { openSession } from "../sessions.js";
import { get, set, watch } from "../state.js";
import { follow, html, mount, signal } from "./component.js";

const RAW = "raw";
const VERBS = {
  refine: {
    action: "Refine",
    going: "Refining…",
    made: "refined",
    intro:
      "A local search on the silhouettes, frame by frame; " +
      "no frame gets worse by the run's own likelihood.",
  },
  smooth: {
    action: "Smooth",
    going: "Smoothing…",
    made: "smoothed",
    intro:
      "A filter over time; frames that cannot be believed are left out, gaps filled and marked.",
  },
};

/** The tracks of the run that is open. */
const tracks = signal(/** @type {any[]} */ ([]));

/** Whether the open run has a track. @param {string} name */
export const hasTrack = (name) => tracks.value.some((track) => track.name === name);

const trackWords = (name) => (name === RAW ? "as searched" : name);
const errorWords = ({ mean_mm: mean }) => (mean == null ? "" : ` · ${mean.toPrecision(3)} mm`);

/** Which track is shown: a choice, where there is more than the search's own. */
function TrackChoice() {
  const shown = follow("track");
  return html`<select
    id="track-choice"
    hidden=${tracks.value.length < 2}
    aria-label="Track"
    title="Whose poses scene, charts and views show"
    value=${shown}
    onChange=${({ currentTarget }) => set({ track: currentTarget.value })}
  >
    ${tracks.value.map(
      (track) =>
        html`<option key=${track.name} value=${track.name} selected=${track.name === shown}>
          ${trackWords(track.name)}${errorWords(track)}
        </option>`,
    )}
  </select>`;
}

/** Load which tracks the run has. */
async function loadTracks() {
  const [session, run] = [get("session"), get("run")];
  if (!run) {
    tracks.value = [];
    return;
  }
  try {
    const known = await fetchJson(`${runPath(session, run)}/tracks`);
    if (session !== get("session") || run !== get("run")) return;
    tracks.value = known.tracks;
    if (hasTrack(get("track"))) return;
    const words = `${run} has no track “${get("track")}”: the poses as searched are shown.`;
    say(words, { kind: "warning" });
    set({ track: RAW });
  } catch (error) {
    if (/** @type {any} */ (error).status !== 404) complain(error);
  }
}

function fieldOf(knob) {
  const common = { name: knob.name, value: knob.default, hint: knob.help };
  if (knob.choices?.length) return { ...common, label: knob.label, choices: knob.choices };
  return {
    ...common,
    label: knob.unit ? `${knob.label} (${knob.unit})` : knob.label,
    kind: knob.kind === "bool" ? "check" : "number",
    min: knob.low,
    max: knob.high,
    step: "any",
  };
}

const given = (value, knob) =>
  knob.kind === "int" || knob.kind === "float" ? Number(value) : value;

/**
 * The form that makes a track of a run: refined on the silhouettes, or smoothed in time.
 * @param {string} session @param {string} run @param {"refine" | "smooth"} verb
 */
export async function makeTrackForm(session, run, verb) {
  const path = runPath(session, run);
  const { action, going, made, intro } = VERBS[verb];
  const known = await fetchJson(`${path}/tracks`).catch(complain);
  if (!known) return;
  const knobs = verb === "refine" ? known.refine_settings : known.smooth_settings;
  const names = known.tracks.map((track) => track.name);
  const refined = verb === "smooth" && names.includes("refined");
  const usual = refined ? "refined" : names.includes("sides") ? "sides" : RAW;
  const choices = names
    .filter((name) => name !== made)
    .map((name) => ({ value: name, label: trackWords(name) }));
  const isMoved = (values) => (knob) => String(values[knob.name]) !== String(knob.default);
  openForm({
    heading: `${action} ${run}`,
    action,
    intro: `${intro} The search's own poses stay.`,
    rows: [
      [
        { name: "source", label: "From", choices, value: usual },
        { name: "into", label: "Kept as", value: made, ...NAME },
      ],
      ...knobs.map((knob) => [fieldOf(knob)]),
      ...(names.includes(made)
        ? [[{ name: "replace", kind: "check", label: `make ${made} again`, value: true }]]
        : []),
    ],
    send: async (values, report) => {
      const moved = knobs.filter(isMoved(values));
      const { identifier } = await post(`${path}/${verb}`, {
        source: values.source,
        into: values.into,
        replace: Boolean(values.replace),
        settings: Object.fromEntries(
          moved.map((knob) => [knob.name, given(values[knob.name], knob)]),
        ),
      });
      report(going);
      /** @type {`/api/track-jobs/${string}`} */
      const job = `/api/track-jobs/${identifier}`;
      const stop = () => remove(job).catch(() => {});
      const ended = await whileOpen(stop, () =>
        followJob(job, (state) => report(standing(state, going))),
      );
      if (ended.state === "cancelled") return;
      sayMade(ended, run);
      openSession(session, run);
      await loadTracks();
      set({ track: ended.track });
    },
  });
}

function sayMade(ended, run) {
  const [before, after] = [ended.jitter_before_mm, ended.jitter_after_mm];
  const jitter = `jitter ${before.toPrecision(2)} → ${after.toPrecision(2)} mm a frame²`;
  const words =
    ended.verb === "refine"
      ? [`${ended.moved} frames moved`]
      : [
          ended.filled && `${ended.filled} frames filled`,
          ended.left_out && `${ended.left_out} left out`,
        ];
  const all = [...words, jitter].filter(Boolean).join(", ");
  say(`Track ${ended.track} of ${run} is made: ${all}.`);
}

/** Show the choice of the track, and let the scene follow it. */
export function startTracks() {
  mount(byId("track-choice-place"), html`<${TrackChoice} />`);
  let shown = "";
  watch(["session", "run", "parameters"], () => {
    // Timeline and frame come first, then what is known of the run.
    const run = `${get("session")}/${get("run")}`;
    if (run === shown || (get("run") && !get("parameters"))) return;
    shown = run;
    loadTracks();
  });
  watch(["track"], () => {
    if (!get("session")) return;
    post("/api/scene/show", { options: { track: get("track") } }).catch(complain);
  });
  onEvent("track", (event, here) => {
    if (here && event.state === "done" && event.track) loadTracks();
  });
}
