// The run's tracks: which one scene, charts and views show.

import { fetchJson, post, runPath } from "../api.js";
import { byId, partWords } from "../elements.js";
import { onEvent } from "../live.js";
import { complain, say } from "../messages.js";
import { get, set, watch } from "../state.js";
import { follow, html, mount, signal } from "./component.js";
import { Select } from "./parts.js";

/** The track of the poses as searched. */
export const RAW = "raw";

/** The tracks of the run that is open. */
const tracks = signal(/** @type {any[]} */ ([]));

/** The reason why the truth cannot be used that was said last: once is enough. */
let saidProblem = "";

/** Whether the open run has a track. @param {string} name */
export const hasTrack = (name) => tracks.value.some((track) => track.name === name);

/** A track in words. @param {string} name */
export const trackWords = (name) => (name === RAW ? "as searched" : name);
const errorWords = ({ mean_mm: mean, measured_frames: measured, frames }) =>
  mean == null ? "" : ` · ${mean.toPrecision(3)} mm${partWords(measured, frames)}`;

/** Which track is shown: a choice, where there is more than the search's own. */
function TrackChoice() {
  const shown = follow("track");
  return html`<${Select}
    id="track-choice"
    hidden=${tracks.value.length < 2}
    aria-label="Track"
    title="Whose poses scene, charts and views show"
    options=${tracks.value.map((one) => [one.name, trackWords(one.name) + errorWords(one)])}
    value=${shown}
    take=${(track) => set({ track })}
  />`;
}

/** Load which tracks the run has. */
export async function loadTracks() {
  const [session, run] = [get("session"), get("run")];
  if (!run) {
    tracks.value = [];
    return;
  }
  try {
    const known = await fetchJson(`${runPath(session, run)}/tracks`);
    if (session !== get("session") || run !== get("run")) return;
    tracks.value = known.tracks;
    if (known.truth_problem && known.truth_problem !== saidProblem)
      say("The errors cannot be measured.", { remedy: known.truth_problem, kind: "warning" });
    saidProblem = known.truth_problem;
    if (hasTrack(get("track"))) return;
    const words = `${run} has no track “${get("track")}”: the poses as searched are shown.`;
    say(words, { kind: "warning" });
    set({ track: RAW });
  } catch (error) {
    if (/** @type {any} */ (error).status !== 404) complain(error);
  }
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
