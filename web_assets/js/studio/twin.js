// The twin: while a trial is shown, a second scene lies over the first one's canvas, cut off by a
// divider that can be dragged: stored at its left, tried at its right. The studio keeps both
// scenes' cameras and choices the same.

import { post, readOnly } from "../api.js";
import { byId } from "../elements.js";
import { complain } from "../messages.js";
import { shareKeys } from "../scene_frame.js";
import { besideTrial, shownTrial } from "../selection.js";
import { get } from "../state.js";
import { triedScenePath } from "../window.js";
import { effect, follow, html, mount, signal, useEffect, useRef } from "./component.js";
import { movedWords } from "./trial_card.js";
import { placeOf } from "./trials.js";

const STEP = 0.02;
const LEAST = 0.04;
const LOOK_MILLISECONDS = 100;
const SIDE_PIXELS = 8;
const PANEL = ".mantine-Paper-root:has(.mantine-ScrollArea-root)";
const KEPT = "twin-share";

/** Where the divider stands, as a share of the canvas. */
const share = signal(Number(localStorage.getItem(KEPT)) || 0.5);
/**
 * The box of the first scene's canvas in the stage, null while it has none.
 * @type {import("@preact/signals").Signal<DOMRect | null>}
 */
const canvasBox = signal(null);
/**
 * The box of the first scene's panel in the stage, null while it is not shown. Where the scene is
 * narrow it lies over the canvas.
 * @type {import("@preact/signals").Signal<DOMRect | null>}
 */
const panelBox = signal(null);
/**
 * Whether a trial was shown since the page was loaded: from then on the second scene is kept ready.
 */
const isNeeded = signal(false);
/** Whether the second scene draws. */
const isReady = signal(false);
/** Whether the scenes are split: then trials are in the second one. */
const isSplit = signal(false);

/**
 * Whether the scenes were split before the trial had ended: then some of its layers were not heard
 * by the second one.
 */
let isUnnamed = false;

/** @param {number} value */
function moveTo(value) {
  share.value = Math.max(LEAST, Math.min(1 - LEAST, value));
  localStorage.setItem(KEPT, share.value.toFixed(3));
}

/** @param {Document | null} page a scene's */
const canvasOf = (page) => page?.querySelector("canvas") ?? null;

/**
 * Note where an element is, unless nothing changed.
 * @param {import("@preact/signals").Signal<DOMRect | null>} place
 * @param {Element | null | undefined} element
 */
function note(place, element) {
  const [box, before] = [element?.getBoundingClientRect(), place.value];
  const isSame =
    box && before && ["x", "y", "width", "height"].every((key) => box[key] === before[key]);
  if (!isSame) place.value = box?.width ? box : null;
}

/**
 * Keep the boxes of canvas and panel up to date: the panel may be folded or lie over the canvas, the
 * page's columns may move.
 */
function followCanvas() {
  const frame = /** @type {HTMLIFrameElement} */ (byId("scene"));
  /** @type {WeakSet<Element>} */
  const observed = new WeakSet();
  const measure = () => {
    const canvas = canvasOf(frame.contentDocument);
    const panel = frame.contentDocument?.querySelector(PANEL);
    note(canvasBox, canvas);
    note(panelBox, panel);
    for (const element of [canvas, panel]) {
      if (!element || observed.has(element)) continue;
      observed.add(element);
      observer.observe(element);
    }
    return Boolean(canvas && panel);
  };
  const observer = new ResizeObserver(() => {
    measure();
    // The scene puts another panel in its place where it becomes narrow or wide.
    setTimeout(measure, LOOK_MILLISECONDS);
  });
  observer.observe(frame);
  frame.addEventListener("load", () => {
    const wait = setInterval(() => {
      if (measure()) clearInterval(wait);
    }, LOOK_MILLISECONDS);
  });
}

/**
 * The panel in the box of the canvas: what of it lies over the canvas; null where nothing does.
 * @param {DOMRect} canvas
 * @param {DOMRect | null} panel
 */
function panelOver(canvas, panel) {
  if (!panel) return null;
  const [left, top] = [Math.max(0, panel.left - canvas.left), Math.max(0, panel.top - canvas.top)];
  const right = Math.min(canvas.width, panel.right - canvas.left);
  const bottom = Math.min(canvas.height, panel.bottom - canvas.top);
  return right > left && bottom > top ? { left, top, right, bottom } : null;
}

/** Split the scenes, or join them again, on the server. @param {boolean} split */
async function split(split) {
  if (split === isSplit.value) return;
  isSplit.value = split;
  const places = split
    ? { trial: placeOf(get("trial")), against: placeOf(get("against")), discard: true }
    : {};
  try {
    isUnnamed = split && !get("trial");
    await post("/api/scene/show", { ...places, twin: split });
  } catch (error) {
    // Not tried again by itself: the trial is shown in the first scene as long as the page is.
    isReady.value = false;
    isSplit.value = false;
    complain(error);
  }
}

/** The second scene. @param {{ takeKey: (event: KeyboardEvent) => void }} properties */
function TriedScene({ takeKey }) {
  const frame = useRef(/** @type {HTMLIFrameElement | null} */ (null));
  useEffect(() => {
    const scene = /** @type {HTMLIFrameElement} */ (frame.current);
    let wait = 0;
    scene.addEventListener("load", () => {
      const page = scene.contentDocument;
      if (!page || !scene.contentWindow) return;
      shareKeys(scene.contentWindow, takeKey);
      const style = page.createElement("style");
      // The first scene has the panel and says what there is to say.
      style.textContent =
        "body > *:not(#root) { display: none !important } .mantine-Notifications-root, .mantine-Paper-root { display: none !important }";
      page.head.append(style);
      wait = window.setInterval(() => {
        if (!canvasOf(page)) return;
        clearInterval(wait);
        isReady.value = true;
      }, LOOK_MILLISECONDS);
    });
    scene.src = triedScenePath;
    return () => clearInterval(wait);
  }, []);
  const style = { clipPath: `inset(0 0 0 ${100 * share.value}%)` };
  return html`<iframe
    ref=${frame}
    class="tried-scene"
    style=${style}
    tabindex="-1"
    title="3-D scene: what was tried"
  />`;
}

function Divider() {
  /** @param {PointerEvent} event */
  const drag = (event) => {
    const box = canvasBox.value;
    const bar = /** @type {HTMLElement} */ (event.currentTarget);
    if (!box || !bar.hasPointerCapture(event.pointerId)) return;
    const left = bar.parentElement?.getBoundingClientRect().left ?? 0;
    moveTo((event.clientX - left) / box.width);
  };
  /** @param {KeyboardEvent} event */
  const step = (event) => {
    const to = { ArrowLeft: share.value - STEP, ArrowRight: share.value + STEP, Home: 0, End: 1 };
    const value = to[/** @type {keyof typeof to} */ (event.key)];
    if (value === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    moveTo(value);
  };
  return html`<div
    class="divider"
    role="separator"
    tabindex="0"
    aria-orientation="vertical"
    aria-label="Stored at the left, tried at the right"
    aria-valuemin="0"
    aria-valuemax="100"
    aria-valuenow=${Math.round(100 * share.value)}
    title="Drag, or use the arrow keys; a double click goes to the middle"
    style=${{ left: `${100 * share.value}%` }}
    onPointerDown=${(/** @type {PointerEvent} */ event) => /** @type {HTMLElement} */ (event.currentTarget).setPointerCapture(event.pointerId)}
    onPointerMove=${drag}
    onKeyDown=${step}
    onDblClick=${() => moveTo(0.5)}
  >
    <i></i>
  </div>`;
}

/** What stands on each side of the divider. @param {{ bottom: number }} properties pixels */
function Sides({ bottom }) {
  follow("trials");
  follow("trial");
  follow("against");
  const [tried, beside] = [shownTrial(), besideTrial()];
  const left =
    beside && "moved" in beside
      ? `tried: ${movedWords(/** @type {any} */ (beside).moved)}`
      : "stored";
  const words = tried ? `tried: ${movedWords(tried.moved)}` : "tried";
  const place = `${100 * share.value}%`;
  const low = { bottom: `${bottom}px` };
  const atLeft = { ...low, right: `calc(100% - ${place} + 8px)` };
  const atRight = { ...low, left: `calc(${place} + 8px)` };
  return html`<span class="side stored" style=${atLeft}>${left}</span>
    <span class="side tried" style=${atRight}>${words}</span>`;
}

/** @param {{ takeKey: (event: KeyboardEvent) => void }} properties */
function Twin({ takeKey }) {
  const box = canvasBox.value;
  if (!isNeeded.value || !box) return null;
  // Cut out around the knobs, which are in the scene below it.
  const panel = panelOver(box, panelBox.value);
  const { left = 0, top = 0, right = 0, bottom = 0 } = panel ?? {};
  const [whole, hole] = [
    `M0 0H${box.width}V${box.height}H0Z`,
    `M${left} ${top}H${right}V${bottom}H${left}Z`,
  ];
  const style = {
    left: `${box.x}px`,
    top: `${box.y}px`,
    width: `${box.width}px`,
    height: `${box.height}px`,
    clipPath: panel ? `path(evenodd, "${whole}${hole}")` : "",
  };
  return html`<div class=${`twin-box ${isSplit.value ? "" : "away"}`} style=${style}>
    <${TriedScene} takeKey=${takeKey} />
    ${isSplit.value && html`<${Sides} bottom=${SIDE_PIXELS + (panel ? box.height - top : 0)} /><${Divider} />`}
  </div>`;
}

/** Wire the second scene to the state. @param {(event: KeyboardEvent) => void} takeKey */
export function startTwin(takeKey) {
  // Who may only look tries nothing.
  if (readOnly) return;
  followCanvas();
  effect(() => {
    const isTried = Boolean(follow("whatIf"));
    if (isTried) isNeeded.value = true;
    split(isTried && isReady.value && Boolean(canvasBox.value));
  });
  effect(() => {
    const trial = follow("trial");
    if (!trial || !isUnnamed) return;
    isUnnamed = false;
    post("/api/scene/show", { trial: placeOf(trial) }).catch(complain);
  });
  mount(byId("twin"), html`<${Twin} takeKey=${takeKey} />`);
}
