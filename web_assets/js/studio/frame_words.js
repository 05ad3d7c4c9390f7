// What is said of a frame on the timeline: by the search itself, and by the truth.

import { dotted } from "../elements.js";

/**
 * What the search says of a frame: its name here, its colour, and what is said of it; frames that
 * were simply tracked carry no mark.
 * @type {Record<string, [string, string, string]>}
 */
export const STATES = {
  lost: ["search lost", "bad", "the tracker lost the body here and searches for it"],
  "limb lost": ["search: a limb off", "warn", "a limb is off the silhouettes, says the tracker"],
  damaged: ["damaged", "bad", "damaged on the disk: resume the run to track it again"],
  "no evidence": ["no evidence", "text-quiet", "nothing to be seen: the pose is held"],
  recovered: ["found again", "good", "found again"],
};

/** What the truth says of it. @type {[string, string, string]} */
export const TRUE_LOSS = [
  "limb lost (truth)",
  "truth",
  "by the truth a limb is off by more than 150 mm",
];

/** Whether a run was corrected by hand. */
export const isCorrected = (summary) =>
  summary?.corrected !== null && summary?.corrected !== undefined;

/** The finished frames, and those that are damaged on the disk as frames of that state. */
export function knownFrames(summary) {
  const damaged = Object.entries(summary?.damaged ?? {}).map(([frame, part]) => ({
    frame: Number(frame),
    tracking: "damaged",
    part,
  }));
  if (!damaged.length) return summary?.frames ?? [];
  return [...summary.frames, ...damaged].sort((one, other) => one.frame - other.frame);
}

/**
 * Where the marks that are drawn begin: frames of which something is to be said that is not said of
 * the one before, and those with a note.
 * @param {{ frame: number }[]} notes
 * @returns {number[]}
 */
export function marks(summary, notes) {
  const frames = knownFrames(summary);
  const noted = new Set(notes.map((note) => note.frame));
  return frames
    .filter(
      (entry, at) =>
        entry.frame === summary.corrected ||
        noted.has(entry.frame) ||
        (STATES[entry.tracking] && frames[at - 1]?.tracking !== entry.tracking) ||
        (entry.lost && !frames[at - 1]?.lost),
    )
    .map((entry) => entry.frame);
}

const limbsOf = (words, limbs) => (limbs?.length ? `${words}: ${limbs.join(", ")}` : words);

/** Both measures of a frame in words; "" where there is nothing to say. */
export function standingOf(entry) {
  const state = STATES[entry?.tracking];
  return dotted(
    state ? limbsOf(state[0], entry.limbs_off) : "",
    entry?.lost ? limbsOf(TRUE_LOSS[0], entry.lost_limbs) : "",
  );
}

/** The one measure of a frame that its label has room for. */
export const shortStanding = (entry) =>
  STATES[entry?.tracking]?.[0] ?? (entry?.lost ? TRUE_LOSS[0] : "");

/** What the pointer stands on, where there is something to say of it. */
export function frameWords(summary, frame) {
  if (isCorrected(summary) && frame === summary.corrected) {
    const { made_from: from, backwards_to: back } = summary;
    const way = back === null ? "on" : `backwards to ${back}`;
    return `frame ${frame}: corrected by hand in ${from}, tracked ${way} from it`;
  }
  const entry = knownFrames(summary).find((one) => one.frame === frame);
  const state = STATES[entry?.tracking];
  const parts = [
    state && limbsOf(`${state[0]} – ${state[2]}`, entry.limbs_off),
    entry?.part && `(${entry.part})`,
    entry?.lost && limbsOf(`${TRUE_LOSS[0]} – ${TRUE_LOSS[2]}`, entry.lost_limbs),
  ].filter(Boolean);
  return parts.length ? `frame ${frame}: ${parts.join("; ")}` : "";
}
