// Work in the background of the server: asked for its state until it has ended.

import { fetchJson } from "./api.js";
import { duration } from "./elements.js";

const POLL_MILLISECONDS = 350;

/** The code of the error of what a person ended. */
export const CANCELLED = "cancelled";

/** Whether a job is not over. */
export const isGoing = (told) => ["queued", "running", "cancelling"].includes(told?.state);

/** What went wrong in a job, as an error with its remedy. */
export const faultOf = (told) => Object.assign(new Error(told.message), { hint: told.hint, code: told.code });

/**
 * Follow the job whose state is told under a path; resolves with its last state, "done" or "cancelled", and throws what
 * went wrong. `report` gets each state on the way; once `gone()` nobody waits any more: resolves with null.
 */
export async function followJob(path, report = () => {}, gone = () => false) {
  for (;;) {
    const told = await fetchJson(path);
    if (gone()) return null;
    if (told.state === "failed") throw faultOf(told);
    if (!isGoing(told)) return told;
    report(told);
    await new Promise((resolve) => setTimeout(resolve, POLL_MILLISECONDS));
    if (gone()) return null;
  }
}

/** Like `followJob` for work that nothing follows from when it was cancelled: that too is thrown. */
export async function jobDone(path, report, gone) {
  const told = await followJob(path, report, gone);
  if (told?.state === "cancelled") throw faultOf({ ...told, code: CANCELLED });
  return told;
}

/** A job's share of its step, null where it cannot say. */
export const shareOf = (told) => (told.total > 1 ? told.done / told.total : null);

/** Where a job stands, in words. */
export function standing(told, otherwise) {
  const share = shareOf(told);
  return [told.step || otherwise, share === null ? "" : `${Math.round(100 * share)} %`].filter(Boolean).join(" · ");
}

/** The same with the time that the step will still take. */
export function withTimeLeft(told, otherwise) {
  const left = told.seconds_left > 2 ? `${duration(told.seconds_left)} left of this step` : "";
  return [standing(told, otherwise), left].filter(Boolean).join(" · ");
}
