// Going to a state of the page from a text, as a link to it would, without leaving the page.

import { fetchJson, post } from "../api.js";
import { get } from "../state.js";

const TRIES = 30;
const TRY_MILLISECONDS = 500;
const PATIENCE = 240;
const RATE = 3;

const wait = (/** @type {number} */ milliseconds) =>
  new Promise((resolve) => setTimeout(resolve, milliseconds));

/**
 * Show a state of the page by the names of the address.
 * @param {Record<string, string | number>} state
 */
export function visit(state) {
  const words = Object.entries(state).map(([name, value]) => [name, String(value)]);
  history.pushState(null, "", `/?${new URLSearchParams(words)}`);
  dispatchEvent(new PopStateEvent("popstate"));
}

const isShown = () => get("frame") !== null && get("detail")?.frame === get("frame");

let stops = 0;
/** The layers were stopped by hand: what is about to play them leaves off. */
export function leaveOffPlaying() {
  stops += 1;
}

/**
 * Play the layers once the frame is there: what the page says of it to the scene meanwhile would
 * stop them.
 */
export async function playWhenShown() {
  const stopped = stops;
  for (let waited = 0; waited < PATIENCE && !isShown(); waited++) await wait(TRY_MILLISECONDS);
  const wanted = [get("session"), get("run"), get("frame")].join();
  let seen = 0;
  for (let tries = 0; tries < TRIES && seen < 2; tries++) {
    // Who has gone on meanwhile is not followed.
    if ([get("session"), get("run"), get("frame")].join() !== wanted) return;
    const now = await fetchJson("/api/scene/play-layers");
    if (stops !== stopped) return;
    seen = now.playing ? seen + 1 : 0;
    if (!now.playing) await post("/api/scene/play-layers", { playing: true, rate: RATE });
    await wait(TRY_MILLISECONDS);
  }
}
