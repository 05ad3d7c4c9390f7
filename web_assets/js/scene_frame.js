// The scene's frame: viser's own page, in the studio's type and colours, with the page's keys working in it.

import { byId } from "./elements.js";
import { loadScene } from "./scene_window.js";
import { onTheme, theme, token } from "./theme.js";

/** @type {HTMLIFrameElement} */
const frame = byId("scene");
const FONT = "/assets/vendor/inter.woff2";
const CONTROLS = "[role=slider], [role=tab], input, textarea, select";
const style = document.createElement("style");

function look() {
  const dark = theme() === "dark" ? `
      --mantine-color-dark-4: ${token("line-strong")} !important;
      --mantine-color-dark-5: ${token("line")} !important;
      --mantine-color-dark-6: ${token("surface-raised")} !important;
      --mantine-color-dark-7: ${token("surface")} !important;` : "";
  return `
    body, body * { font-family: "Inter", system-ui, sans-serif !important; letter-spacing: 0 !important; font-variant-numeric: tabular-nums; }
    label, label * { font-size: 11.5px !important; letter-spacing: -.03em !important; }
    @media (max-width: 620px) { .mantine-Paper-root:has(.mantine-ScrollArea-root) { display: none; } }
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
  if (![...page.fonts].some((face) => face.family === "Inter")) {
    const face = new page.defaultView.FontFace("Inter", await (await fetch(FONT)).arrayBuffer(), { weight: "100 900" });
    page.fonts.add(await face.load());
  }
}

/** Keys for a slider or a field must not turn the view as well, which listens further out. */
function keepToControls(event) {
  if (event.target.closest?.(CONTROLS)) event.stopPropagation();
}

/** The page's keys come first: arrows step through the timeline wherever the focus is, and do not turn the view as well. */
const first = (takeKey) => (event) => {
  if (event.target.closest?.(CONTROLS)) return;
  takeKey(event);
  if (event.defaultPrevented) event.stopImmediatePropagation();
};

/** Put the keyboard into the scene's panel: the frame is no stop of the page's own, for its many controls' sake. */
export function enterScene() {
  const tab = /** @type {HTMLElement} */ (frame.contentDocument?.querySelector("[role=tab][aria-selected=true]"));
  (tab ?? frame).focus();
}

/** Escape gives the keyboard back to the timeline, unless it closes something first. */
function leaveScene(event) {
  if (event.key !== "Escape" || event.target.closest?.("[aria-expanded=true], [role=dialog]")) return;
  event.target.blur?.();
  byId("track").focus();
}

/** Let the page's keys work in a scene that was loaded; `takeKey` handles them. */
export function shareKeys(/** @type {HTMLIFrameElement} */ scene, takeKey) {
  for (const kind of ["keydown", "keyup"]) scene.contentDocument.body.addEventListener(kind, keepToControls);
  scene.contentWindow.addEventListener("keydown", first(takeKey), true);
  scene.contentWindow.addEventListener("keydown", leaveScene, true);
}

/** Load the scene, dressed as the page; `takeKey` handles the page's keys in it. */
export function startSceneFrame(takeKey) {
  frame.addEventListener("load", () => {
    if (frame.src.endsWith("about:blank")) return;
    dress();
    shareKeys(frame, takeKey);
    // Whoever clicks a tab goes on with the timeline's keys.
    frame.contentWindow.addEventListener("click", (/** @type {any} */ event) => { if (event.detail) event.target.closest?.("[role=tab]")?.blur(); });
  });
  onTheme(() => { style.textContent = look(); });
  loadScene(frame);
}
