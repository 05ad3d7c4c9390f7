// The run's tracks: which one scene, charts and views show; refining and smoothing, with progress and a way to stop.

import { fetchJson, post, remove, runPath } from "./api.js";
import { openForm, whileOpen } from "./dialogs.js";
import { byId, NAME, offer } from "./elements.js";
import { followJob, standing } from "./jobs.js";
import { onEvent } from "./live.js";
import { complain, say } from "./messages.js";
import { openSession } from "./sessions.js";
import { get, set, watch } from "./state.js";

const choice = byId("track-choice");
const RAW = "raw";
const VERBS = {
  refine: { action: "Refine", going: "Refining…", made: "refined", intro: "A local search on the silhouettes, frame by frame; no frame gets worse by the run's own likelihood." },
  smooth: { action: "Smooth", going: "Smoothing…", made: "smoothed", intro: "A filter over time; frames that cannot be believed are left out, gaps filled and marked." },
};
const trackWords = (name) => (name === RAW ? "as searched" : name);
const named = (track) => trackWords(track.name) + (track.mean_mm === null || track.mean_mm === undefined ? "" : ` · ${track.mean_mm.toPrecision(3)} mm`);

/** Load which tracks the run has, and offer them. */
async function loadTracks() {
  const [session, run] = [get("session"), get("run")];
  if (!run) { choice.hidden = true; return; }
  try {
    const { tracks } = await fetchJson(`${runPath(session, run)}/tracks`);
    if (session !== get("session") || run !== get("run")) return;
    offer(choice, tracks.map((track) => [track.name, named(track)]), get("track"));
    choice.hidden = tracks.length < 2;
    if (tracks.some((track) => track.name === get("track"))) return;
    say(`${run} has no track “${get("track")}”: the poses as searched are shown.`, { kind: "warning" });
    set({ track: RAW });
  } catch (error) { if (error.status !== 404) complain(error); }
}

function fieldOf(knob) {
  const common = { name: knob.name, value: knob.default, hint: knob.help };
  if (knob.choices?.length) return { ...common, label: knob.label, choices: knob.choices };
  return { ...common, label: knob.unit ? `${knob.label} (${knob.unit})` : knob.label, kind: knob.kind === "bool" ? "check" : "number", min: knob.low, max: knob.high, step: "any" };
}

const given = (value, knob) => (knob.kind === "int" || knob.kind === "float" ? Number(value) : value);

/** The form that makes a track of a run: refined on the silhouettes, or smoothed in time. @param {"refine" | "smooth"} verb */
export async function makeTrackForm(session, run, verb) {
  const path = runPath(session, run);
  const { action, going, made, intro } = VERBS[verb];
  const known = await fetchJson(`${path}/tracks`).catch(complain);
  if (!known) return;
  const knobs = verb === "refine" ? known.refine_settings : known.smooth_settings;
  const names = known.tracks.map((track) => track.name);
  const usual = verb === "smooth" && names.includes("refined") ? "refined" : names.includes("sides") ? "sides" : RAW;
  openForm({
    heading: `${action} ${run}`, action, intro: `${intro} The search's own poses stay.`,
    rows: [[{ name: "source", label: "From", choices: names.filter((name) => name !== made).map((name) => ({ value: name, label: trackWords(name) })), value: usual }, { name: "into", label: "Kept as", value: made, ...NAME }],
      ...knobs.map((knob) => [fieldOf(knob)]), ...(names.includes(made) ? [[{ name: "replace", kind: "check", label: `make ${made} anew`, value: true }]] : [])],
    send: async (values, report) => {
      const settings = Object.fromEntries(knobs.filter((knob) => String(values[knob.name]) !== String(knob.default)).map((knob) => [knob.name, given(values[knob.name], knob)]));
      const { identifier } = await post(`${path}/${verb}`, { source: values.source, into: values.into, replace: Boolean(values.replace), settings });
      report(going);
      const stop = () => remove(`/api/track-jobs/${identifier}`).catch(() => {});
      const ended = await whileOpen(stop, () => followJob(`/api/track-jobs/${identifier}`, (job) => report(standing(job, going))));
      if (ended.state === "cancelled") return;
      sayMade(ended, run);
      openSession(session, run);
      await loadTracks();
      set({ track: ended.track });
    },
  });
}

function sayMade(ended, run) {
  const jitter = `jitter ${ended.jitter_before_mm.toPrecision(2)} → ${ended.jitter_after_mm.toPrecision(2)} mm a frame²`;
  const words = ended.verb === "refine" ? [`${ended.moved} frames moved`] : [ended.filled && `${ended.filled} frames filled`, ended.left_out && `${ended.left_out} left out`];
  say(`Track ${ended.track} of ${run} is made: ${[...words, jitter].filter(Boolean).join(", ")}.`);
}

/** Wire the choice of the track. */
export function startTracks() {
  choice.onchange = () => set({ track: choice.value });
  let shown = "";
  watch(["session", "run", "parameters"], () => {
    // Timeline and frame come first, then what is known of the run.
    const run = `${get("session")}/${get("run")}`;
    if (run === shown || (get("run") && !get("parameters"))) return;
    shown = run;
    loadTracks();
  });
  watch(["track"], () => {
    choice.value = get("track");
    if (get("session")) post("/api/scene/show", { options: { track: get("track") } }).catch(complain);
  });
  onEvent("track", (event, here) => { if (here && event.state === "done" && event.track) loadTracks(); });
}
