// The keyboard. One table: what it does here is what the list says.

import { openList } from "./dialogs.js";
import { lookThrough } from "./cameras.js";
import { correctFrame, leaveCorrecting } from "./correcting.js";
import { leavePlayback, pauseOrPlay, toggleLoop } from "./playback.js";
import { enterScene } from "../scene_frame.js";
import { goTo } from "../selection.js";
import { get } from "../state.js";
import { goToMark } from "./timeline.js";
import { toggleLayers } from "./layer_playback.js";
import { leaveLayers, step as stepLayer } from "./layer_strip.js";
import { toggleBookmark } from "./notes.js";
import { frameBody, resetView, toggleFollow } from "./scene_tools.js";
import { reanneal } from "./tracking.js";
import { stepParameter, stepView, toggleTable } from "./views.js";

/** Leave the view through a camera. Whether there was one. */
function leaveCamera() {
  if (get("through") === null) return false;
  lookThrough(null);
  return true;
}

/** Leave one mode, the innermost first; false where there is none. */
const leave = () =>
  [leavePlayback, leaveLayers, leaveCorrecting, leaveCamera].some((leaveIt) => leaveIt());

const isArrow = (name, shift) => (event) => event.key === name && event.shiftKey === shift;
const is = (name) => (event) => event.key === name;
const MARKS =
  "next mark of the timeline: search lost, a limb off, limb lost (truth), no evidence, " +
  "found again, corrected, noted";

/**
 * The key, what it does in words, whether an event is it, and what it does: false where it did
 * nothing.
 * @type {[string, string, (event: any) => boolean, (event: KeyboardEvent) => unknown][]}
 */
const KEYS = [
  ["Space", "pause what plays, else play the frames", isArrow(" ", false), pauseOrPlay],
  ["Shift Space", "play or pause the frame's layers", isArrow(" ", true), toggleLayers],
  ["←", "frame before", isArrow("ArrowLeft", false), () => goTo(get("frame") - 1)],
  ["→", "next frame", isArrow("ArrowRight", false), () => goTo(get("frame") + 1)],
  ["Shift ←", "layer before", isArrow("ArrowLeft", true), () => stepLayer(-1)],
  ["Shift →", "next layer", isArrow("ArrowRight", true), () => stepLayer(1)],
  ["Home", "first frame", is("Home"), () => goTo(-Infinity)],
  ["End", "last frame", is("End"), () => goTo(Infinity)],
  ["n", MARKS, is("n"), () => goToMark(1)],
  ["p", "mark before", is("p"), () => goToMark(-1)],
  [
    "1 – 9",
    "look through a camera",
    (event) => /^[1-9]$/.test(event.key),
    (event) => lookThrough(Number(event.key) - 1),
  ],
  ["0", "the first view of the scene; free of a camera", is("0"), resetView],
  ["f", "frame the body in the scene", is("f"), frameBody],
  ["g", "go along with the body from frame to frame", is("g"), toggleFollow],
  [
    "v",
    "next view; Shift v the one before",
    (event) => event.key.toLowerCase() === "v",
    (event) => stepView(event.shiftKey ? -1 : 1),
  ],
  [
    "[ ]",
    "parameter before, next parameter",
    (event) => event.key === "[" || event.key === "]",
    (event) => stepParameter(event.key === "]" ? 1 : -1),
  ],
  ["t", "the view's numbers as a table, or its drawing", is("t"), toggleTable],
  ["r", "anneal this frame again", is("r"), reanneal],
  ["b", "a bookmark on this frame; its note, where it has one", is("b"), toggleBookmark],
  ["c", "correct this frame by hand", is("c"), correctFrame],
  ["l", "loop", is("l"), toggleLoop],
  ["s", "into the scene's panel; Escape leads back", is("s"), () => enterScene()],
  [
    "Escape",
    "leave what is under way: playing, a layer, a correction, a camera's view",
    (event) => event.key === "Escape" && !event.target.closest?.("dialog"),
    leave,
  ],
  ["Ctrl K", "find a view, a panel, a command", () => false, () => {}],
  ["?", "this list", is("?"), () => showKeys()],
];

function showKeys() {
  openList(
    "Keys",
    KEYS.map(([key, what]) => [key, what]),
  );
}

// What needs all keys for itself, and what needs the arrows only up and down or not at all.
// Timeline and layers are sliders that the page's own keys move as well.
const TYPING =
  "input:not([type=checkbox]), textarea, dialog:not(.large-view), " +
  "[role=slider]:not(#track, #layer-tiles), [role=menu], [role=tab]";
const CHOOSING = "select, input[type=checkbox]";
const PRESSED = [" ", "Enter"];

/** Do what a key says; typing in a field and holding control are left alone. */
export function takeKey(event) {
  const moves = event.key === "ArrowLeft" || event.key === "ArrowRight";
  const typing = event.target.closest?.(moves ? TYPING : `${TYPING}, ${CHOOSING}`);
  if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
  if (PRESSED.includes(event.key) && event.target.closest?.("button, a")) return;
  const found = KEYS.find(([, , fits]) => fits(event));
  if (found && found[3](event) !== false) event.preventDefault();
}

const WORDS = ["Space", "Home", "End"];

/**
 * What single keys do, for the command palette: the key, its words, and what it does.
 * @returns {[string, string, () => void][]}
 */
export const commands = () =>
  KEYS.filter(([key]) => (key.length === 1 && !/[?sv]/.test(key)) || WORDS.includes(key)).map(
    ([key, words, , act]) => [
      key,
      words,
      () => act(new KeyboardEvent("keydown", { key: key === "Space" ? " " : key })),
    ],
  );

/** Listen on the page. */
export function startKeys() {
  document.addEventListener("keydown", takeKey);
}
