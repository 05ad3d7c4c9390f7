// Background jobs of the server, followed by what they say.

import { fault, fetchJson } from "./api.js";
import { dotted, duration } from "./elements.js";
import { listenToAll, listenToGaps } from "./events.js";

const WORTH_SAYING = 2;
/** What a job's state says while nobody knows it. */
const UNANSWERED = { step: "the studio does not answer", total: 0, seconds_left: null };

/** The error code of a cancelled job. */
export const CANCELLED = "cancelled";

/** The states of a job that has not ended. */
export const GOING = ["queued", "running", "cancelling"];

/** Whether a job has not ended. */
export const isGoing = (job) => GOING.includes(job?.state);

/**
 * Follow the job at an address by its events; resolves with its last state, "done" or "cancelled",
 * and throws what went wrong. `report` gets each state on the way; once `gone()` nothing waits any
 * more: resolves with null. How it stands is asked for at first, and where events may have been
 * missed; while the studio does not answer, that is reported.
 * @param {string} path
 * @returns {Promise<any>}
 */
export function followJob(path, report = (_job) => {}, gone = () => false) {
  return new Promise((resolve, reject) => {
    /** @type {any} */
    let last = { state: "queued" };
    let heard = 0;
    const stops = [
      listenToAll((event) => {
        if ("at" in event && event.at === path) take(event);
      }),
      listenToGaps(ask),
    ];
    /** @param {(value: any) => void} settle @param {any} value */
    function end(settle, value) {
      for (const stop of stops) stop();
      settle(value);
    }
    /** @param {any} job */
    function take(job) {
      heard += 1;
      last = job;
      if (gone()) end(resolve, null);
      else if (job.state === "failed")
        end(reject, fault(job.message, job.hint, { code: job.code }));
      else if (!isGoing(job)) end(resolve, job);
      else report(job);
    }
    async function ask() {
      const before = heard;
      try {
        const job = await fetchJson(path);
        // What was heard meanwhile is newer.
        if (heard === before) take(job);
      } catch (error) {
        if (gone()) end(resolve, null);
        else if (error.status) end(reject, error);
        else if (heard === before) report({ ...last, ...UNANSWERED });
      }
    }
    ask();
  });
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
