// Step Export: the studio's own export panel, which takes the best track.

import { element } from "./elements.js";
import { startExporting } from "./exporting.js";
import { tell } from "./live.js";
import { complain } from "./messages.js";
import { set } from "./state.js";
import { viewWall } from "./way_views.js";
import { isGoing } from "./jobs.js";

const panel = document.getElementById("panel-export");
let started = false;

export function mount(place, way) {
  const run = way.detail.runs[0];
  const which = element("p", { className: "hint" });
  place.append(which, panel);
  panel.hidden = false;
  if (!started) { startExporting(); started = true; }
  set({ session: way.session, run: run.name });
  way.on("export", (event) => { tell(event); if (!isGoing(event)) way.refresh().catch(() => {}); });
  way.api.fetchJson(`${way.api.runPath(way.session, run.name)}/check`).then((told) => {
    which.textContent = `${run.name}: track "${told.usual}" is exported unless you choose another. ${told.note} Frames before the first and after the last tracked one are left out.`;
    wall.show({ run: run.name, frame: Math.max(run.first, Math.floor((run.first + run.tracked_to) / 2)), track: told.usual === "raw" ? "" : told.usual, show: "outline" });
  }).catch(complain);
  const wall = viewWall(way);
  return () => {
    panel.hidden = true;
    document.body.append(panel);
    set({ run: null });
    wall.stop();
  };
}
