// The keyboard. One table: what it does here is what the list says.

import { lookThrough } from "./cameras.js";
import { openList } from "./dialogs.js";
import { byId } from "./elements.js";
import { reanneal } from "./header.js";
import { togglePlay, toggleLoop } from "./playback.js";
import { enterScene } from "./scene_frame.js";
import { goTo, stepLayer } from "./selection.js";
import { get } from "./state.js";
import { frameBody, resetView, toggleFollow } from "./studio/scene_tools.js";
import { goToMark } from "./timeline.js";
import { stepParameter, stepView, toggleTable } from "./views.js";

/** @type {[string, string, (event: KeyboardEvent) => boolean, (event: KeyboardEvent) => void][]} */
const KEYS = [
  ["Space", "play or pause what is stored", (event) => event.key === " ", togglePlay],
  ["←", "frame before", (event) => event.key === "ArrowLeft" && !event.shiftKey, () => goTo(get("frame") - 1)],
  ["→", "next frame", (event) => event.key === "ArrowRight" && !event.shiftKey, () => goTo(get("frame") + 1)],
  ["Shift ←", "layer before", (event) => event.key === "ArrowLeft" && event.shiftKey, () => stepLayer(-1)],
  ["Shift →", "next layer", (event) => event.key === "ArrowRight" && event.shiftKey, () => stepLayer(1)],
  ["Home", "first frame", (event) => event.key === "Home", () => goTo(-Infinity)],
  ["End", "last frame", (event) => event.key === "End", () => goTo(Infinity)],
  ["n", "next mark of the timeline: search lost, a limb off, limb lost (truth), no evidence, found again, corrected", (event) => event.key === "n", () => goToMark(1)],
  ["p", "mark before", (event) => event.key === "p", () => goToMark(-1)],
  ["1 – 9", "look through a camera", (event) => /^[1-9]$/.test(event.key), (event) => lookThrough(Number(event.key) - 1)],
  ["0", "the first view of the scene; free of a camera", (event) => event.key === "0", resetView],
  ["f", "frame the body in the scene", (event) => event.key === "f", frameBody],
  ["g", "go along with the body from frame to frame", (event) => event.key === "g", toggleFollow],
  ["v", "next view; Shift v the one before", (event) => event.key.toLowerCase() === "v", (event) => stepView(event.shiftKey ? -1 : 1)],
  ["[ ]", "parameter before, next parameter", (event) => event.key === "[" || event.key === "]", (event) => stepParameter(event.key === "]" ? 1 : -1)],
  ["t", "the view's numbers as a table, or its drawing", (event) => event.key === "t", toggleTable],
  ["r", "anneal this frame again", (event) => event.key === "r", reanneal],
  ["c", "correct this frame by hand", (event) => event.key === "c", () => byId("correct").click()],
  ["l", "loop", (event) => event.key === "l", toggleLoop],
  ["s", "into the scene's panel; Escape leads back", (event) => event.key === "s", () => enterScene()],
  ["Ctrl K", "find a view, a panel, a command", () => false, () => {}],
  ["?", "this list", (event) => event.key === "?", () => showKeys()],
];

function showKeys() {
  openList("Keys", KEYS.map(([key, what]) => [key, what]));
}

// What needs all keys for itself, and what needs the arrows only up and down or not at all.
const TYPING = "input:not([type=checkbox]), textarea, dialog:not(.large-view), [role=slider]:not(#track), [role=menu], [role=tab]";
const CHOOSING = "select, input[type=checkbox]";

/** Do what a key says; typing in a field and holding control are left alone. */
export function takeKey(event) {
  const isArrow = event.key === "ArrowLeft" || event.key === "ArrowRight";
  const typing = event.target.closest?.(isArrow ? TYPING : `${TYPING}, ${CHOOSING}`);
  if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
  if ((event.key === " " || event.key === "Enter") && event.target.closest?.("button, a")) return;
  const found = KEYS.find(([, , fits]) => fits(event));
  if (!found) return;
  event.preventDefault();
  found[3](event);
}

/** What single keys do, for the command palette: the key, its words, and what it does. @returns {[string, string, () => void][]} */
export const commands = () => KEYS.filter(([key]) => key.length === 1 && !/[?sv]/.test(key) || ["Space", "Home", "End"].includes(key))
  .map(([key, words, , act]) => [key, words, () => act(new KeyboardEvent("keydown", { key: key === "Space" ? " " : key }))]);

/** Listen on the page. */
export function startKeys() {
  document.addEventListener("keydown", takeKey);
}
