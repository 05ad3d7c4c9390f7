// Step Export: the studio's own export panel, which takes the best track.

import { fetchJson, runPath } from "./api.js";
import { complain } from "./messages.js";
import { ViewWall } from "./setup_views.js";
import { set } from "./state.js";
import { html, mount as render } from "./studio/component.js";
import { Exporting, startExporting } from "./studio/exporting.js";

let isStarted = false;

/** @param {HTMLElement} place @param {import("./setup.js").Setup} setup */
export function mount(place, setup) {
  const run = setup.detail.runs.find((one) => one.name === setup.step?.run) ?? setup.detail.runs[0];
  const show = (words = "") =>
    render(
      place,
      html`
        <p class="hint">${words}</p>
        <div class="panel export" id="panel-export"><${Exporting} /></div>
      `,
    );
  show();
  if (!isStarted) startExporting();
  isStarted = true;
  set({ session: setup.session, run: run.name, panel: "export" });
  let isLeft = false;
  fetchJson(`${runPath(setup.session, run.name)}/check`)
    .then(({ usual, note }) => {
      if (isLeft) return;
      show(
        `${run.name}: track "${usual}" is exported unless you choose another. ${note} ` +
          "Frames before the first and after the last tracked one are left out.",
      );
      const frame = Math.max(run.first, Math.floor((run.first + run.tracked_to) / 2));
      const shown = { run: run.name, frame, track: usual };
      render(setup.aside, html`<${ViewWall} setup=${setup} shown=${shown} />`);
    })
    .catch(complain);
  return () => {
    isLeft = true;
    render(place, null);
    render(setup.aside, null);
    set({ run: null, panel: null });
  };
}
