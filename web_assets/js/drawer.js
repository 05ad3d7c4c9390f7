// Where there is no room beside a page, its list and its places are a drawer: opened by the button
// in the bar, closed by that button, by Escape, by a click beside it and by what was chosen in it.

import { byId } from "./elements.js";

const toggle = byId("rail-toggle");
const isOpen = () => document.body.classList.contains("rail-open");

function show(open) {
  document.body.classList.toggle("rail-open", open);
  toggle.ariaExpanded = String(open);
}

toggle.onclick = () => show(!isOpen());
addEventListener("keydown", (event) => {
  if (event.key !== "Escape" || !isOpen()) return;
  show(false);
  toggle.focus();
});
addEventListener("click", (event) => {
  const at = /** @type {Element} */ (event.target);
  if (!isOpen() || at.closest("#rail-toggle")) return;
  if (!at.closest(".rail, .places") || at.closest(".rail :is(a, .entry), .places a")) show(false);
});
