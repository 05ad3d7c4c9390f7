// A menu at a button: arrows go from entry to entry, Escape and a press elsewhere close it.

import { html, mount, useEffect, useRef } from "./component.js";

const WIDTH = 170;
const ENTRY_HEIGHT = 34;
const MARGIN = 12;

/** @type {HTMLElement | null} */
let place = null;

function close() {
  if (!place) return;
  mount(place, null);
  place.remove();
  place = null;
}

/** @param {{ opener: Element, entries: any[][] }} properties */
function Menu({ opener, entries }) {
  const menu = useRef(/** @type {HTMLElement | null} */ (null));
  useEffect(() => {
    const press = (event) => {
      if (!menu.current?.contains(event.target)) close();
    };
    document.addEventListener("pointerdown", press, true);
    return () => document.removeEventListener("pointerdown", press, true);
  }, []);
  const takeKey = (event) => {
    const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!by && event.key !== "Escape") return;
    event.preventDefault();
    event.stopPropagation();
    if (by) {
      const buttons = [...event.currentTarget.children];
      const at = buttons.indexOf(document.activeElement);
      buttons[(at + by + buttons.length) % buttons.length].focus();
    } else {
      close();
      /** @type {HTMLElement} */ (opener).focus();
    }
  };
  const box = opener.getBoundingClientRect();
  const style = {
    left: `${Math.min(box.left, innerWidth - WIDTH)}px`,
    top: `${Math.min(box.bottom + 2, innerHeight - ENTRY_HEIGHT * entries.length - MARGIN)}px`,
  };
  return html`<div ref=${menu} class="menu" role="menu" style=${style} onKeyDown=${takeKey}>
    ${entries.map(
      ([label, act]) =>
        html`<button
          key=${label}
          type="button"
          role="menuitem"
          onClick=${() => {
            close();
            act();
          }}
        >
          ${label}
        </button>`,
    )}
  </div>`;
}

/** Open a menu of [label, action] at a button. @param {Element} opener @param {any[][]} entries */
export function openMenu(opener, entries) {
  close();
  place = document.createElement("div");
  place.className = "part";
  document.body.append(place);
  mount(place, html`<${Menu} opener=${opener} entries=${entries} />`);
  /** @type {HTMLElement | null} */ (place.querySelector("button"))?.focus();
}
