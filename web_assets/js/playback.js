// Playing what is stored: play, pause, speed, loop, first, last.

import { get, set, watch } from "./state.js";
import { goTo } from "./timeline.js";

const button = document.getElementById("play");
const loop = document.getElementById("loop");
const speed = document.getElementById("speed");
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
    if (loop.getAttribute("aria-pressed") !== "true") { goTo(all[all.length - 1].frame); return stop(); }
    next = all[0].frame;
  }
  goTo(next);
  timer = setTimeout(tick, (1000 * step) / fps);
}

function stop() {
  clearTimeout(timer);
  timer = null;
  button.innerHTML = PLAY;
  button.setAttribute("aria-label", "Play");
}

/** Play the stored frames, or stop. */
export function togglePlay() {
  if (timer) return stop();
  const all = frames();
  if (!all.length) return;
  button.innerHTML = PAUSE;
  button.setAttribute("aria-label", "Pause");
  if (get("frame") >= all[all.length - 1].frame) goTo(all[0].frame);
  set({ follow: false });
  timer = setTimeout(tick, 0);
}

/** Loop on or off. */
export const toggleLoop = () => loop.setAttribute("aria-pressed", String(loop.getAttribute("aria-pressed") !== "true"));

/** Wire the buttons. */
export function startPlayback() {
  button.onclick = togglePlay;
  loop.onclick = toggleLoop;
  document.getElementById("first").onclick = () => goTo(-Infinity);
  document.getElementById("last").onclick = () => goTo(Infinity);
  watch(["session", "run"], stop);
}
