// Playing the layers of the shown frame: in a loop or forth and back, so many a second. Frames rest meanwhile.

import { shownLayers } from "./shown_layers.js";
import { select } from "../selection.js";
import { get, watch } from "../state.js";
import { signal } from "./component.js";

/** Layers a second that are offered. */
export const RATES = [1, 3, 10];

/** @type {import("@preact/signals").Signal<{ playing: boolean, rate: number, mode: "loop" | "pingpong" }>} */
export const layerPlayback = signal({ playing: false, rate: 3, mode: "loop" });

let timer = 0;
let forwards = true;

function tick() {
  const { rate, mode } = layerPlayback.value;
  const count = shownLayers().layers.length;
  const at = get("layer") ?? -1;
  if (mode === "loop" || at <= 0) forwards = true;
  else if (at >= count - 1) forwards = false;
  const next = forwards ? at + 1 : at - 1;
  if (count) select({ layer: next >= count ? 0 : next });
  timer = window.setTimeout(tick, 1000 / rate);
}

/** Begin, end, or change how the layers are played; what is left out stays. */
export function playLayers(changes) {
  layerPlayback.value = { ...layerPlayback.value, ...changes };
  clearTimeout(timer);
  if (layerPlayback.value.playing) tick();
}

/** Play the layers of the shown frame, or stop. */
export const toggleLayers = () => playLayers({ playing: !layerPlayback.value.playing });

/** Show one layer, by hand: what is played stops. @param {number | null} layer */
export function scrubTo(layer) {
  if (layerPlayback.value.playing) playLayers({ playing: false });
  if (layer !== get("layer")) select({ layer });
}

/** Another run plays nothing yet. */
export function startLayerPlayback() {
  watch(["session", "run"], () => {
    if (layerPlayback.value.playing) playLayers({ playing: false });
  });
}
