// How limbs are told apart, the same in every frame, chart and scene: by the colour of their side,
// and by a shape each.

import { token } from "./chart_looks.js";
import { get } from "./state.js";
import { seriesColour } from "./theme.js";

const SYMBOLS = ["circle", "rect", "triangle", "diamond", "roundRect", "arrow"];

const sideOf = (limb) => (/left/.test(limb) ? "left" : /right/.test(limb) ? "right" : "middle");

/** The body's limbs in its order, where the run is known. @returns {string[]} */
const limbsOfBody = () => [...new Set((get("parameters") ?? []).map((one) => one.limb))];

/**
 * Colour and shape of a limb. `among`: limbs that are drawn together, in an order that stays. Limbs
 * of a body without sides have a colour each.
 * @param {string} limb
 * @param {string[]} among
 */
export function limbLook(limb, among) {
  const known = limbsOfBody();
  const order = known.includes(limb) ? known : [...among].sort();
  const at = Math.max(0, order.indexOf(limb));
  const hasSides = [...known, ...among].some((one) => sideOf(one) !== "middle");
  const alike = order.filter((one) => sideOf(one) === sideOf(limb));
  return {
    colour: hasSides ? token(`limb-${sideOf(limb)}`) : seriesColour(at),
    symbol: SYMBOLS[(hasSides ? Math.max(0, alike.indexOf(limb)) : at) % SYMBOLS.length],
  };
}
