// The scene's frame: viser's own page, in the studio's type and colours, with the page's keys
// working in it.

import { post } from "./api.js";
import { byId } from "./elements.js";
import { loadScene } from "./scene_window.js";
import { onTheme, theme, token } from "./theme.js";

/** @type {HTMLIFrameElement} */
const frame = byId("scene");
const FONT = "/assets/vendor/inter.woff2";
/**
 * Pixels up to which a scene is too narrow for its panel beside the body: it is there when it is
 * asked for.
 */
export const NARROW = 620;
const CONTROLS = "[role=slider], [role=tab], input, textarea, select";
const style = document.createElement("style");
let hasKnobs = false;

function look() {
  const dark =
    theme() === "dark"
      ? `
      --mantine-color-dark-4: ${token("line-strong")} !important;
      --mantine-color-dark-5: ${token("line")} !important;
      --mantine-color-dark-6: ${token("surface-raised")} !important;
      --mantine-color-dark-7: ${token("surface")} !important;`
      : "";
  return `
    body, body * { font-family: "Inter", system-ui, sans-serif !important; letter-spacing: 0 !important; font-variant-numeric: tabular-nums; }
    label, label * { font-size: 11.5px !important; letter-spacing: -.03em !important; }
    @media (max-width: ${NARROW}px) { :root:not([data-knobs]) .mantine-Paper-root:has(.mantine-ScrollArea-root) { display: none !important; } }
    .mantine-Notifications-root[data-position^="top"] { top: 92px !important; }
    [role="tab"] { padding-inline: 8px !important; font-size: 12.5px !important; }
    * { scrollbar-width: thin; scrollbar-color: ${token("line-strong")} transparent; }
    :root, :root[data-mantine-color-scheme] {
      --mantine-color-body: ${token("surface")} !important;
      --mantine-color-text: ${token("text")} !important;
      --mantine-color-dimmed: ${token("text-quiet")} !important;
      --mantine-color-default: ${token("surface-raised")} !important;
      --mantine-color-default-border: ${token("line-strong")} !important;${dark}
    }`;
}

async function dress() {
  /** @type {any} */
  const page = frame.contentDocument;
  style.textContent = look();
  page.head.append(style);
  showKnobs(hasKnobs);
  if (![...page.fonts].some((face) => face.family === "Inter")) {
    const face = new page.defaultView.FontFace("Inter", await (await fetch(FONT)).arrayBuffer(), {
      weight: "100 900",
    });
    page.fonts.add(await face.load());
  }
}

/** Keys for a slider or a field must not turn the view as well, which listens further out. */
function keepToControls(event) {
  if (event.target.closest?.(CONTROLS)) event.stopPropagation();
}

/**
 * The page's keys come first: arrows step through the timeline wherever the focus is, and do not
 * turn the view as well.
 */
const first = (takeKey) => (event) => {
  if (event.target.closest?.(CONTROLS)) return;
  takeKey(event);
  if (event.defaultPrevented) event.stopImmediatePropagation();
};

/**
 * Show the panel with the knobs in a scene that is too narrow for it, or no longer.
 * @param {boolean} isShown
 */
export function showKnobs(isShown) {
  hasKnobs = isShown;
  frame.contentDocument?.documentElement.toggleAttribute("data-knobs", hasKnobs);
}

/**
 * Put the keyboard into the scene's panel: the frame is no stop of the page's own, for its many
 * controls' sake.
 */
export function enterScene() {
  const tab = /** @type {HTMLElement} */ (
    frame.contentDocument?.querySelector("[role=tab][aria-selected=true]")
  );
  (tab ?? frame).focus();
}

/** Escape gives the keyboard back to the timeline, unless it closes something first. */
function leaveScene(event) {
  if (event.key !== "Escape" || event.target.closest?.("[aria-expanded=true], [role=dialog]"))
    return;
  event.target.blur?.();
  byId("track").focus();
}

const WHEEL_MILLISECONDS = 40;
const WHEEL_STEP = 0.0016; // of the distance's logarithm, a pixel of the wheel
const CLICK_PIXELS = 4;

/** Where in the canvas an event is, shares of its width and height; null beside it. */
function placeOf(event) {
  if (event.target.tagName !== "CANVAS") return null;
  const box = event.target.getBoundingClientRect();
  const [across, down] = [
    (event.clientX - box.left) / box.width,
    (event.clientY - box.top) / box.height,
  ];
  return across >= 0 && across <= 1 && down >= 0 && down <= 1 ? [across, down] : null;
}

/**
 * The wheel goes to what is under the pointer and never loses the body: the studio moves the
 * camera, not viser.
 */
function zoomWithWheel(page) {
  let [turned, at, isSending] = [0, [0.5, 0.5], false];
  const send = async () => {
    isSending = true;
    while (turned) {
      const zoom = Math.exp(Math.max(-1, Math.min(1, turned * WHEEL_STEP)));
      turned = 0;
      await post("/api/scene/camera", { zoom, at }).catch(() => {});
      await new Promise((resolve) => setTimeout(resolve, WHEEL_MILLISECONDS));
    }
    isSending = false;
  };
  page.addEventListener(
    "wheel",
    (event) => {
      const place = placeOf(event);
      if (!place || event.ctrlKey) return;
      event.preventDefault();
      event.stopImmediatePropagation();
      turned += event.deltaY * (event.deltaMode === 1 ? 30 : 1);
      at = place;
      if (!isSending) send();
    },
    { capture: true, passive: false },
  );
}

/**
 * Call `hover(place, event)` as the pointer moves over the scene (null where it leaves),
 * `click(place)` where it is clicked.
 */
function followPointer(page, { hover, click }) {
  let pressed = null;
  page.addEventListener(
    "pointermove",
    (event) => {
      if (!event.buttons) hover(placeOf(event), event);
    },
    true,
  );
  page.document.addEventListener("pointerleave", (event) => hover(null, event));
  page.addEventListener(
    "pointerdown",
    (event) => {
      pressed = event.button === 0 ? [event.clientX, event.clientY] : null;
      hover(null, event);
    },
    true,
  );
  page.addEventListener(
    "pointerup",
    (event) => {
      const place = placeOf(event);
      const isStill =
        pressed &&
        Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < CLICK_PIXELS;
      if (place && isStill) click(place);
      pressed = null;
    },
    true,
  );
}

/** Let the page's keys work in a scene that was loaded; `takeKey` handles them. */
export function shareKeys(/** @type {Window} */ page, takeKey) {
  for (const kind of ["keydown", "keyup"])
    page.document.body.addEventListener(kind, keepToControls);
  page.addEventListener("keydown", first(takeKey), true);
  page.addEventListener("keydown", leaveScene, true);
}

/**
 * Load the scene, dressed as the page; `takeKey` handles the page's keys in it, `pointer` what the
 * pointer does over it.
 */
export function startSceneFrame(takeKey, pointer) {
  frame.addEventListener("load", () => {
    const page = frame.contentWindow;
    if (!page || frame.src.endsWith("about:blank")) return;
    dress();
    shareKeys(page, takeKey);
    zoomWithWheel(page);
    followPointer(page, pointer);
    // Whoever clicks a tab goes on with the timeline's keys.
    page.addEventListener("click", (/** @type {any} */ event) => {
      if (event.detail) event.target.closest?.("[role=tab]")?.blur();
    });
  });
  onTheme(() => {
    style.textContent = look();
  });
  loadScene(frame);
}
