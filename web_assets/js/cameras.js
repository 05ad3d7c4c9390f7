// The camera views side by side: picture under outlines, mask, edge map, sample points; a click enlarges one.

import { fetchJson, runPath, sessionPath } from "./api.js";
import { openPicture } from "./dialogs.js";
import { button, byId, check, element, fill, showPicture } from "./elements.js";
import { onEvent } from "./live.js";
import { complain } from "./messages.js";
import { comparedRuns, shownTrial } from "./selection.js";
import { get, set, watch } from "./state.js";
import { seriesColour } from "./theme.js";

const panel = byId("panel-cameras");
/** @type {[string, string, string][]} */
const LAYERS = [
  ["outline", "outlines", "Bodies as outlines"], ["filled", "filled", "Bodies filled"], ["truth", "truth", "The reference as a stick figure"],
  ["mask", "mask", "Red: only observed; blue: only the body; yellow: both"], ["edges", "edge map", "How strong an edge the search sees in each pixel"],
  ["samples", "sample points", "The points that the likelihood reads"], ["cost", "cost", "The points that the likelihood reads, from cool (fits) to warm (costs most): (1 − p)² of edge map and mask"],
  ["particles", "particles", "The particles of the frame's layers"],
];
/** Those that need no run: outlines are the start pose's then. */
const BEFORE_A_RUN = ["outline", "mask", "edges"];
const shown = new Set(JSON.parse(localStorage.getItem("overlays") ?? '["outline"]'));
let cameras = [];
let frameCount = 1;  // of the footage
let large = null;  // the camera whose picture is enlarged
let age = 0;  // rises when a frame got another answer, so that its pictures are requested again

/** The frame of the footage that is looked at before there is a run. */
const footageFrame = () => Math.max(0, Math.min(frameCount - 1, get("frame") ?? 0));

/** A view's address: of the run's frame, or, before there is a run, a frame of the session's footage. */
function source(camera, height) {
  const place = get("run") ? `${runPath(get("session"), get("run"))}/frames/${get("frame")}` : `${sessionPath(get("session"))}/frames/${footageFrame()}`;
  const query = new URLSearchParams({ show: [...shown].join(","), height: String(height) });
  if (get("run")) {
    const tried = shownTrial();
    if (get("track") !== "raw") query.set("track", get("track"));
    if (tried) query.set("beside", tried.pose.map((value) => Number(value.toPrecision(7))).join(","));
    if (comparedHere().some(Boolean)) query.set("compared", comparedHere().join(","));
  }
  if (age) query.set("age", String(age));
  return `${place}/views/${encodeURIComponent(camera.name)}.jpg?${query}`;
}

/** The compared runs that the same cameras saw, those of this session; "" in the places of the others. @returns {string[]} */
const comparedHere = () => comparedRuns().map((name) => (name.startsWith(`${get("session")}/`) ? name.split("/")[1] : ""));

function refresh() {
  if (panel.hidden || !get("session") || (get("run") && get("frame") === null)) return;
  if (large && byId("dialog").open) showPicture(byId("dialog").querySelector("img"), source(large, LARGE_HEIGHT));
  for (const view of panel.querySelectorAll(".view")) showPicture(view.querySelector("img"), source(cameras[Number(view.dataset.at)], isLarge ? LARGE_HEIGHT : 400));
}

const LARGE_HEIGHT = 1080;
const MOST_ZOOM = 12;
/** How all views are zoomed together: the share of a picture that stays in its place. */
let zoom = { scale: 1, x: 0.5, y: 0.5 };
const within = (share) => Math.max(0, Math.min(1, share));

function showZoom() {
  for (const view of /** @type {NodeListOf<HTMLElement>} */ (panel.querySelectorAll(".view"))) {
    const image = view.querySelector("img");
    image.style.transformOrigin = `${100 * zoom.x}% ${100 * zoom.y}%`;
    image.style.transform = zoom.scale === 1 ? "" : `scale(${zoom.scale})`;
    view.classList.toggle("chosen", cameras[Number(view.dataset.at)]?.name === get("camera"));
  }
}

/** The wheel zooms all views about the place under the pointer; a zoomed view is dragged, and all move with it. */
function takeWheel(event) {
  const view = event.target.closest?.(".view");
  if (!view) return;
  event.preventDefault();
  const box = view.getBoundingClientRect();
  const scale = Math.max(1, Math.min(MOST_ZOOM, zoom.scale * Math.exp(-event.deltaY / 400)));
  zoom = zoom.scale === 1 ? { scale, x: within((event.clientX - box.left) / box.width), y: within((event.clientY - box.top) / box.height) } : { ...zoom, scale };
  if (scale > 1 && event.deltaY < 0) ask(true);
  showZoom();
}

/** Larger pictures for a zoomed view. */
function ask(large) {
  if (isLarge === large) return;
  isLarge = large;
  refresh();
}

function takeDrag(begin) {
  const view = begin.target.closest?.(".view");
  if (!view || zoom.scale === 1) return;
  const box = view.getBoundingClientRect();
  const from = { ...zoom };
  const move = (event) => {
    const by = [event.clientX - begin.clientX, event.clientY - begin.clientY];
    if (Math.hypot(...by) > 3) isDragged = true;
    zoom = { ...from, x: within(from.x - by[0] / (box.width * (zoom.scale - 1))), y: within(from.y - by[1] / (box.height * (zoom.scale - 1))) };
    showZoom();
  };
  const end = () => { removeEventListener("pointermove", move); removeEventListener("pointerup", end); setTimeout(() => { isDragged = false; }); };
  addEventListener("pointermove", move);
  addEventListener("pointerup", end);
}
let isDragged = false;
let isLarge = false;

/** One picture as large as the window allows; it follows the timeline, whose keys go on working. */
function enlarge(camera) {
  large = camera;
  openPicture(camera.name, source(camera, LARGE_HEIGHT));
  byId("dialog").addEventListener("close", () => { large = null; }, { once: true });
}

/** Which colour is whose, where several bodies are drawn. */
function runColours() {
  const names = comparedHere();
  return names.some(Boolean) && element("span", { className: "run-colours" }, [get("run"), ...names].map((name, at) => name && element("span", {}, element("i", { className: "swatch", style: `background: ${seriesColour(at)}` }), name)));
}

function build() {
  fill(panel, cameras.map((camera, at) => element("button", { className: "view", title: "Click: enlarge. Wheel: zoom all views; drag: move them", draggable: false, dataset: { at }, onclick: () => { if (!isDragged) enlarge(camera); } },
    element("img", { alt: `View of ${camera.name}` }), element("span", { className: "caption" }, `${at + 1} ${camera.name}`),
    camera.quarter_turns > 0 && element("span", { className: "turn" }, `↻ ${camera.quarter_turns * 90}°`))));
  showZoom();
  refresh();
}

/** Look through camera number `at` in the scene; null for the free view. */
export function lookThrough(at) {
  if (at !== null && !cameras[at]) return;
  set({ through: at === null ? null : cameras[at].name });
}

/** Before there is a run: the footage's frames, from one end to the other. */
function footageSlider() {
  if (get("run") || !cameras.length || frameCount < 2) return null;
  const words = element("output", {}, `frame ${footageFrame()} of ${frameCount}`);
  const slider = element("input", { type: "range", min: 0, max: frameCount - 1, value: footageFrame(), ariaLabel: "Frame of the footage" });
  slider.oninput = () => { set({ frame: Number(slider.value) }); words.textContent = `frame ${footageFrame()} of ${frameCount}`; };
  return element("span", { className: "footage-slider" }, slider, words);
}

// Panels that have nothing to show of a session without a run: its footage is shown instead, until a run is opened.
const OF_RUNS = ["why", "views", "compare", "export"];
let instead = "";      // the panel that is shown again with a run

function showFootage() {
  const entry = get("sessions")?.find((one) => one.name === get("session"));
  if (!entry || !get("panel")) return;
  if (!get("run") && cameras.length && OF_RUNS.includes(get("panel"))) {
    instead = get("panel");
    set({ panel: "cameras" });
  } else if (get("run") && instead) {
    if (get("panel") === "cameras") set({ panel: instead });
    instead = "";
  }
}

/** The check boxes that stand in the tab line while this panel is open. */
export function cameraTools() {
  const offered = get("run") ? LAYERS : LAYERS.filter(([name]) => BEFORE_A_RUN.includes(name));
  return [footageSlider(), runColours(), button("Whole pictures", () => { zoom = { scale: 1, x: 0.5, y: 0.5 }; ask(false); showZoom(); }, "quiet small", { title: "No longer zoomed" }), ...offered.map(([name, label, title]) => check(label, {
    checked: shown.has(name), onchange: ({ target }) => {
      if (target.checked) shown.add(name); else shown.delete(name);
      localStorage.setItem("overlays", JSON.stringify([...shown]));
      refresh();
    },
  }, title))];
}

/** Wire the views to the state. */
export function startCameras() {
  watch(["session"], async () => {
    cameras = [];
    if (get("session")) {
      const session = get("session");
      try {
        const detail = await fetchJson(sessionPath(session));
        if (session !== get("session")) return;
        ({ cameras, frame_count: frameCount } = detail);
      } catch (error) { complain(error); }
    }
    build();
    showFootage();
  });
  let run = get("run");
  watch(["run"], () => { if (run === get("run")) return; run = get("run"); showFootage(); });
  watch(["frame", "run", "summary", "track", "trial", "trials", "compared"], refresh);
  onEvent("frame", (event, here) => {
    const seen = get("summary")?.frames.at(-1)?.frame ?? -1;
    if (here && !event.reannealed && event.frame <= seen) { age += 1; refresh(); }
  });
  watch(["camera"], showZoom);
  panel.addEventListener("wheel", takeWheel, { passive: false });
  panel.addEventListener("pointerdown", takeDrag);
  document.addEventListener("panel", refresh);
}
