// The timeline as it is drawn: what is tracked, weight and error over the frames, lost spans,
// settings changes, the cursor.

import { range } from "../selection.js";
import { token } from "../theme.js";
import { isCorrected, knownFrames, STATES, TRUE_LOSS } from "./frame_words.js";

const PADDING = 6;
const BAND = 5;

/** @typedef {{ pen: CanvasRenderingContext2D, width: number, height: number }} Sheet */

/** Where a frame lies, pixels. */
function position(frame, width) {
  const [first, last] = range();
  return PADDING + ((frame - first) / Math.max(1, last - first - 1)) * (width - 2 * PADDING);
}

/** The frame that lies at a pixel. */
export function frameAt(x, width) {
  const [first, last] = range();
  return first + ((x - PADDING) / (width - 2 * PADDING)) * (last - first - 1);
}

/** The width of a frame's mark, pixels. */
function stepOf(width) {
  const [first, last] = range();
  return Math.max(3, (width - 2 * PADDING) / Math.max(1, last - first - 1) + 0.5);
}

/** @param {Sheet} sheet */
function curve({ pen, width, height }, frames, key, colour, fromZero) {
  const measured = frames.filter((entry) => entry[key] !== null && Number.isFinite(entry[key]));
  if (measured.length < 2) return;
  const values = measured.map((entry) => entry[key]);
  const low = fromZero ? 0 : Math.min(...values);
  const span = Math.max(...values) - low || 1;
  pen.beginPath();
  for (const entry of measured) {
    const up = ((entry[key] - low) / span) * (height - 12);
    pen.lineTo(position(entry.frame, width), height - 5 - up);
  }
  pen.strokeStyle = colour;
  pen.lineWidth = 1.3;
  pen.stroke();
}

/** A band along the bottom: where by the truth a limb is lost. @param {Sheet} sheet */
function markTruth({ pen, width, height }, frames) {
  const step = stepOf(width);
  pen.fillStyle = token(TRUE_LOSS[1]);
  for (const entry of frames.filter((one) => one.lost)) {
    pen.fillRect(position(entry.frame, width) - step / 2, height - BAND + 1, step, BAND - 1);
  }
}

/**
 * A band along the top: where the tracker was lost, saw nothing, or found the body again.
 * @param {Sheet} sheet
 */
function markStates({ pen, width }, frames) {
  const step = stepOf(width);
  for (const entry of frames) {
    const state = STATES[entry.tracking];
    if (!state) continue;
    pen.fillStyle = token(state[1]);
    pen.fillRect(position(entry.frame, width) - step / 2, 0, step, BAND);
  }
}

/**
 * Where a person corrected the run: a diamond, and the line of the frames that were tracked
 * backwards from it.
 * @param {Sheet} sheet
 */
function markCorrection({ pen, width, height }, summary) {
  if (!isCorrected(summary)) return;
  const at = position(summary.corrected, width);
  pen.fillStyle = token("accent");
  if (summary.backwards_to !== null) {
    const back = position(summary.backwards_to, width);
    pen.fillRect(back, height - 8, at - back, 2);
  }
  pen.beginPath();
  for (const [x, y] of [
    [0, -6],
    [5, 0],
    [0, 6],
    [-5, 0],
  ]) {
    pen.lineTo(at + x, height - 7 + y);
  }
  pen.fill();
}

/** The words of the legend and their colours: only what the run has. */
function legend(summary, frames) {
  const measured = frames.some((entry) => entry.error_mm !== null && entry.error_mm !== undefined);
  const states = Object.keys(STATES).filter((name) =>
    frames.some((entry) => entry.tracking === name),
  );
  return [
    ["weight", "text-quiet"],
    ...(isCorrected(summary) ? [["corrected", "accent"]] : []),
    ...(measured ? [["error", "layer-7"]] : []),
    ...states.map((name) => STATES[name]),
    ...(frames.some((entry) => entry.lost) ? [TRUE_LOSS] : []),
  ];
}

/** What curves and bands are, at the free end of the line. @param {Sheet} sheet */
function explain({ pen }, summary, frames) {
  if (frames.length < 2) return;
  pen.font = "500 10px Inter, system-ui, sans-serif";
  pen.textBaseline = "top";
  pen.lineWidth = 4;
  pen.lineJoin = "round";
  pen.strokeStyle = token("accent-soft");
  let left = PADDING + 4;
  for (const [word, colour] of legend(summary, frames)) {
    pen.strokeText(word, left, BAND + 3);
    pen.fillStyle = token(colour);
    pen.fillText(word, left, BAND + 3);
    left += pen.measureText(word).width + 8;
  }
}

/** @param {Sheet} sheet */
function markCursor({ pen, width, height }, frame) {
  const at = position(frame, width);
  pen.fillStyle = token("text");
  pen.fillRect(at - 1, 0, 2, height);
  pen.beginPath();
  pen.arc(at, 5, 4, 0, 7);
  pen.fill();
}

/**
 * Draw the timeline of a run on a canvas that fills its place.
 * @param {HTMLCanvasElement} canvas
 */
export function drawTimeline(canvas, summary, frame) {
  const scale = devicePixelRatio || 1;
  const place = canvas.parentElement;
  const pen = canvas.getContext("2d");
  if (!place || !pen) return;
  const [width, height] = [place.clientWidth, place.clientHeight];
  if (canvas.width !== width * scale || canvas.height !== height * scale) {
    Object.assign(canvas, { width: width * scale, height: height * scale });
  }
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  if (!summary) return;
  const sheet = { pen, width, height };
  const frames = knownFrames(summary);
  if (frames.length) {
    const [start, end] = [frames[0].frame, frames[frames.length - 1].frame].map((one) =>
      position(one, width),
    );
    pen.fillStyle = token("accent-soft");
    pen.fillRect(start - 2, 0, end - start + 4, height);
  }
  markTruth(sheet, frames);
  markStates(sheet, frames);
  curve(sheet, frames, "log_weight", token("text-quiet"), false);
  curve(sheet, frames, "error_mm", token("layer-7"), true);
  pen.fillStyle = token("warn");
  for (const change of summary.settings_changes ?? []) {
    pen.fillRect(position(change.frame, width) - 0.5, 0, 1.5, 7);
  }
  markCorrection(sheet, summary);
  explain(sheet, summary, frames);
  if (frame !== null) markCursor(sheet, frame);
}
