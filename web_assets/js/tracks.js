// The run's tracks: which one scene, charts and views show.

import { fetchJson, post, runPath } from "./api.js";
import { byId, offer } from "./elements.js";
import { onEvent } from "./live.js";
import { complain, say } from "./messages.js";
import { get, set, watch } from "./state.js";

const choice = byId("track-choice");
/** The track of the poses as searched. */
export const RAW = "raw";
/** A track in words. */
export const trackWords = (name) => (name === RAW ? "as searched" : name);
const named = (track) => trackWords(track.name) + (track.mean_mm === null || track.mean_mm === undefined ? "" : ` · ${track.mean_mm.toPrecision(3)} mm`);

/** Load which tracks the run has, and offer them. */
export async function loadTracks() {
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
