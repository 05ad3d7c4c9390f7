// The camera views side by side: picture under outlines, mask, edge map, sample points; a click
// enlarges one.

import { fetchJson, runPath, sessionPath } from "../api.js";
import { seriesToken } from "../chart_looks.js";
import { openPicture } from "./dialogs.js";
import { showPicture } from "../elements.js";
import { onEvent } from "../live.js";
import { complain } from "../messages.js";
import { comparedRuns, shownTrial } from "../selection.js";
import { get, set, watch } from "../state.js";
import { batch, computed, follow, html, signal, useEffect, useRef } from "./component.js";

/** @typedef {{ name: string, quarter_turns: number }} Camera */

/** @type {[string, string, string][]} */
const LAYERS = [
  ["outline", "outlines", "Bodies as outlines"],
  ["filled", "filled", "Bodies filled"],
  ["truth", "truth", "The reference as a stick figure"],
  ["mask", "mask", "Red: only observed; blue: only the body; yellow: both"],
  ["edges", "edge map", "How strong an edge the search sees in each pixel"],
  ["samples", "sample points", "The points that the likelihood reads"],
  [
    "cost",
    "cost",
    "The points that the likelihood reads, from cool (fits) to warm (costs most): " +
      "(1 − p)² of edge map and mask",
  ],
  ["particles", "particles", "The particles of the frame's layers"],
];
/** Those that need no run: outlines are the start pose's then. */
const BEFORE_A_RUN = ["outline", "mask", "edges"];
const HEIGHT = 400;
const LARGE_HEIGHT = 1080;
const MOST_ZOOM = 12;
const WHEEL_DISTANCE = 400; // that zooms by e
const DRAG_PIXELS = 3;
const WHOLE = { scale: 1, x: 0.5, y: 0.5 };

const overlays = signal(
  /** @type {string[]} */ (JSON.parse(localStorage.getItem("overlays") ?? '["outline"]')),
);
const cameras = signal(/** @type {Camera[]} */ ([]));
/** Frames of the footage. */
const frameCount = signal(1);
/** Rises when a frame got another answer, so that its pictures are requested again. */
const age = signal(0);
/** How all views are zoomed together: the share of a picture that stays in its place. */
const zoom = signal(WHOLE);
let isDragged = false;

const within = (share) => Math.max(0, Math.min(1, share));

/** The frame of the footage that is looked at before there is a run. */
const footageFrame = () => Math.max(0, Math.min(frameCount.value - 1, follow("frame") ?? 0));

/**
 * The compared runs that the same cameras saw, those of this session; "" in the places of the
 * others.
 */
function comparedHere() {
  const session = follow("session");
  follow("run");
  follow("compared");
  return comparedRuns().map((name) => {
    const [of, run] = name.split("/");
    return of === session ? run : "";
  });
}

/** @param {(number | null)[]} pose */
const poseWords = (pose) => pose.map((value) => Number((value ?? 0).toPrecision(7))).join(",");

/**
 * The pictures that are shown, without camera and height: of the run's frame, or before there is a
 * run of the footage's.
 */
const wanted = computed(() => {
  const [session, run, frame] = [follow("session"), follow("run"), follow("frame")];
  if (!session || (run && frame === null)) return null;
  const query = new URLSearchParams({ show: overlays.value.join(",") });
  if (age.value) query.set("age", String(age.value));
  if (!run) return { place: `${sessionPath(session)}/frames/${footageFrame()}`, query };
  follow("trial");
  follow("trials");
  const [track, tried, compared] = [follow("track"), shownTrial(), comparedHere()];
  if (track !== "raw") query.set("track", track);
  if (tried) query.set("beside", poseWords(tried.pose));
  if (compared.some(Boolean)) query.set("compared", compared.join(","));
  return { place: `${runPath(session, run)}/frames/${frame}`, query };
});

/** A view's address, null while there is none. @param {Camera} camera @param {number} height */
function source({ name }, height) {
  if (!wanted.value) return null;
  const { place, query } = wanted.value;
  const own = new URLSearchParams([["height", String(height)], ...query]);
  return `${place}/views/${encodeURIComponent(name)}.jpg?${own}`;
}

/** The wheel zooms all views about the place under the pointer. */
function takeWheel(event) {
  event.preventDefault();
  const box = event.currentTarget.getBoundingClientRect();
  const now = zoom.value;
  const scale = now.scale * Math.exp(-event.deltaY / WHEEL_DISTANCE);
  const about =
    now.scale === 1
      ? {
          x: within((event.clientX - box.left) / box.width),
          y: within((event.clientY - box.top) / box.height),
        }
      : now;
  zoom.value = { x: about.x, y: about.y, scale: Math.max(1, Math.min(MOST_ZOOM, scale)) };
}

/** A zoomed view is dragged, and all move with it. */
function takeDrag(begin) {
  const from = zoom.value;
  if (from.scale === 1) return;
  const box = begin.currentTarget.getBoundingClientRect();
  const moved = (by, size) => by / (size * (from.scale - 1));
  const move = (event) => {
    const [right, down] = [event.clientX - begin.clientX, event.clientY - begin.clientY];
    if (Math.hypot(right, down) > DRAG_PIXELS) isDragged = true;
    zoom.value = {
      scale: from.scale,
      x: within(from.x - moved(right, box.width)),
      y: within(from.y - moved(down, box.height)),
    };
  };
  const end = () => {
    removeEventListener("pointermove", move);
    removeEventListener("pointerup", end);
    setTimeout(() => {
      isDragged = false;
    });
  };
  addEventListener("pointermove", move);
  addEventListener("pointerup", end);
}

/** One picture as large as the window allows; it follows the timeline, whose keys go on working. */
function enlarge(camera) {
  if (isDragged) return;
  openPicture(camera.name, () => source(camera, LARGE_HEIGHT));
}

/** A camera's picture under its name. @param {{ camera: Camera, at: number }} properties */
function CameraView({ camera, at }) {
  const image = useRef(/** @type {HTMLImageElement | null} */ (null));
  const button = useRef(/** @type {HTMLElement | null} */ (null));
  const { scale, x, y } = zoom.value;
  const address = source(camera, scale > 1 ? LARGE_HEIGHT : HEIGHT);
  const isOpen = follow("panel") === "cameras";
  useEffect(() => {
    if (isOpen && address) showPicture(image.current, address);
  }, [isOpen, address]);
  useEffect(() => {
    // A listener that may keep the page from scrolling has to say so.
    button.current?.addEventListener("wheel", takeWheel, { passive: false });
  }, []);
  const style = {
    transformOrigin: `${100 * x}% ${100 * y}%`,
    transform: scale === 1 ? "" : `scale(${scale})`,
  };
  return html`<button
    ref=${button}
    type="button"
    class=${`view ${camera.name === follow("camera") ? "chosen" : ""}`}
    title="Click: enlarge. Wheel: zoom all views; drag: move them"
    draggable=${false}
    onPointerDown=${takeDrag}
    onClick=${() => enlarge(camera)}
  >
    <img ref=${image} alt=${`View of ${camera.name}`} style=${style} />
    <span class="caption">${at + 1} ${camera.name}</span>
    ${camera.quarter_turns > 0 && html`<span class="turn">↻ ${camera.quarter_turns * 90}°</span>`}
  </button>`;
}

/** The views of the session's cameras. */
export const Cameras = () =>
  cameras.value.map(
    (camera, at) => html`<${CameraView} key=${camera.name} camera=${camera} at=${at} />`,
  );

/** Before there is a run: the footage's frames, from one end to the other. */
function FootageSlider() {
  if (follow("run") || !cameras.value.length || frameCount.value < 2) return null;
  const frame = footageFrame();
  return html`<span class="footage-slider">
    <input
      type="range"
      min="0"
      max=${frameCount.value - 1}
      value=${frame}
      aria-label="Frame of the footage"
      onInput=${({ currentTarget }) => set({ frame: Number(currentTarget.value) })}
    /><output>frame ${frame} of ${frameCount.value}</output>
  </span>`;
}

/** Which colour is whose, where several bodies are drawn. */
function RunColours() {
  const names = comparedHere();
  if (!names.some(Boolean)) return null;
  const colour = (at) => ({ background: `var(--${seriesToken(at)})` });
  return html`<span class="run-colours">
    ${[follow("run"), ...names].map(
      (name, at) =>
        name && html`<span key=${name}><i class="swatch" style=${colour(at)}></i>${name}</span>`,
    )}
  </span>`;
}

function choose(name, isChosen) {
  const others = overlays.value.filter((one) => one !== name);
  overlays.value = isChosen ? [...others, name] : others;
  localStorage.setItem("overlays", JSON.stringify(overlays.value));
}

/** What stands in the tab line while this panel is open. */
export function CameraTools() {
  const hasRun = follow("run");
  const whole = () => {
    zoom.value = WHOLE;
  };
  return html`
    <${FootageSlider} />
    <${RunColours} />
    <button type="button" class="quiet small" title="No longer zoomed" onClick=${whole}>
      Whole pictures
    </button>
    ${LAYERS.filter(([name]) => hasRun || BEFORE_A_RUN.includes(name)).map(
      ([name, label, title]) =>
        html`<label key=${name} class="check" title=${title}>
          <input
            type="checkbox"
            checked=${overlays.value.includes(name)}
            onChange=${({ currentTarget }) => choose(name, currentTarget.checked)}
          />${label}
        </label>`,
    )}
  `;
}

/** Look through camera number `at` in the scene; null for the free view. */
export function lookThrough(at) {
  if (at !== null && !cameras.value[at]) return;
  set({ through: at === null ? null : cameras.value[at].name });
}

// Panels that have nothing to show of a session without a run: its footage is shown instead, until
// a run is opened.
const OF_RUNS = ["why", "views", "compare", "export"];
let instead = ""; // the panel that is shown again with a run

function showFootage() {
  const entry = get("sessions")?.find((one) => one.name === get("session"));
  if (!entry || !get("panel")) return;
  if (!get("run") && cameras.value.length && OF_RUNS.includes(get("panel"))) {
    instead = get("panel");
    set({ panel: "cameras" });
  } else if (get("run") && instead) {
    if (get("panel") === "cameras") set({ panel: instead });
    instead = "";
  }
}

async function load() {
  const session = get("session");
  cameras.value = [];
  if (session) {
    try {
      const detail = await fetchJson(sessionPath(session));
      if (session !== get("session")) return;
      batch(() => {
        cameras.value = detail.cameras;
        frameCount.value = detail.frame_count;
      });
    } catch (error) {
      complain(error);
    }
  }
  showFootage();
}

/** Follow the session and its run. */
export function startCameras() {
  watch(["session"], load);
  let run = get("run");
  watch(["run"], () => {
    if (run === get("run")) return;
    run = get("run");
    showFootage();
  });
  onEvent("frame", (event, here) => {
    const seen = get("summary")?.frames.at(-1)?.frame ?? -1;
    if (here && !event.reannealed && event.frame <= seen) age.value += 1;
  });
}
