// What a link names that is not here: a session or a run that was renamed, deleted, or is of
// another studio. It is said, and what is here is offered; nothing else is opened in its place.

import { readOnly } from "../api.js";
import { openSession } from "../sessions.js";
import { follow, html, mount } from "./component.js";

/** @typedef {{ session: string, run: string | null }} Missing */

/** The card over the scene. */
function MissingCard() {
  const missing = /** @type {Missing | null} */ (follow("missing"));
  const sessions = /** @type {any[]} */ (follow("sessions") ?? []);
  if (!missing) return null;
  const owner = sessions.find((one) => one.name === missing.session);
  const what = missing.run === null ? "Session" : "Run";
  const name = missing.run === null ? missing.session : `${missing.session} / ${missing.run}`;
  const offered = owner
    ? owner.runs.slice(0, 3).map((/** @type {any} */ run) => [owner.name, run.name])
    : sessions.slice(0, 3).map((one) => [one.name, undefined]);
  return html`<div class="curtain missing" role="alert">
    <div class="card">
      <h2>${what} “${name}” is not here</h2>
      <p>
        It was renamed or deleted, or the link comes from another studio. Deleted ones may be in the
        trash, at the end of the list of sessions.
      </p>
      ${owner && !offered.length && html`<p>${owner.name} has no run yet.</p>`}
      <div class="group missing-offers">
        ${offered.map(
          (/** @type {[string, string | undefined]} */ [session, run], /** @type {number} */ at) =>
            html`<button
              type="button"
              class=${at === 0 && !readOnly ? "primary" : ""}
              onClick=${() => openSession(session, run)}
            >
              Open ${run ?? session}
            </button>`,
        )}
        ${
          owner &&
          html`<button type="button" class="quiet" onClick=${() => openSession(owner.name, null, { missing: null })}>
            ${owner.name} without a run
          </button>`
        }
      </div>
    </div>
  </div>`;
}

/** Show it over the scene while something is missing. */
export function startMissing() {
  const place = document.createElement("div");
  document.getElementById("stage")?.append(place);
  mount(place, html`<${MissingCard} />`);
}
