// The camera views side by side: picture under outlines, mask, edge map, sample points; a click enlarges one.

import { fetchJson, post, runPath, sessionPath } from "./api.js";
import { openPicture } from "./dialogs.js";
import { onEvent } from "./live.js";
import { complain } from "./messages.js";
import { get, watch } from "./state.js";

const panel = document.getElementById("panel-cameras");
const LAYERS = [["outline", "outlines"], ["truth", "truth"], ["mask", "mask"], ["edges", "edge map"], ["samples", "sample points"], ["particles", "particles"]];
const shown = new Set(JSON.parse(localStorage.getItem("overlays") ?? '["outline"]'));
let cameras = [];
let age = 0;  // rises when a frame got another answer, so that its pictures are asked for again

/** A view's address: of the run's frame, or, before there is a run, the session's first picture. */
function source(camera, height) {
  const place = get("run") ? `${runPath(get("session"), get("run"))}/frames/${get("frame")}` : `${sessionPath(get("session"))}/frames/0`;
  return `${place}/views/${encodeURIComponent(camera.name)}.jpg?show=${[...shown].join(",")}&height=${height}${get("run") && get("track") !== "raw" ? `&track=${encodeURIComponent(get("track"))}` : ""}${age ? `&age=${age}` : ""}`;
}

/** Swap a picture only when the next one is decoded, so that nothing flickers; the newest wish wins. */
function swap(image, address) {
  if (image.wanted === address) return;
  image.wanted = address;
  if (image.busy) return;
  image.busy = true;
  const next = new Image();
  const done = () => {
    image.busy = false;
    if (image.wanted !== address) { const wish = image.wanted; image.wanted = null; swap(image, wish); }
  };
  next.onload = () => { image.src = address; done(); };
  next.onerror = done;
  next.src = address;
}

function refresh() {
  if (panel.hidden || !get("session") || (get("run") && get("frame") === null)) return;
  for (const view of panel.querySelectorAll(".view")) swap(view.querySelector("img"), source(cameras[Number(view.dataset.at)], 400));
}

function build() {
  panel.replaceChildren(...cameras.map((camera, at) => {
    const view = document.createElement("button");
    view.className = "view";
    view.dataset.at = at;
    view.title = "Enlarge";
    const image = document.createElement("img");
    image.alt = `View of ${camera.name}`;
    const caption = document.createElement("span");
    caption.className = "caption";
    caption.textContent = `${at + 1} ${camera.name}`;
    view.append(image, caption);
    if (camera.quarter_turns) {
      const turn = document.createElement("span");
      turn.className = "turn";
      turn.textContent = `↻ ${camera.quarter_turns * 90}°`;
      view.append(turn);
    }
    view.onclick = () => openPicture(camera.name, source(camera, 1080));
    return view;
  }));
  refresh();
}

/** Look through camera number `at` in the scene; null for the free view. */
export function lookThrough(at) {
  if (at !== null && !cameras[at]) return;
  post("/api/scene/view", { look_through: at === null ? "" : cameras[at].name }).catch(complain);
}

/** The check boxes that stand in the tab line while this panel is open. */
export function cameraTools() {
  return LAYERS.map(([name, label]) => {
    const box = document.createElement("label");
    box.className = "check";
    const input = Object.assign(document.createElement("input"), { type: "checkbox", checked: shown.has(name) });
    input.onchange = () => {
      if (input.checked) shown.add(name); else shown.delete(name);
      localStorage.setItem("overlays", JSON.stringify([...shown]));
      refresh();
    };
    box.append(input, label);
    return box;
  });
}

/** Wire the views to the state. */
export function startCameras() {
  watch(["session"], async () => {
    cameras = [];
    if (get("session")) {
      const told = await fetchJson(sessionPath(get("session"))).catch((error) => { complain(error); return { cameras: [] }; });
      cameras = told.cameras;
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
