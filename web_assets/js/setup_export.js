// Step Export: the studio's own export panel, which takes the best track.

import { fetchJson, runPath } from "./api.js";
import { complain } from "./messages.js";
import { ViewWall } from "./setup_views.js";
import { set } from "./state.js";
import { html, into, signal } from "./studio/component.js";
import { Exporting, startExporting } from "./studio/exporting.js";

/** @import { Schemas } from "./api_types" */
/** @typedef {ReturnType<typeof modelOf>} Model */

let isStarted = false;

/**
 * Which run is exported.
 * @param {import("./setup.js").Setup} setup
 */
export function modelOf(setup) {
  const run = setup.detail.runs.find((one) => one.name === setup.step?.run) ?? setup.detail.runs[0];
  const checked = signal(/** @type {Schemas["CheckAnswer"] | null} */ (null));
  if (!isStarted) startExporting();
  isStarted = true;
  set({ session: setup.session, run: run.name, panel: "export" });
  fetchJson(`${runPath(setup.session, run.name)}/check`)
    .then(into(checked))
    .catch(complain);
  return { setup, run, checked, stop: () => set({ run: null, panel: null }) };
}

/** @param {{ model: Model }} properties */
export function Panel({ model: { run, checked } }) {
  const { usual, note } = checked.value ?? {};
  return html`
    ${
      usual &&
      html`<p class="hint">
        ${run.name}: track "${usual}" is exported unless you choose another. ${note} Frames before
        the first and after the last tracked one are left out.
      </p>`
    }
    <div class="panel export" id="panel-export"><${Exporting} /></div>
  `;
}

/** @param {{ model: Model }} properties */
export function Beside({ model: { setup, run, checked } }) {
  if (!checked.value) return null;
  const frame = Math.max(run.first, Math.floor((run.first + run.tracked_to) / 2));
  const shown = { run: run.name, frame, track: checked.value.usual };
  return html`<${ViewWall} setup=${setup} shown=${shown} />`;
}
