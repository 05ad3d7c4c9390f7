// Playing the stored frames: play, pause, speed, loop, first and last. The layers of a frame rest
// meanwhile.

import { goTo } from "../selection.js";
import { get, set, watch } from "../state.js";
import { effect, html, into, signal } from "./component.js";
import { Select } from "./parts.js";
import { layerPlayback, playLayers } from "./layer_playback.js";

const MOST_DRAWN_PER_SECOND = 30;
const SPEEDS = [
  [0.1, "0.1×"],
  [0.25, "¼×"],
  [0.5, "½×"],
  [1, "1×"],
  [2, "2×"],
  [4, "4×"],
];
const PLAY = "M4 2.5v11l9-5.5z";
const PAUSE = "M4 3h3v10H4zM9 3h3v10H9z";
const FIRST = "M3 3h2v10H3zM13 3v10L6 8z";
const LAST = "M11 3h2v10h-2zM3 3v10l7-5z";
const LOOP =
  "M8 2.5a5.5 5.5 0 0 1 4.6 2.5V2.8h1.5V8H9V6.5h2.6A4 4 0 1 0 12 8.9h1.5A5.5 5.5 0 1 1 8 2.5z";

const playing = signal(false);
const speed = signal(1);
const loops = signal(false);
let timer = 0;

const frames = () => get("summary")?.frames ?? [];

function tick() {
  const all = frames();
  if (!all.length) return stop();
  const fps = (get("summary").fps ?? 30) * speed.value;
  const step = Math.max(1, Math.round(fps / MOST_DRAWN_PER_SECOND));
  let next = get("frame") + step;
  if (next > all[all.length - 1].frame) {
    if (!loops.value) {
      goTo(all[all.length - 1].frame);
      return stop();
    }
    next = all[0].frame;
  }
  goTo(next);
  timer = window.setTimeout(tick, (1000 * step) / fps);
}

function stop() {
  clearTimeout(timer);
  playing.value = false;
}

/** Play the stored frames, or stop. */
export function togglePlay() {
  if (playing.value) return stop();
  const all = frames();
  if (!all.length) return;
  if (layerPlayback.value.playing) playLayers({ playing: false });
  if (get("frame") >= all[all.length - 1].frame) goTo(all[0].frame);
  set({ follow: false });
  playing.value = true;
  timer = window.setTimeout(tick, 0);
}

/** Pause what plays, the frames or the layers of one; else play the frames. */
export function pauseOrPlay() {
  if (layerPlayback.value.playing) playLayers({ playing: false });
  else togglePlay();
}

/** Stop what plays. Whether it did. */
export function leavePlayback() {
  const was = playing.value;
  stop();
  return was;
}

/** Loop on or off. */
export const toggleLoop = () => {
  loops.value = !loops.value;
};

function Button({ id = "", label, title, path, act, pressed = null }) {
  return html`<button
    id=${id}
    class=${pressed === null ? "icon" : "icon toggle"}
    aria-label=${label}
    aria-pressed=${pressed === null ? null : String(pressed)}
    title=${title}
    onClick=${act}
  >
    <svg viewBox="0 0 16 16"><path d=${path} /></svg>
  </button>`;
}

/** The buttons of the timeline. */
export const Playback = () => html`
  <div class="group" role="group" aria-label="Playback">
    <${Button}
      id="first"
      label="First frame"
      title="First frame (home)"
      path=${FIRST}
      act=${() => goTo(-Infinity)}
    />
    <${Button}
      id="play"
      label=${playing.value ? "Pause" : "Play"}
      title="Play or pause (space)"
      path=${playing.value ? PAUSE : PLAY}
      act=${togglePlay}
    />
    <${Button}
      id="last"
      label="Last frame"
      title="Last frame (end)"
      path=${LAST}
      act=${() => goTo(Infinity)}
    />
    <${Select}
      id="speed"
      aria-label="Speed"
      title="Speed"
      options=${SPEEDS.map(([value, words]) => [String(value), words])}
      value=${String(speed.value)}
      take=${(value) => into(speed)(Number(value))}
    />
    <${Button}
      id="loop"
      label="Loop"
      title="Loop (l)"
      path=${LOOP}
      act=${toggleLoop}
      pressed=${loops.value}
    />
  </div>
`;

/** Another run, or the layers of a frame: what plays stops. */
export function startPlayback() {
  watch(["session", "run"], stop);
  effect(() => {
    if (layerPlayback.value.playing) stop();
  });
}
