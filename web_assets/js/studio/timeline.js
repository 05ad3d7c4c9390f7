// The timeline: what plays the frames, the run over its frames, and what is said of the frame that
// is shown.

import { figure } from "../chart_looks.js";
import { byId, dotted } from "../elements.js";
import { say } from "../messages.js";
import { drawSoon } from "../pacing.js";
import { goTo, shownTrial } from "../selection.js";
import { get } from "../state.js";
import { onTheme } from "../theme.js";
import { follow, html, mount, useEffect, useLayoutEffect, useRef } from "./component.js";
import { frameWords, marks, shortStanding, standingOf } from "./frame_words.js";
import { Playback, startPlayback } from "./playback.js";
import { drawTimeline, frameAt } from "./timeline_drawing.js";

/** Show the next mark, or (by < 0) the one before. */
export function goToMark(by) {
  const summary = get("summary");
  const all = summary ? marks(summary, get("notes")) : [];
  const at = get("frame") ?? -Infinity;
  const next = by > 0 ? all.find((frame) => frame > at) : all.findLast((frame) => frame < at);
  if (next !== undefined) return goTo(next);
  const none =
    "The timeline has no marks: neither the search nor the truth says that anything was lost, " +
    "and no frame has a note.";
  say(all.length ? `No mark ${by > 0 ? "after" : "before"} this frame.` : none);
}

const entryOf = (summary, frame) => summary?.frames.find((one) => one.frame === frame);

/** The run over its frames, drawn on a canvas: a slider. */
function Track() {
  const [summary, frame] = [follow("summary"), follow("frame")];
  const canvas = useRef(/** @type {HTMLCanvasElement | null} */ (null));
  const draw = useRef(() => {});
  useLayoutEffect(() => {
    draw.current = () => {
      if (canvas.current) drawTimeline(canvas.current, get("summary"), get("frame"));
    };
    const now = () => draw.current();
    const watcher = new ResizeObserver(now);
    if (canvas.current?.parentElement) watcher.observe(canvas.current.parentElement);
    onTheme(now);
    document.fonts.ready.then(now);
    return () => watcher.disconnect();
  }, []);
  useEffect(() => drawSoon(draw.current), [summary, frame]);
  const at = (event) => {
    const box = event.currentTarget.getBoundingClientRect();
    return frameAt(event.clientX - box.left, box.width);
  };
  const press = (event) => {
    event.currentTarget.setPointerCapture(event.pointerId);
    goTo(at(event));
  };
  const move = (event) => {
    if (event.buttons) goTo(at(event));
    if (summary) event.currentTarget.title = frameWords(summary, Math.round(at(event)));
  };
  const words = standingOf(entryOf(summary, frame));
  return html`<div
    class="track"
    id="track"
    role="slider"
    tabindex="0"
    aria-label="Frame"
    aria-valuemin=${summary?.first ?? 0}
    aria-valuemax=${summary ? summary.last - 1 : 0}
    aria-valuenow=${frame ?? 0}
    aria-valuetext=${frame === null ? "none" : words ? `frame ${frame}, ${words}` : `frame ${frame}`}
    onPointerDown=${press}
    onPointerMove=${move}
  >
    <canvas id="track-canvas" ref=${canvas}></canvas>
  </div>`;
}

/** The shown frame: its number, its error, and what is to be said of it. */
function FrameLabel() {
  const [summary, frame, detail] = [follow("summary"), follow("frame"), follow("detail")];
  follow("trial");
  follow("trials");
  if (!summary || frame === null) {
    return html`<output class="frame-label" id="frame-label">–</output>`;
  }
  const entry = entryOf(summary, frame);
  const before = entry?.error_mm ?? null;
  const after = shownTrial()?.error_mm ?? null;
  let measured = "";
  if (before !== null) {
    measured = after === null ? figure(before) : `${figure(before)} → ${figure(after)}`;
    measured += " mm";
  }
  const range = `${summary.first} to ${summary.last - 1}`;
  const notes = (detail?.notes ?? []).join(" ");
  const tracked = `${summary.frames.length} of ${summary.last - summary.first} frames tracked`;
  const words = dotted(`frame ${frame} of ${range}, ${tracked}`, standingOf(entry));
  return html`<output
    class=${`frame-label ${notes ? "noted" : ""}`}
    id="frame-label"
    title=${notes || words}
  >
    <span><b>frame ${frame}</b><small>${` of ${range}`}</small></span>
    <small>${dotted(measured, shortStanding(entry))}</small>
  </output>`;
}

/** Show the timeline's parts in the places that the page has for them. */
export function startTimeline() {
  startPlayback();
  mount(byId("playback-place"), html`<${Playback} />`);
  mount(byId("track-place"), html`<${Track} />`);
  mount(byId("frame-place"), html`<${FrameLabel} />`);
}
