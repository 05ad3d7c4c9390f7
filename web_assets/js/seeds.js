// A frame searched again with other seeds, in the background; its view is drawn when they are done.

import { fetchJson, post, remove, runPath } from "./api.js";
import { button, dotted, element, number } from "./elements.js";
import { isGoing, standing, timeLeft } from "./jobs.js";
import { onEvent } from "./live.js";
import { complain } from "./messages.js";
import { get } from "./state.js";

const USUAL = 8;

/** The newest state of the search of each run and frame, by which it is still seen after the page was loaded again. */
const jobs = new Map();
let count = USUAL;
const keyOf = ({ session, run, frame }) => `${session}/${run}/${frame}`;
const here = () => keyOf({ session: get("session"), run: get("run"), frame: get("frame") });

/** What starts the search, or how far it is. */
export function seedTools() {
  const job = jobs.get(here());
  if (isGoing(job)) {
    return [element("span", { className: "hint", role: "status" }, dotted(standing(job, "searching with other seeds"), timeLeft(job.seconds_left))),
      button("Cancel", () => remove(`/api/seeds/${job.identifier}`).catch(complain), "quiet small")];
  }
  const field = number(count, { min: 2, max: 64, step: 1, ariaLabel: "How many other seeds", title: "How many other seeds", onchange: ({ target }) => { if (target.reportValidity()) count = Number(target.value); } });
  return [field, button("Search with other seeds", begin, "small", { title: "In the background; nothing of the run changes" })];
}

async function begin() {
  try {
    // What is tried is searched as what is stored is, so that both can be drawn.
    for (const trial of [get("against"), ...(get("trial") ? [get("trial")] : [])]) {
      const path = `${runPath(get("session"), get("run"))}/frames/${get("frame")}/seeds`;
      const job = await post(trial ? `${path}?trial=${trial}` : path, { count });
      jobs.set(keyOf(job), job);
    }
  } catch (error) { complain(error); }
}

/** Searches that were begun before this page was loaded, or in another window. */
async function findSeeds(changed) {
  const { jobs: listed } = await fetchJson(`/api/jobs?${new URLSearchParams({ kind: "seeds" })}`);
  for (const line of listed.filter(isGoing)) {
    const job = await fetchJson(/** @type {any} */ (line.at));
    jobs.set(keyOf(job), job);
    if (keyOf(job) === here()) changed(false);
  }
}

/** Hear of searches; `changed(ended)` is called when that of the shown frame got further or ended. */
export function startSeeds(changed) {
  findSeeds(changed).catch(complain);
  onEvent("seeds", (job) => {
    jobs.set(keyOf(job), job);
    if (job.state === "failed") complain(job);
    if (keyOf(job) === here()) changed(!isGoing(job));
  });
}
