// The timeline: what is tracked, weight and error over the frames, lost spans, settings changes, the cursor.

import { figure } from "./chart_looks.js";
import { drawSoon } from "./pacing.js";
import { byId, dotted, element, fill } from "./elements.js";
import { say } from "./messages.js";
import { goTo, range } from "./selection.js";
import { get, watch } from "./state.js";
import { onTheme, token } from "./theme.js";

const track = byId("track");
const canvas = byId("track-canvas");
const label = byId("frame-label");
const PADDING = 6;
// What the search says of a frame: its name here, its colour, and what is said of it; frames that were simply tracked carry no mark.
const STATES = {
  lost: ["search lost", "bad", "the tracker lost the body here and searches for it"],
  "limb lost": ["search: a limb off", "warn", "a limb is off the silhouettes, says the tracker"],
  damaged: ["damaged", "bad", "damaged on the disk: resume the run to track it again"],
  "no evidence": ["no evidence", "text-quiet", "nothing to be seen: the pose is held"],
  recovered: ["found again", "good", "found again"],
};
// What the truth says of it.
const TRUE_LOSS = ["limb lost (truth)", "truth", "by the truth a limb is off by more than 150 mm"];
const BAND = 5;

/** The finished frames, and those that are damaged on the disk as frames of that state. */
function known(summary) {
  const damaged = Object.entries(summary?.damaged ?? {}).map(([frame, part]) => ({ frame: Number(frame), tracking: "damaged", part }));
  return damaged.length ? [...summary.frames, ...damaged].sort((one, other) => one.frame - other.frame) : summary?.frames ?? [];
}

/** Where the marks that are drawn begin: frames of which something is to be said that is not said of the one before. */
export function marks(frames) {
  const corrected = get("summary")?.corrected;
  return frames.filter((entry, at) => entry.frame === corrected || (STATES[entry.tracking] && frames[at - 1]?.tracking !== entry.tracking) || (entry.lost && !frames[at - 1]?.lost)).map((entry) => entry.frame);
}

/** Show the next mark, or (by < 0) the one before. */
export function goToMark(by) {
  const summary = get("summary");
  const found = marks(known(summary));
  const at = get("frame") ?? -Infinity;
  const next = by > 0 ? found.find((frame) => frame > at) : found.findLast((frame) => frame < at);
  if (next === undefined) return say(found.length ? `No mark ${by > 0 ? "after" : "before"} this frame.` : "The timeline has no marks: neither the search nor the truth says that anything was lost.");
  goTo(next);
}

function position(frame, width) {
  const [first, last] = range();
  return PADDING + ((frame - first) / Math.max(1, last - first - 1)) * (width - 2 * PADDING);
}

function curve(pen, frames, key, colour, width, height, fromZero) {
  const measured = frames.filter((entry) => Number.isFinite(entry[key]) && entry[key] !== null);
  if (measured.length < 2) return;
  const values = measured.map((entry) => entry[key]);
  const low = fromZero ? 0 : Math.min(...values);
  const span = Math.max(...values) - low || 1;
  pen.beginPath();
  for (const entry of measured) pen.lineTo(position(entry.frame, width), height - 5 - ((entry[key] - low) / span) * (height - 12));
  pen.strokeStyle = colour;
  pen.lineWidth = 1.3;
  pen.stroke();
}

function drawTimeline() {
  const scale = devicePixelRatio || 1;
  const width = track.clientWidth;
  const height = track.clientHeight;
  if (canvas.width !== width * scale || canvas.height !== height * scale) Object.assign(canvas, { width: width * scale, height: height * scale });
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  const summary = get("summary");
  if (!summary) return;
  const frames = known(summary);
  if (frames.length) {
    const start = position(frames[0].frame, width);
    pen.fillStyle = token("accent-soft");
    pen.fillRect(start - 2, 0, position(frames[frames.length - 1].frame, width) - start + 4, height);
  }
  markTruth(pen, frames, width, height);
  markStates(pen, frames, width);
  curve(pen, frames, "log_weight", token("text-quiet"), width, height, false);
  curve(pen, frames, "error_mm", token("layer-7"), width, height, true);
  pen.fillStyle = token("warn");
  for (const change of summary.settings_changes ?? []) pen.fillRect(position(change.frame, width) - 0.5, 0, 1.5, 7);
  markCorrection(pen, summary, width, height);
  explain(pen, frames);
  if (get("frame") !== null) {
    const at = position(get("frame"), width);
    pen.fillStyle = token("text");
    pen.fillRect(at - 1, 0, 2, height);
    pen.beginPath();
    pen.arc(at, 5, 4, 0, 7);
    pen.fill();
  }
}

/** Where a person corrected the run: a diamond, and the line of the frames that were tracked backwards from it. */
function markCorrection(pen, summary, width, height) {
  if (!isCorrected(summary)) return;
  const at = position(summary.corrected, width);
  pen.fillStyle = token("accent");
  if (summary.backwards_to !== null) pen.fillRect(position(summary.backwards_to, width), height - 8, at - position(summary.backwards_to, width), 2);
  pen.beginPath();
  for (const [x, y] of [[0, -6], [5, 0], [0, 6], [-5, 0]]) pen.lineTo(at + x, height - 7 + y);
  pen.fill();
}

const isCorrected = (summary) => summary?.corrected !== null && summary?.corrected !== undefined;

/** The width of a frame's mark, pixels. */
function stepOf(width) {
  const [first, last] = range();
  return Math.max(3, (width - 2 * PADDING) / Math.max(1, last - first - 1) + 0.5);
}

/** A band along the bottom: where by the truth a limb is lost. */
function markTruth(pen, frames, width, height) {
  pen.fillStyle = token(TRUE_LOSS[1]);
  for (const entry of frames) if (entry.lost) pen.fillRect(position(entry.frame, width) - stepOf(width) / 2, height - BAND + 1, stepOf(width), BAND - 1);
}

/** A band along the top: where the tracker was lost, saw nothing, or found the body again. */
function markStates(pen, frames, width) {
  const step = stepOf(width);
  for (const entry of frames) {
    const state = STATES[entry.tracking];
    if (!state) continue;
    pen.fillStyle = token(state[1]);
    pen.fillRect(position(entry.frame, width) - step / 2, 0, step, BAND);
  }
}

/** The words of the legend and their colours: only what the run has. */
function legend(frames) {
  const measured = frames.some((entry) => entry.error_mm !== null && entry.error_mm !== undefined);
  const states = Object.keys(STATES).filter((name) => frames.some((entry) => entry.tracking === name));
  return [["weight", "text-quiet"], ...(isCorrected(get("summary")) ? [["corrected", "accent"]] : []), ...(measured ? [["error", "layer-7"]] : []), ...states.map((name) => STATES[name]), ...(frames.some((entry) => entry.lost) ? [TRUE_LOSS] : [])];
}

/** What curves and bands are, at the free end of the line. */
function explain(pen, frames) {
  if (frames.length < 2) return;
  pen.font = "500 10px Inter, system-ui, sans-serif";
  pen.textBaseline = "top";
  pen.lineWidth = 4;
  pen.lineJoin = "round";
  pen.strokeStyle = token("accent-soft");
  let left = PADDING + 4;
  for (const [word, colour] of legend(frames)) {
    pen.strokeText(word, left, BAND + 3);
    pen.fillStyle = token(colour);
    pen.fillText(word, left, BAND + 3);
    left += pen.measureText(word).width + 8;
  }
}

/** Both measures of a frame in words; "" where there is nothing to say. */
function standing(entry) {
  const lost = entry?.lost ? `${TRUE_LOSS[0]}${entry.lost_limbs?.length ? `: ${entry.lost_limbs.join(", ")}` : ""}` : "";
  return dotted(STATES[entry?.tracking]?.[0] ?? "", lost);
}

function showFrame() {
  const summary = get("summary");
  const frame = get("frame");
  if (!summary || frame === null) return fill(label, "–");
  const entry = summary.frames.find((one) => one.frame === frame);
  const state = standing(entry);
  const [before, after] = [entry?.error_mm, get("outcome")?.frame === frame ? get("outcome").after?.error_mm : undefined];
  const measured = before == null ? "" : after == null ? `${figure(before)} mm` : `${figure(before)} → ${figure(after)} mm`;
  const name = STATES[entry?.tracking]?.[0] ?? (entry?.lost ? TRUE_LOSS[0] : "");
  fill(label, element("span", {}, element("b", {}, `frame ${frame}`), element("small", {}, ` of ${summary.first} to ${summary.last - 1}`)), element("small", {}, dotted(measured, name)));
  label.title = dotted(`frame ${frame} of ${summary.first} to ${summary.last - 1}, ${summary.frames.length} of ${summary.last - summary.first} frames tracked`, state);
  Object.assign(track, { ariaValueMin: summary.first, ariaValueMax: summary.last - 1, ariaValueNow: frame, ariaValueText: state ? `frame ${frame}, ${state}` : `frame ${frame}` });
}

function frameAt(event) {
  const [first, last] = range();
  const box = track.getBoundingClientRect();
  return first + ((event.clientX - box.left - PADDING) / (box.width - 2 * PADDING)) * (last - first - 1);
}

/** What the pointer stands on, where the tracker has something to say of it. */
function wordsOf(frame) {
  const summary = get("summary");
  const entry = known(summary).find((one) => one.frame === frame);
  const state = STATES[entry?.tracking];
  if (isCorrected(summary) && frame === summary.corrected) return `frame ${frame}: corrected by hand in ${summary.made_from}, tracked ${summary.backwards_to === null ? "on" : `backwards to ${summary.backwards_to}`} from it`;
  const parts = [state && `${state[0]} – ${state[2]}${entry.part ? ` (${entry.part})` : ""}`, entry?.lost && `${TRUE_LOSS[0]} – ${TRUE_LOSS[2]}${entry.lost_limbs?.length ? `: ${entry.lost_limbs.join(", ")}` : ""}`].filter(Boolean);
  return parts.length ? `frame ${frame}: ${parts.join("; ")}` : "";
}

/** Wire the timeline. */
export function startTimeline() {
  track.addEventListener("pointerdown", (event) => { track.setPointerCapture(event.pointerId); goTo(frameAt(event)); });
  track.addEventListener("pointermove", (event) => {
    if (event.buttons) goTo(frameAt(event));
    track.title = wordsOf(Math.round(frameAt(event)));
  });
  new ResizeObserver(drawTimeline).observe(track);
  onTheme(drawTimeline);
  document.fonts.ready.then(drawTimeline);
  watch(["summary", "frame", "outcome"], () => { drawSoon(drawTimeline); showFrame(); });
  watch(["detail"], () => { label.title = (get("detail")?.notes ?? []).join(" "); label.classList.toggle("noted", label.title !== ""); });
}
