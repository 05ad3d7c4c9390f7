// Playing what is stored: play, pause, speed, loop, first, last.

import { byId } from "./elements.js";
import { goTo } from "./selection.js";
import { get, set, watch } from "./state.js";

const button = byId("play");
const loop = byId("loop");
const speed = byId("speed");
const MOST_DRAWN_PER_SECOND = 30;
const PLAY = button.innerHTML;
const PAUSE = '<svg viewBox="0 0 16 16"><path d="M4 3h3v10H4zM9 3h3v10H9z"/></svg>';
let timer = null;

const frames = () => get("summary")?.frames ?? [];

function tick() {
  const all = frames();
  if (!all.length) return stop();
  const fps = (get("summary").fps ?? 30) * Number(speed.value);
  const step = Math.max(1, Math.round(fps / MOST_DRAWN_PER_SECOND));
  let next = get("frame") + step;
  if (next > all[all.length - 1].frame) {
    if (loop.ariaPressed !== "true") { goTo(all[all.length - 1].frame); return stop(); }
    next = all[0].frame;
  }
  goTo(next);
  timer = setTimeout(tick, (1000 * step) / fps);
}

function stop() {
  clearTimeout(timer);
  timer = null;
  button.innerHTML = PLAY;
  button.ariaLabel = "Play";
}

/** Play the stored frames, or stop. */
export function togglePlay() {
  if (timer) return stop();
  const all = frames();
  if (!all.length) return;
  button.innerHTML = PAUSE;
  button.ariaLabel = "Pause";
  if (get("frame") >= all[all.length - 1].frame) goTo(all[0].frame);
  set({ follow: false });
  timer = setTimeout(tick, 0);
}

/** Stop what plays. Whether it did. */
export function leavePlayback() {
  if (!timer) return false;
  stop();
  return true;
}

/** Loop on or off. */
export const toggleLoop = () => { loop.ariaPressed = String(loop.ariaPressed !== "true"); };

/** Wire the buttons. */
export function startPlayback() {
  button.onclick = togglePlay;
  loop.onclick = toggleLoop;
  byId("first").onclick = () => goTo(-Infinity);
  byId("last").onclick = () => goTo(Infinity);
  watch(["session", "run"], stop);
}
