// Step Export: the studio's own export panel, which takes the best track.

import { fetchJson, runPath } from "./api.js";
import { element, hint } from "./elements.js";
import { complain } from "./messages.js";
import { set } from "./state.js";
import { html, mount as show } from "./studio/component.js";
import { Exporting, startExporting } from "./studio/exporting.js";
import { viewWall } from "./setup_views.js";

let started = false;

/** @param {HTMLElement} place @param {import("./setup.js").Setup} setup */
export function mount(place, setup) {
  const run = setup.detail.runs.find((one) => one.name === setup.step?.run) ?? setup.detail.runs[0];
  const which = hint();
  const panel = element("div", { className: "panel export", id: "panel-export" });
  place.append(which, panel);
  show(panel, html`<${Exporting} />`);
  if (!started) {
    startExporting();
    started = true;
  }
  set({ session: setup.session, run: run.name, panel: "export" });
  fetchJson(`${runPath(setup.session, run.name)}/check`)
    .then(({ usual, note }) => {
      which.textContent = `${run.name}: track "${usual}" is exported unless you choose another. ${note} Frames before the first and after the last tracked one are left out.`;
      wall.show({
        run: run.name,
        frame: Math.max(run.first, Math.floor((run.first + run.tracked_to) / 2)),
        track: usual === "raw" ? "" : usual,
        show: "outline",
      });
    })
    .catch(complain);
  const wall = viewWall(setup);
  return () => {
    show(panel, null);
    set({ run: null, panel: null });
    wall.stop();
  };
}
