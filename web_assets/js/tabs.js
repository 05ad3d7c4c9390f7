// The tabs under the timeline: one panel at a time, each with its tools; all of it can be folded away.

import { cameraTools } from "./cameras.js";
import { byId, fill } from "./elements.js";
import { get, set, watch } from "./state.js";

const toolsOf = (panel) => (panel === "cameras" ? cameraTools() : []);

function fold(folded) {
  const folder = byId("panels-fold");
  document.body.classList.toggle("panels-folded", folded);
  localStorage.setItem("panels-folded", folded ? "yes" : "");
  folder.ariaExpanded = String(!folded);
  folder.title = folder.ariaLabel = folded ? "Show the charts" : "Fold the charts";
}

/** Show a panel, from elsewhere on the page. */
export function showPanel(name) {
  fold(false);
  set({ panel: name });
}

const LEAST_PANELS = 160, STEP = 24;

/** The height of the panels, dragged or by the arrow keys; remembered. */
function startEdge() {
  const edge = byId("panels-edge");
  const most = () => innerHeight - 260;
  const apply = (height) => {
    const kept = Math.round(Math.max(LEAST_PANELS, Math.min(most(), height)));
    document.documentElement.style.setProperty("--panels-height", `${kept}px`);
    localStorage.setItem("panels-height", String(kept));
    Object.assign(edge, { ariaValueMin: String(LEAST_PANELS), ariaValueMax: String(most()), ariaValueNow: String(kept) });
  };
  const remembered = Number(localStorage.getItem("panels-height"));
  if (remembered) apply(remembered);
  else Object.assign(edge, { ariaValueMin: String(LEAST_PANELS), ariaValueMax: String(most()), ariaValueNow: String(byId("panels").clientHeight) });
  edge.onpointerdown = (event) => {
    edge.setPointerCapture(event.pointerId);
    edge.onpointermove = (moved) => apply(innerHeight - moved.clientY);
  };
  edge.onpointerup = edge.onpointercancel = () => { edge.onpointermove = null; };
  edge.ondblclick = () => { localStorage.removeItem("panels-height"); document.documentElement.style.removeProperty("--panels-height"); };
  edge.onkeydown = (event) => {
    const by = { ArrowUp: STEP, ArrowDown: -STEP }[event.key];
    if (!by) return;
    event.preventDefault();
    apply(byId("panels").clientHeight + by);
  };
}

/** Wire tabs, tools and the fold. */
export function startTabs() {
  /** @type {HTMLElement[]} */
  const tabs = [...document.querySelectorAll(/** @type {"button"} */ ("[role=tab]"))];
  const named = (name) => tabs.find((tab) => tab.dataset.panel === name);
  for (const tab of tabs) {
    tab.onclick = (event) => {
      showPanel(tab.dataset.panel);
      // After a click the timeline's keys go on; from the keyboard the arrows go from tab to tab.
      if (event.detail) tab.blur();
    };
    tab.onkeydown = (event) => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!by) return;
      event.stopPropagation();
      const next = tabs[(tabs.indexOf(tab) + by + tabs.length) % tabs.length];
      next.focus();
      set({ panel: next.dataset.panel });
    };
  }
  watch(["panel"], () => {
    const chosen = named(get("panel"));
    if (!chosen) return set({ panel: (named(localStorage.getItem("panel")) ?? tabs[0]).dataset.panel });
    for (const one of tabs) {
      one.ariaSelected = String(one === chosen);
      one.tabIndex = one === chosen ? 0 : -1;
      byId(`panel-${one.dataset.panel}`).hidden = one !== chosen;
    }
    localStorage.setItem("panel", chosen.dataset.panel);
    fill(byId("tab-tools"), toolsOf(chosen.dataset.panel));
    document.dispatchEvent(new Event("panel"));
  });
  startEdge();
  fold(localStorage.getItem("panels-folded") === "yes");
  byId("panels-fold").onclick = () => fold(!document.body.classList.contains("panels-folded"));
}
