// A figure in a component: it is drawn into its place of the page whenever what it shows is another.

import { Figure } from "../figure.js";
import { follow, html, useEffect, useRef } from "./component.js";

/**
 * @param {{ panel: string, label: string, shown: import("../figure.js").Shown | null, words?: string,
 *   busy?: boolean, take?: (figure: Figure) => void, children?: any }} properties
 *   `panel`: in which it stands: it is drawn while that one is open. `words`: why nothing is shown. `take`: gets the
 *   figure once.
 */
export function FigurePlace({ panel, label, shown, words = "", busy = false, take }) {
  const place = useRef(/** @type {HTMLElement | null} */ (null));
  const figure = useRef(/** @type {Figure | null} */ (null));
  const isOpen = follow("panel") === panel;
  useEffect(() => {
    if (!place.current) return;
    figure.current = new Figure(place.current);
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
