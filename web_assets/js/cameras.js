// The camera views side by side: picture under outlines, mask, edge map, sample points; a click enlarges one.

import { fetchJson, post, runPath, sessionPath } from "./api.js";
import { openPicture } from "./dialogs.js";
import { byId, check, element, fill, showPicture } from "./elements.js";
import { onEvent } from "./live.js";
import { complain } from "./messages.js";
import { get, watch } from "./state.js";

const panel = byId("panel-cameras");
const LAYERS = [["outline", "outlines"], ["truth", "truth"], ["mask", "mask"], ["edges", "edge map"], ["samples", "sample points"], ["particles", "particles"]];
const shown = new Set(JSON.parse(localStorage.getItem("overlays") ?? '["outline"]'));
let cameras = [];
let age = 0;  // rises when a frame got another answer, so that its pictures are requested again

/** A view's address: of the run's frame, or, before there is a run, the session's first picture. */
function source(camera, height) {
  const place = get("run") ? `${runPath(get("session"), get("run"))}/frames/${get("frame")}` : `${sessionPath(get("session"))}/frames/0`;
  return `${place}/views/${encodeURIComponent(camera.name)}.jpg?show=${[...shown].join(",")}&height=${height}${get("run") && get("track") !== "raw" ? `&track=${encodeURIComponent(get("track"))}` : ""}${age ? `&age=${age}` : ""}`;
}

function refresh() {
  if (panel.hidden || !get("session") || (get("run") && get("frame") === null)) return;
  for (const view of panel.querySelectorAll(".view")) showPicture(view.querySelector("img"), source(cameras[Number(view.dataset.at)], 400));
}

function build() {
  fill(panel, cameras.map((camera, at) => element("button", { className: "view", title: "Enlarge", dataset: { at }, onclick: () => openPicture(camera.name, source(camera, 1080)) },
    element("img", { alt: `View of ${camera.name}` }), element("span", { className: "caption" }, `${at + 1} ${camera.name}`),
    camera.quarter_turns > 0 && element("span", { className: "turn" }, `↻ ${camera.quarter_turns * 90}°`))));
  refresh();
}

/** Look through camera number `at` in the scene; null for the free view. */
export function lookThrough(at) {
  if (at !== null && !cameras[at]) return;
  post("/api/scene/view", { look_through: at === null ? "" : cameras[at].name }).catch(complain);
}

/** The check boxes that stand in the tab line while this panel is open. */
export function cameraTools() {
  return LAYERS.map(([name, label]) => check(label, {
    checked: shown.has(name), onchange: ({ target }) => {
      if (target.checked) shown.add(name); else shown.delete(name);
      localStorage.setItem("overlays", JSON.stringify([...shown]));
      refresh();
    },
  }));
}

/** Wire the views to the state. */
export function startCameras() {
  watch(["session"], async () => {
    cameras = [];
    if (get("session")) {
      try { ({ cameras } = await fetchJson(sessionPath(get("session")))); } catch (error) { complain(error); }
    }
    build();
  });
  watch(["frame", "run", "summary", "track"], refresh);
  onEvent("frame", (event, here) => {
    const seen = get("summary")?.frames.at(-1)?.frame ?? -1;
    if (here && !event.reannealed && event.frame <= seen) { age += 1; refresh(); }
  });
  document.addEventListener("panel", refresh);
}
