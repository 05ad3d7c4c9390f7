// A bar with words and a button that cancels, the same in every step.

import { button, element } from "./elements.js";

/** Draw `told` ({words, share 0..1 or null, cancel}) in `place`; null takes it away. */
export function drawProgress(place, told) {
  if (!told) return place.replaceChildren();
  let box = place.querySelector(".step-progress");
  if (!box) {
    const bar = element("div", { className: "long-progress" }, element("i"));
    box = element("div", { className: "step-progress" }, element("p", { className: "hint", role: "status" }), bar);
    if (told.cancel) box.append(element("div", { className: "step-actions" }, button("Cancel", () => box.cancel(), "quiet small")));
    place.replaceChildren(box);
  }
  box.cancel = told.cancel;
  box.querySelector("p").textContent = told.words;
  box.querySelector("i").style.width = `${Math.round(100 * (told.share ?? 0))}%`;
  return box;
}
