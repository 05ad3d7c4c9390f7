// A figure in a component: it is drawn into its place of the page whenever what it shows is
// another.

import { Figure } from "../figure.js";
import { follow, html, mount, useEffect, useLayoutEffect, useRef } from "./component.js";

/**
 * @param {{ panel: string, label: string, shown: import("../figure.js").Shown | null, words?:
 *   string, busy?: boolean, tools?: any, take?: (figure: Figure) => void }} properties `panel`: in
 *   which it stands: it is drawn while that one is open. `words`: why nothing is shown. `tools`: a
 *   component   of what can be chosen of it. `take`: gets the figure, once.
 */
export function FigurePlace({ panel, label, shown, words = "", busy = false, tools, take }) {
  const place = useRef(/** @type {HTMLElement | null} */ (null));
  const figure = useRef(/** @type {Figure | null} */ (null));
  const isOpen = follow("panel") === panel;
  useLayoutEffect(() => {
    if (!place.current) return;
    figure.current = new Figure(place.current);
    if (tools) mount(figure.current.own, tools);
    take?.(figure.current);
  }, []);
  useEffect(() => {
    if (isOpen) figure.current?.show(shown, words);
  }, [isOpen, shown, words]);
  return html`<section
    class="figure"
    ref=${place}
    aria-label=${label}
    aria-busy=${String(busy)}
  ></section>`;
}
