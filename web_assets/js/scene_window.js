// This window's own scene in a frame of the page, in the page's theme.

import { post } from "./api.js";
import { onTheme, theme } from "./theme.js";
import { scenePath } from "./window.js";

let isLoaded = false;

/** Whether this browser draws without a graphics card. */
function drawsInSoftware() {
  const context = document.createElement("canvas").getContext("webgl2");
  const names = context?.getExtension("WEBGL_debug_renderer_info");
  const name = context && names ? context.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

const look = () => ({ dark: theme() === "dark" });
const show = (change) => post("/api/scene/view", change).catch(() => {});

/** Put a new scene into the page's theme, and take out what this browser would draw too slowly. */
export function dressScene() {
  // `scene_context.js` reads it too, inside the scene's own page.
  const looks = document.documentElement.dataset;
  looks.drawing ??= drawsInSoftware() ? "software" : "card";
  show({ ...look(), ...(looks.drawing === "software" ? { options: { shadows: false } } : {}) });
}

/** Load the scene into a frame; returns the frame. */
export function loadScene(frame) {
  if (!isLoaded) onTheme(() => show(look()));
  isLoaded = true;
  dressScene();
  frame.src = scenePath;
  return frame;
}
