// Playing the layers of the shown frame: in a loop or forth and back, so many a second. The scene
// plays them and says each move; frames rest meanwhile.

import { fetchJson, post } from "../api.js";
import { holdLayer } from "../data.js";
import { onEvent } from "../live.js";
import { complain } from "../messages.js";
import { select } from "../selection.js";
import { get, set } from "../state.js";
import { signal } from "./component.js";
import { leaveOffPlaying } from "./visiting.js";

/** Layers a second that are offered. */
export const RATES = [1, 3, 10];

/** @typedef {{ playing: boolean, rate: number, mode: "loop" | "pingpong" }} LayerPlayback */

/** How layers are played. @type {import("@preact/signals").Signal<LayerPlayback>} */
export const layerPlayback = signal({ playing: false, rate: 3, mode: "loop" });

/** Keep what the scene says of it; the same again changes nothing. @param {LayerPlayback} now */
function take(now) {
  const before = layerPlayback.value;
  if (["playing", "rate", "mode"].some((name) => now[name] !== before[name])) {
    layerPlayback.value = now;
    set({ plays: now.playing ? "layers" : null });
  }
}

/**
 * Begin, end, or change how the layers are played; what is left out stays.
 * @param {Partial<LayerPlayback>} changes
 */
export async function playLayers(changes) {
  const before = layerPlayback.value;
  if (changes.playing === false) leaveOffPlaying();
  take({ ...before, ...changes });
  try {
    await post("/api/scene/play-layers", changes);
  } catch (error) {
    take(before);
    complain(error);
  }
}

/** Play the layers of the shown frame, or stop. */
export const toggleLayers = () => playLayers({ playing: !layerPlayback.value.playing });

/**
 * Show one layer by hand, null for all together: what is played stops.
 * @param {number | null} layer
 */
export function scrubTo(layer) {
  const played = layerPlayback.value.playing;
  if (played) playLayers({ playing: false });
  if (layer !== get("layer")) select({ layer });
  if (played) holdLayer();
}

/** Follow what the scene says; one that was open before the page was loaded may play already. */
export function startLayerPlayback() {
  onEvent("scene", (event) => {
    if (event.layers) take(event.layers);
  });
  fetchJson("/api/scene/play-layers").then(take).catch(complain);
}
