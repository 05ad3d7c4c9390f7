// Whose fault an error is: frames are searched for long, in the background; Why says it first once
// they are done.

import { post, readOnly, remove, runPath } from "../api.js";
import { dotted } from "../elements.js";
import { isGoing, standing, timeLeft } from "../jobs.js";
import { complain } from "../messages.js";
import { get } from "../state.js";
import { follow, html } from "./component.js";
import { heldJobs } from "./held_jobs.js";

const FRAMES = 8;
const keyOf = ({ session, run }) => `${session}/${run}`;
const held = heldJobs("split", keyOf);
let isSent = false;

async function begin(wanted) {
  if (isSent) return;
  isSent = true;
  try {
    held.keep(await post(`${runPath(get("session"), get("run"))}/split-error`, wanted));
  } catch (error) {
    complain(error);
  } finally {
    isSent = false;
  }
}

/**
 * What is known of all frames that were searched for long, and what searches more of them.
 * @param {{ words: readonly string[] }} properties
 */
export function Split({ words }) {
  const job = held.about(keyOf({ session: follow("session"), run: follow("run") }));
  const frame = follow("frame");
  const cancel = () => remove(`/api/split-error/${job.identifier}`).catch(complain);
  const known = words.map((line) => html`<p key=${line}>${line}</p>`);
  if (readOnly) return known.length ? html`<h3>Whose fault is the error?</h3>${known}` : null;
  const button = (label, wanted) =>
    html`<button type="button" class="small" onClick=${() => begin(wanted)}>${label}</button>`;
  return html`<h3>Whose fault is the error?</h3>
    ${known}
    ${
      isGoing(job)
        ? html`<p>
            <span class="hint" role="status">
              ${dotted(standing(job, "searching for long"), timeLeft(job.seconds_left))}
            </span>
            <button type="button" class="quiet small" onClick=${cancel}>Cancel</button>
          </p>`
        : html`<p class="hint">
              A search of some seconds a frame says how much of the error is the search's, the
              likelihood's and the body's. It is kept; the run does not change.
            </p>
            <p class="split-tools">
              ${button("Search this frame for long", { frame })}
              ${button(`Search ${FRAMES} frames of the run`, { count: FRAMES })}
            </p>`
    }`;
}

/** Hear of long searches; `ended()` is called when one of the shown run has ended. */
export const startSplit = (/** @type {() => void} */ ended) =>
  held.start(
    (job) => keyOf(job) === keyOf({ session: get("session"), run: get("run") }) && ended(),
  );
