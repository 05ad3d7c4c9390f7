// This window's own scene in a frame of the page, in the page's theme.

import { post } from "./api.js";
import { onTheme, theme } from "./theme.js";
import { scenePath } from "./window.js";

let isLoaded = false;

/** Put the scene into the page's theme. */
export const dressScene = () => post("/api/scene/view", { dark: theme() === "dark" }).catch(() => {});

/** Load the scene into a frame; returns the frame. */
export function loadScene(frame) {
  if (!isLoaded) onTheme(dressScene);
  isLoaded = true;
  dressScene();
  frame.src = scenePath;
  return frame;
}
