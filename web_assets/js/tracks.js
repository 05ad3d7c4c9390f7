// The run's tracks: which one scene, charts and views show; refining and smoothing, with progress and a way to stop.

import { fetchJson, post, remove, runPath } from "./api.js";
import { openForm } from "./dialogs.js";
import { followJob, standing } from "./jobs.js";
import { onEvent } from "./live.js";
import { complain, say } from "./messages.js";
import { openSession } from "./rail.js";
import { get, set, watch } from "./state.js";

const choice = document.getElementById("track-choice");
const RAW = "raw";
const WORDS = { refine: ["Refining", "refined"], smooth: ["Smoothing", "smoothed"] };
const named = (line) => (line.name === RAW ? "as searched" : line.name) + (line.mean_mm === null || line.mean_mm === undefined ? "" : ` · ${line.mean_mm.toPrecision(3)} mm`);

/** Ask which tracks the run has, and offer them. */
async function loadTracks() {
  const [session, run] = [get("session"), get("run")];
  if (!run) { choice.hidden = true; return; }
  try {
    const told = await fetchJson(`${runPath(session, run)}/tracks`);
    if (session !== get("session") || run !== get("run")) return;
    const names = told.tracks.map((line) => line.name);
    choice.replaceChildren(...told.tracks.map((line) => new Option(named(line), line.name, false, line.name === get("track"))));
    choice.hidden = names.length < 2;
    if (!names.includes(get("track"))) set({ track: RAW });
  } catch (error) { if (error.status !== 404) complain(error); }
}

function rowsOf(knobs) {
  return knobs.map((knob) => [knob.choices?.length
    ? { name: knob.name, label: knob.label, choices: knob.choices, value: knob.default, hint: knob.help }
    : { name: knob.name, label: knob.unit ? `${knob.label} (${knob.unit})` : knob.label, kind: knob.kind === "bool" ? "check" : "number", min: knob.low, max: knob.high, step: "any", value: knob.default, hint: knob.help }]);
}

const given = (value, knob) => (knob.kind === "int" || knob.kind === "float" ? Number(value) : value);

/** The form that makes a track of a run: refined on the silhouettes, or smoothed in time. */
export async function makeTrackForm(session, run, verb) {
  const path = runPath(session, run);
  const [going, made] = WORDS[verb];
  let told;
  try { told = await fetchJson(`${path}/tracks`); } catch (error) { return complain(error); }
  const knobs = verb === "refine" ? told.refine_settings : told.smooth_settings;
  const names = told.tracks.map((line) => line.name);
  const usual = verb === "smooth" && names.includes("refined") ? "refined" : names.includes("sides") ? "sides" : RAW;
  const replaces = names.includes(made);
  openForm({
    heading: `${verb === "refine" ? "Refine" : "Smooth"} ${run}`, action: verb === "refine" ? "Refine" : "Smooth",
    intro: `${verb === "refine" ? "A local search on the silhouettes, frame by frame; no frame gets worse in the eyes of the run's weighting." : "A filter over time; frames that cannot be believed are left out, gaps filled and marked."} The search's own poses stay.`,
    rows: [[{ name: "source", label: "From", choices: names.filter((name) => name !== made).map((name) => ({ value: name, label: name === RAW ? "as searched" : name })), value: usual },
      { name: "into", label: "Kept as", value: made, required: true, pattern: "[A-Za-z0-9_\\-]{1,64}", title: "Letters, digits, - and _, up to 64" }],
    ...rowsOf(knobs), ...(replaces ? [[{ name: "replace", kind: "check", label: `make ${made} anew`, value: true }]] : [])],
    send: async (values, report) => {
      const settings = Object.fromEntries(knobs.filter((knob) => String(values[knob.name]) !== String(knob.default)).map((knob) => [knob.name, given(values[knob.name], knob)]));
      const begun = await post(`${path}/${verb}`, { source: values.source, into: values.into, replace: Boolean(values.replace), settings });
      const dialog = document.getElementById("dialog");
      const stop = () => { remove(`/api/track-jobs/${begun.identifier}`).catch(() => {}); };
      dialog.addEventListener("close", stop, { once: true });
      report(`${going}…`);
      try {
        const ended = await followJob(`/api/track-jobs/${begun.identifier}`, (job) => report(standing(job, `${going}…`)));
        if (ended.state === "cancelled") return;
        tell(ended, run);
        openSession(session, run);
        await loadTracks();
        set({ track: ended.track });
      } finally { dialog.removeEventListener("close", stop); }
    },
  });
}

function tell(ended, run) {
  const jitter = `jitter ${ended.jitter_before_mm.toPrecision(2)} → ${ended.jitter_after_mm.toPrecision(2)} mm a frame²`;
  const words = ended.verb === "refine" ? `${ended.moved} frames moved` : [ended.filled && `${ended.filled} frames filled`, ended.left_out && `${ended.left_out} left out`].filter(Boolean).join(", ");
  say(`Track ${ended.track} of ${run} is made: ${[words, jitter].filter(Boolean).join(", ")}.`);
}

/** Wire the choice of the track. */
export function startTracks() {
  choice.onchange = () => set({ track: choice.value });
  watch(["session", "run"], loadTracks);
  watch(["track"], () => {
    choice.value = get("track");
    if (get("session")) post("/api/scene/show", { options: { track: get("track") } }).catch(complain);
  });
  onEvent("track", (event, here) => { if (here && event.state === "done" && event.track) loadTracks(); });
}
