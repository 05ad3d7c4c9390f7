// Keeping what was tried of a frame: as a run of its own, or in place of the stored frame.

import { post, remove, runPath } from "../api.js";
import { openForm } from "./dialogs.js";
import { complain, say } from "../messages.js";
import { comparedRuns, MOST_COMPARED } from "../selection.js";
import { openSession, refreshSessions } from "../sessions.js";
import { get, set } from "../state.js";

/**
 * A run of its own with the frames before this one, tracked on from it with the knobs that were
 * moved; it is opened, and the run that was shown stays as it is. The frame's result is the one
 * that was tried, for the start and the random numbers are the same.
 * @param {number} frame
 * @param {Record<string, any>} settings the knobs that it is tracked with; none: those that were
 *   moved
 */
export async function keepAsNewRun(frame, settings = {}) {
  const [session, run] = [get("session"), get("run")];
  try {
    const made = await post(`${runPath(session, run)}/branch`, { frame, settings });
    // What was moved is the new run's now.
    await remove(`${runPath(session, run)}/settings/moved`).catch(complain);
    await refreshSessions();
    const others = comparedRuns().filter((one) => one !== `${session}/${run}`);
    const compared = [`${session}/${run}`, ...others].slice(0, MOST_COMPARED - 1).join(",");
    openSession(session, made.name, { panel: get("panel"), compared });
    say(`${made.name} is ${run} with these knobs from frame ${frame} on; ${run} is unchanged.`);
    set({ follow: true });
    await post(`${runPath(session, made.name)}/start`);
  } catch (error) {
    complain(error);
  }
}

/**
 * Put the new result in place of the stored one, after asking.
 * @param {number} frame
 */
export function replaceStored(frame) {
  const path = runPath(get("session"), get("run"));
  const later = get("summary")?.frames.filter((line) => line.frame > frame).length ?? 0;
  const dropped =
    later === 0
      ? ""
      : later === 1
        ? "The frame after it followed from the old result and goes. "
        : `The ${later} frames after it followed from the old result and go. `;
  openForm({
    heading: `Replace the stored result of frame ${frame}?`,
    action: "Replace it",
    rows: [],
    intro: `${dropped}The run as it is now goes to the trash, from which it can be restored.`,
    send: () => post(`${path}/reanneal`, { frame, keep: true }),
  });
}
