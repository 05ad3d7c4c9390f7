// Light or dark, remembered; the scene follows (scene_window.js).

import { seriesToken, token } from "./chart_looks.js";
import { byId } from "./elements.js";

export { token };

const root = document.documentElement;
/** @type {Set<(theme: string) => void>} */
const listeners = new Set();

/** The theme in use: "light" or "dark". */
export const theme = () => root.dataset.theme;

/** Colour of layer `index` of `count`, from the tokens' sequence, first cool to last warm. */
export function layerColour(index, count) {
  const at = count > 1 ? (index / (count - 1)) * 9 : 9;
  const low = Math.floor(at);
  const rest = at - low;
  const mix = (a, b) => `color-mix(in srgb, ${a} ${Math.round((1 - rest) * 100)}%, ${b})`;
  return rest < 0.01 || low === 9
    ? token(`layer-${low}`)
    : resolved(mix(token(`layer-${low}`), token(`layer-${low + 1}`)));
}

/** Colour of what is compared, by its place in the list. */
export const seriesColour = (index) => token(seriesToken(index));

const probe = document.createElement("i");
probe.hidden = true;
document.documentElement.append(probe);

/** A CSS colour expression as the rgb() text that canvas charts understand. */
function resolved(expression) {
  probe.style.color = expression;
  const text = getComputedStyle(probe).color;
  const parts = text.match(/color\(srgb ([\d.]+) ([\d.]+) ([\d.]+)/);
  return parts
    ? `rgb(${parts
        .slice(1, 4)
        .map((part) => Math.round(255 * Number(part)))
        .join(",")})`
    : text;
}

/** Call `listener` whenever the theme changes. */
export const onTheme = (listener) => listeners.add(listener);

function apply(name) {
  root.dataset.theme = name;
  localStorage.setItem("theme", name);
  for (const listener of listeners) listener(name);
}

const systemTheme = () => (matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark");

/** Use a theme from now on. @param {"light" | "dark" | "system"} name */
export function useTheme(name) {
  apply(name === "system" ? systemTheme() : name);
  if (name === "system") localStorage.removeItem("theme");
}

/** Take the remembered theme (else the system's), and wire the header's button. */
export function startTheme() {
  apply(localStorage.getItem("theme") ?? systemTheme());
  byId("theme").onclick = () => apply(theme() === "dark" ? "light" : "dark");
}
