// How far the views' masks agree in the hull: a bar a camera with words, and the camera to look at first.

import { findingList } from "./calibration_drawing.js";
import { button, element } from "./elements.js";

const USABLE = 0.9;
const percent = (share) => (share === null ? "—" : `${Math.round(100 * share)} %`);

/** What is said of a quality (`GET S/masks/quality`), null where nobody measured it since the studio was opened (then what
 * is known in words, `measured`, is said); `paint(camera)` opens the brush. */
export function qualityList(quality, paint, measured = "") {
  if (!quality && measured) return [element("p", { className: "hint", textContent: `When it was last measured, ${measured}. Measure again to see every camera.` })];
  if (!quality) return [element("p", { className: "hint", textContent: "Not measured yet. No truth is needed: where one view's mask says “person”, the others must agree in space." })];
  const rows = quality.cameras.map((line) => {
    const kind = line.usable ? "good" : line.agreement !== null && line.agreement >= 0.8 ? "warn" : "bad";
    const bar = element("div", { className: `agree-bar ${kind}`, role: "meter", title: `In the hull: ${percent(line.covered)} of the mask. In the mask: ${percent(line.inside)} of the hull.` }, element("i"), element("b"));
    bar.firstChild.style.width = `${Math.round(100 * (line.agreement ?? 0))}%`;
    bar.lastChild.style.left = `${100 * USABLE}%`;
    for (const [name, value] of Object.entries({ "aria-valuenow": line.agreement ?? 0, "aria-valuemin": 0, "aria-valuemax": 1, "aria-label": `Agreement of ${line.camera}` })) bar.setAttribute(name, value);
    return element("li", {}, element("span", { textContent: line.camera }), bar, element("span", { className: "figure", textContent: percent(line.agreement) }),
      line.note && element("p", { className: "hint", textContent: line.note }));
  });
  const worst = quality.cameras.find((line) => line.camera === quality.worst);
  const told = worst
    ? element("div", { className: "notice" }, element("p", { textContent: remedy(worst) }), button(`Exclude regions of ${worst.camera}…`, () => paint(worst.camera), "small"))
    : element("p", { className: "hint", textContent: `Every view agrees with the others; ${quality.frames.length} frames were compared.` });
  const doubts = quality.doubts.length > 0 && element("div", {}, element("p", { className: "notice", textContent: "The silhouettes speak against the calibration:" }), findingList({ findings: quality.doubts }));
  return [element("ul", { className: "agree" }, ...rows), worst || !doubts ? told : null, doubts].filter(Boolean);
}

function remedy(line) {
  const first = `Look at ${line.camera} first.`;
  if (line.agreement === null) return `${first} Its mask is empty: lower “mask threshold”, or give a picture of its empty room.`;
  if (line.denied > 0.05) return `${first} Its mask has holes that carve the person in all views: lower “mask threshold”, or switch “shadow test” off.`;
  if (line.covered !== null && line.covered < USABLE) return `${first} It holds something that no other view has: a bystander, a reflection, a shadow. Exclude the region, or raise “mask threshold”.`;
  return `${first} It lacks parts of the person: lower “mask threshold”, or raise “close gaps”.`;
}
