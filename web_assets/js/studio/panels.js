// The panels under the timeline: which one is open, and whether all of them are folded away.

import { set } from "../state.js";
import { effect, signal } from "./component.js";

/** Their names and words. @type {[string, string][]} */
export const PANELS = [
  ["why", "Why"],
  ["views", "Views"],
  ["compare", "Compare"],
  ["cameras", "Cameras"],
  ["log", "Log"],
  ["export", "Export"],
];

/** Whether the panels are folded away; remembered. */
export const isFolded = signal(localStorage.getItem("panels-folded") === "yes");

effect(() => {
  document.body.classList.toggle("panels-folded", isFolded.value);
  localStorage.setItem("panels-folded", isFolded.value ? "yes" : "");
});

/** Show a panel, from elsewhere on the page. @param {string} name */
export function showPanel(name) {
  isFolded.value = false;
  set({ panel: name });
}
