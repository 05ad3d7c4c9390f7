// The one selection: frame, layer, limb, parameter, particle and camera. Timeline, charts,
// pictures, scene and address follow it; whatever can be clicked changes it here.

import { get, set } from "./state.js";
import { isSearching } from "./work_states.js";

/** @import { Schemas } from "./api_types" */

/** What is chosen beside the frame; null: nothing. */
const CHOSEN = ["layer", "limb", "parameter", "particle", "camera"];
/** Nothing chosen. */
export const nothingChosen = () => Object.fromEntries(CHOSEN.map((name) => [name, null]));

/** First and last frame (half open) of the run that is open. */
export function range() {
  const summary = get("summary");
  return summary ? [summary.first, summary.last] : [0, 1];
}

/** Show a frame that has a result: the nearest one. */
export function goTo(frame) {
  const frames = get("summary")?.frames;
  if (!frames?.length) return;
  const [first, last] = [frames[0].frame, frames[frames.length - 1].frame];
  const nearest = Math.max(first, Math.min(last, Math.round(frame)));
  set({
    frame: nearest,
    follow: nearest === last && get("work")?.state === "tracking",
    whatIf: null,
    trial: null,
    against: null,
    particle: null,
  });
}

/**
 * Choose a frame, layer, limb, parameter, particle or camera; what is left out stays. A particle is
 * one of a frame's layer and goes with it.
 * @param {{ frame?: number, layer?: number | null, limb?: string | null, parameter?: string | null,
 *   particle?: number | null, camera?: string | null }} changes
 */
export function select({ frame, ...changes }) {
  if (frame !== undefined && frame !== null && frame !== get("frame")) goTo(frame);
  if (
    changes.layer !== undefined &&
    changes.layer !== get("layer") &&
    changes.particle === undefined
  )
    changes.particle = null;
  set(changes);
}

const isSided = (name) => /left|right/.test(name);
/**
 * The limb that a limb's errors are counted with: itself where it is left or right or the body has
 * no sides, else head and trunk (studio/results/inspection/reference.py).
 */
export const limbGroup = (name) =>
  !name || isSided(name) || !(get("parameters") ?? []).some((one) => isSided(one.limb))
    ? name
    : TRUNK;
const TRUNK = "head and trunk";
/** Whether a limb is the one that is chosen. */
export const isChosenLimb = (name, chosen) => name === chosen || limbGroup(name) === chosen;

export const MOST_COMPARED = 6;
/** The runs beside the open one, as SESSION/RUN. @returns {string[]} */
export const comparedRuns = () =>
  (get("compared") ?? "")
    .split(",")
    .filter((name) => name.includes("/") && name !== `${get("session")}/${get("run")}`)
    .slice(0, MOST_COMPARED - 1);

/**
 * Choose something; what is chosen already is let go.
 * @param {"layer" | "limb" | "parameter" | "particle" | "camera"} name
 */
export const toggle = (name, value) => select({ [name]: get(name) === value ? null : value });

/** Whether the shown frame moves on with a search that is under way. */
export const followsSearch = () =>
  Boolean(get("follow")) &&
  isSearching(get("work")) &&
  get("work").run === get("run") &&
  get("work").session === get("session");
/** Whether the shown frame has a stored result. */
export const isStored = () =>
  Boolean(get("summary")?.frames.some((line) => line.frame === get("frame")));

/**
 * The numbers of a trial of the shown frame, null while they are not known.
 * @returns {Schemas["TrialView"] | null}
 */
const trialNamed = (name) =>
  (get("trials")?.frame === get("frame") &&
    get("trials").trials.find((one) => one.name === name)) ||
  null;
/** The trial that is shown. */
export const shownTrial = () => trialNamed(get("trial"));
/**
 * What the shown trial is compared with: what is stored, or another trial.
 * @returns {Schemas["FrameNumbers"] | null}
 */
export const besideTrial = () =>
  shownTrial() ? (trialNamed(get("against")) ?? get("trials").stored) : null;

/** How many layers the shown frame has. */
export const layersShown = () => (get("whatIf") ?? get("detail")?.layers)?.length ?? 0;

/** Show the layer before or after; past either end all layers are shown together. */
export function stepLayer(by) {
  const count = layersShown();
  if (!count) return;
  const at = get("layer");
  // From a layer that only the stored frame has, the one before is the last of those tried.
  const next = at === null ? (by > 0 ? 0 : count - 1) : Math.min(at, count) + by;
  select({ layer: next < 0 || next >= count ? null : next });
}
