// The tabs under the timeline: one panel at a time, each with its tools; all of it can be folded
// away.

import { byId } from "../elements.js";
import { get, set, watch } from "../state.js";
import { Cameras, CameraTools } from "./cameras.js";
import { Comparing } from "./comparing.js";
import { follow, html, mount, signal, useRef } from "./component.js";
import { Exporting } from "./exporting.js";
import { Log } from "./log.js";
import { togglePalette } from "./palette.js";
import { isFolded, PANELS, showPanel } from "./panels.js";
import { Views } from "./views.js";
import { Why } from "./why.js";

const CONTENTS = {
  why: [Why, "panel why"],
  views: [Views, "panel views"],
  compare: [Comparing, "panel why"],
  cameras: [Cameras, "panel cameras"],
  log: [Log, "panel"],
  export: [Exporting, "panel export"],
};
const LEAST_HEIGHT = 160;
const ABOVE = 260; // pixels of the window that stay free of the panels
const STEP = 24;

const mostHeight = () => innerHeight - ABOVE;
/** Their height, pixels; null: as the page has it. */
const height = signal(/** @type {number | null} */ (null));

function setHeight(/** @type {number} */ pixels) {
  const kept = Math.round(Math.max(LEAST_HEIGHT, Math.min(mostHeight(), pixels)));
  document.documentElement.style.setProperty("--panels-height", `${kept}px`);
  localStorage.setItem("panels-height", String(kept));
  height.value = kept;
}

function resetHeight() {
  localStorage.removeItem("panels-height");
  document.documentElement.style.removeProperty("--panels-height");
  height.value = null;
}

/** The panels' upper edge, dragged or moved by the arrow keys. */
function Edge() {
  const isDragged = useRef(false);
  const press = (event) => {
    event.currentTarget.setPointerCapture(event.pointerId);
    isDragged.current = true;
  };
  const release = () => {
    isDragged.current = false;
  };
  const takeKey = (event) => {
    const by = { ArrowUp: STEP, ArrowDown: -STEP }[event.key];
    if (!by) return;
    event.preventDefault();
    setHeight(byId("panels").clientHeight + by);
  };
  return html`<div
    class="panels-edge"
    id="panels-edge"
    role="separator"
    aria-orientation="horizontal"
    aria-label="Height of the panels"
    aria-valuemin=${LEAST_HEIGHT}
    aria-valuemax=${mostHeight()}
    aria-valuenow=${height.value ?? byId("panels").clientHeight}
    tabindex="0"
    title="Drag to change the height of the panels"
    onPointerDown=${press}
    onPointerMove=${(event) => isDragged.current && setHeight(innerHeight - event.clientY)}
    onPointerUp=${release}
    onPointerCancel=${release}
    onDblClick=${resetHeight}
    onKeyDown=${takeKey}
  ></div>`;
}

function Tabs() {
  const open = follow("panel");
  const press = (event, name) => {
    showPanel(name);
    // After a click the timeline's keys go on; from the keyboard the arrows go from tab to tab.
    if (event.detail) event.currentTarget.blur();
  };
  const takeKey = (event) => {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!by) return;
    event.stopPropagation();
    const at = PANELS.findIndex(([name]) => name === open);
    const next = (at + by + PANELS.length) % PANELS.length;
    event.currentTarget.children[next].focus();
    set({ panel: PANELS[next][0] });
  };
  return html`<div class="tab-list" role="tablist" id="tabs" aria-label="Panels" onKeyDown=${takeKey}>
    ${PANELS.map(
      ([name, words]) =>
        html`<button
          key=${name}
          role="tab"
          aria-selected=${String(name === open)}
          aria-controls=${`panel-${name}`}
          tabindex=${name === open ? 0 : -1}
          data-panel=${name}
          onClick=${(event) => press(event, name)}
        >
          ${words}
        </button>`,
    )}
  </div>`;
}

function Fold() {
  const words = isFolded.value ? "Show the charts" : "Fold the charts";
  const toggle = () => {
    isFolded.value = !isFolded.value;
  };
  return html`<button
    class="icon"
    id="panels-fold"
    aria-expanded=${String(!isFolded.value)}
    aria-label=${words}
    title=${words}
    onClick=${toggle}
  >
    <svg viewBox="0 0 16 16"><path d="M3 5.5h10L8 11z" /></svg>
  </button>`;
}

const Line = () => html`
  <${Edge} />
  <div class="tabs">
    <${Tabs} />
    <span class="spring"></span>
    <span class="tab-tools" id="tab-tools">
      ${follow("panel") === "cameras" && html`<${CameraTools} />`}
    </span>
    <button
      class="quiet small"
      id="palette-open"
      title="Find a view, a panel, a command (Ctrl K)"
      onClick=${togglePalette}
    >
      Find <kbd>Ctrl K</kbd>
    </button>
    <${Fold} />
  </div>
`;

function Panels() {
  const open = follow("panel");
  return PANELS.map(([name]) => {
    const [Content, kind] = CONTENTS[name];
    return html`<div
      key=${name}
      class=${kind}
      role="tabpanel"
      id=${`panel-${name}`}
      hidden=${name !== open}
    >
      <${Content} />
    </div>`;
  });
}

/**
 * Show the tabs and their panels: the one that is in the address, else the one that was open last.
 */
export function startTabs() {
  const isKnown = (name) => PANELS.some(([one]) => one === name);
  const remembered = Number(localStorage.getItem("panels-height"));
  if (remembered) setHeight(remembered);
  watch(["panel"], () => {
    const open = get("panel");
    if (isKnown(open)) return localStorage.setItem("panel", open);
    const last = localStorage.getItem("panel");
    return set({ panel: isKnown(last) ? last : PANELS[0][0] });
  });
  mount(byId("tabs-place"), html`<${Line} />`);
  mount(byId("panels-place"), html`<${Panels} />`);
}
