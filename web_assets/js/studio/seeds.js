// A frame searched again with other seeds, in the background; its view is drawn when they are done.

import { post, remove, runPath } from "../api.js";
import { dotted } from "../elements.js";
import { isGoing, standing, timeLeft } from "../jobs.js";
import { complain } from "../messages.js";
import { get } from "../state.js";
import { follow, html } from "./component.js";
import { heldJobs } from "./held_jobs.js";

const USUAL = 8;
let count = USUAL;
const keyOf = ({ session, run, frame }) => `${session}/${run}/${frame}`;
const here = () => keyOf({ session: get("session"), run: get("run"), frame: get("frame") });
const held = heldJobs("seeds", keyOf);

/** What starts the search, or how far it is. */
export function SeedTools() {
  const shown = { session: follow("session"), run: follow("run"), frame: follow("frame") };
  const job = held.about(keyOf(shown));
  if (isGoing(job)) {
    const cancel = () => remove(`/api/seeds/${job.identifier}`).catch(complain);
    return html`<span class="hint" role="status">
        ${dotted(standing(job, "searching with other seeds"), timeLeft(job.seconds_left))}
      </span>
      <button type="button" class="quiet small" onClick=${cancel}>Cancel</button>`;
  }
  const keepCount = ({ currentTarget }) => {
    if (currentTarget.reportValidity()) count = Number(currentTarget.value);
  };
  return html`<input
      type="number"
      min="2"
      max="64"
      step="1"
      aria-label="How many other seeds"
      title="How many other seeds"
      defaultValue=${count}
      onChange=${keepCount}
    />
    <button
      type="button"
      class="small"
      title="In the background; nothing of the run changes"
      onClick=${begin}
    >
      Search with other seeds
    </button>`;
}

let isSent = false;

async function begin() {
  if (isSent) return;
  isSent = true;
  try {
    // What is tried is searched as what is stored is, so that both can be drawn.
    for (const trial of [get("against"), ...(get("trial") ? [get("trial")] : [])]) {
      const path = `${runPath(get("session"), get("run"))}/frames/${get("frame")}/seeds`;
      held.keep(await post(trial ? `${path}?trial=${trial}` : path, { count }));
    }
  } catch (error) {
    complain(error);
  } finally {
    isSent = false;
  }
}

/** Hear of searches; `ended()` is called when that of the shown frame has ended. */
export const startSeeds = (/** @type {() => void} */ ended) =>
  held.start((job) => keyOf(job) === here() && ended());
