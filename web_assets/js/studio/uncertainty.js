// The run drawn and tracked again, in the background; its view has the half widths once that is
// done.

import { post, readOnly, remove, runPath } from "../api.js";
import { dotted } from "../elements.js";
import { isGoing, standing, timeLeft } from "../jobs.js";
import { complain } from "../messages.js";
import { rigPath } from "../sessions.js";
import { get } from "../state.js";
import { follow, html } from "./component.js";
import { heldJobs } from "./held_jobs.js";

const keyOf = ({ session, run }) => `${session}/${run}`;
const here = () => keyOf({ session: get("session"), run: get("run") });
const held = heldJobs("uncertainty", keyOf);
let isSent = false;

async function begin() {
  if (isSent) return;
  isSent = true;
  try {
    const path = runPath(get("session"), get("run"));
    held.keep(await post(`${path}/uncertainty`, {}));
  } catch (error) {
    complain(error);
  } finally {
    isSent = false;
  }
}

/** The page on other cameras for the run. */
const RigLink = () => html`<a
  href=${rigPath(follow("session"), follow("run"))}
>
  Where should cameras stand?
</a>`;

/** What starts it, or how far it is. */
export function UncertaintyTools() {
  const job = held.about(keyOf({ session: follow("session"), run: follow("run") }));
  if (readOnly) return html`<${RigLink} />`;
  if (isGoing(job)) {
    const cancel = () => remove(`/api/uncertainty/${job.identifier}`).catch(complain);
    return html`<span class="hint" role="status">
        ${dotted(standing(job, "drawing the run again"), timeLeft(job.seconds_left))}
      </span>
      <button type="button" class="quiet small" onClick=${cancel}>Cancel</button>`;
  }
  return html`<button
      type="button"
      class="small"
      title="The run is drawn again and tracked, in the background: about twice as long as it took. It does not change."
      onClick=${begin}
    >
      Measure how far off joints may be
    </button>
    <${RigLink} />`;
}

/** Hear of such jobs; `ended()` is called when that of the shown run has ended. */
export const startUncertainty = (/** @type {() => void} */ ended) =>
  held.start((job) => keyOf(job) === here() && ended());
