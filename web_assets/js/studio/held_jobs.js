// The jobs of one kind that a panel has begun, or finds when the page is loaded again.

import { fetchJson } from "../api.js";
import { isGoing } from "../jobs.js";
import { onEvent } from "../live.js";
import { complain } from "../messages.js";
import { signal } from "./component.js";

/**
 * The newest job of a kind by what it is about. `keyOf` names that of a job's state.
 * @param {any} kind @param {(job: any) => string} keyOf
 */
export function heldJobs(kind, keyOf) {
  /** @type {import("@preact/signals").Signal<Record<string, any>>} */
  const jobs = signal({});
  const keep = (job) => {
    jobs.value = { ...jobs.value, [keyOf(job)]: job };
  };
  async function find() {
    const { jobs: listed } = await fetchJson(`/api/jobs?kind=${kind}`);
    for (const line of listed.filter(isGoing)) {
      keep(await fetchJson(/** @type {any} */ (line.at)));
    }
  }
  return {
    /** In a component: how the job about something stands; undefined where there is none. */
    about: (/** @type {string} */ key) => jobs.value[key],
    keep,
    /** Hear of jobs; `ended(job)` is called when one has ended. @param {(job: any) => void} ended */
    start(ended) {
      find().catch(complain);
      onEvent(kind, (/** @type {any} */ job) => {
        keep(job);
        if (job.state === "failed") complain(job);
        if (!isGoing(job)) ended(job);
      });
    },
  };
}
