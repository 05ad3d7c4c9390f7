// Background jobs of the server, polled until they have ended.

import { fault, fetchJson } from "./api.js";
import { dotted, duration } from "./elements.js";

const POLL_MILLISECONDS = 350;
const WORTH_SAYING = 2;

/** The error code of a cancelled job. */
export const CANCELLED = "cancelled";

/** The states of a job that has not ended. */
export const GOING = ["queued", "running", "cancelling"];

/** Whether a job has not ended. */
export const isGoing = (job) => GOING.includes(job?.state);

/**
 * Follow the job at an address; resolves with its last state, "done" or "cancelled", and throws
 * what went wrong. `report` gets each state on the way; once `gone()` nothing waits any more:
 * resolves with null.
 * @param {string} path
 */
export async function followJob(path, report = (_job) => {}, gone = () => false) {
  for (;;) {
    const job = await fetchJson(path);
    if (gone()) return null;
    if (job.state === "failed") throw fault(job.message, job.hint, { code: job.code });
    if (!isGoing(job)) return job;
    report(job);
    await new Promise((resolve) => setTimeout(resolve, POLL_MILLISECONDS));
    if (gone()) return null;
  }
}

/**
 * The newest job of a kind that the server knows of, as it stands there; null for none. By it a
 * page that was loaded again, or another window, finds work and its answer. `fits`: whether a line
 * of the list is the one.
 * @param {{ session?: string, kind: string }} which
 */
export async function findJob({ session, kind }, fits = (_line) => true) {
  const query = new URLSearchParams({ kind, ...(session ? { session } : {}) });
  const { jobs } = await fetchJson(`/api/jobs?${query}`);
  const line = jobs.findLast((one) => fits(one));
  return line ? fetchJson(/** @type {any} */ (line.at)) : null;
}

/**
 * Like `followJob` for work that nothing follows from when it was cancelled: that too is thrown.
 */
export async function jobDone(path, report = (_job) => {}, gone = () => false) {
  const job = await followJob(path, report, gone);
  if (job?.state === "cancelled") throw fault(job.message, job.hint, { code: CANCELLED });
  return job;
}

/** A job's share of its step, null where it cannot say. */
export const shareOf = (job) => (job.total > 1 ? job.done / job.total : null);

/** Where a job stands, in words. */
export function standing(job, otherwise) {
  const share = shareOf(job);
  return dotted(job.step || otherwise, share === null ? "" : `${Math.round(100 * share)} %`);
}

/** How long a step still takes, in words; nothing where that is hardly any time, or not known. */
export const timeLeft = (seconds) => (seconds > WORTH_SAYING ? `${duration(seconds)} left` : "");

/** Where a job stands, with the time that its step still takes; as `drawProgress` takes it. */
export const progressOf = (job, otherwise, cancel) => ({
  words: dotted(
    standing(job, otherwise),
    timeLeft(job.seconds_left) && `${timeLeft(job.seconds_left)} of this step`,
  ),
  share: shareOf(job),
  cancel,
});
