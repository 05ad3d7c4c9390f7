// The tabs under the timeline: one panel at a time, each with its tools; all of it can be folded away.

import { cameraTools } from "./cameras.js";
import { button, byId, download, fill } from "./elements.js";
import { get } from "./state.js";
import { varianceCsv } from "./variance.js";

function toolsOf(panel) {
  if (panel === "cameras") return cameraTools();
  if (panel !== "variance") return [];
  return [button("CSV", () => {
    const detail = get("detail");
    if (detail) download(`${get("session")}-${get("run")}-frame${detail.frame}-variance.csv`, new Blob([varianceCsv(detail, get("whatIf") ?? detail.layers)], { type: "text/csv" }));
  }, "quiet small", { title: "This frame's variances as CSV" })];
}

function fold(folded) {
  const folder = byId("panels-fold");
  document.body.classList.toggle("panels-folded", folded);
  localStorage.setItem("panels-folded", folded ? "yes" : "");
  folder.ariaExpanded = String(!folded);
  folder.title = folder.ariaLabel = folded ? "Show the charts" : "Fold the charts";
}

/** Show a panel, from elsewhere on the page. */
export function showPanel(name) {
  /** @type {HTMLElement} */ (document.querySelector(`[role=tab][data-panel="${name}"]`))?.click();
}

/** Wire tabs, tools and the fold. */
export function startTabs() {
  /** @type {HTMLElement[]} */
  const tabs = [...document.querySelectorAll(/** @type {"button"} */ ("[role=tab]"))];
  const choose = (tab) => {
    for (const one of tabs) {
      one.ariaSelected = String(one === tab);
      one.tabIndex = one === tab ? 0 : -1;
      byId(`panel-${one.dataset.panel}`).hidden = one !== tab;
    }
    localStorage.setItem("panel", tab.dataset.panel);
    fill(byId("tab-tools"), toolsOf(tab.dataset.panel));
    document.dispatchEvent(new Event("panel"));
  };
  for (const tab of tabs) {
    tab.onclick = (event) => {
      fold(false);
      choose(tab);
      // After a click the timeline's keys go on; from the keyboard the arrows go from tab to tab.
      if (event.detail) tab.blur();
    };
    tab.onkeydown = (event) => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!by) return;
      event.stopPropagation();
      const next = tabs[(tabs.indexOf(tab) + by + tabs.length) % tabs.length];
      next.focus();
      choose(next);
    };
  }
  choose(tabs.find((tab) => tab.dataset.panel === localStorage.getItem("panel")) ?? tabs[0]);
  fold(localStorage.getItem("panels-folded") === "yes");
  byId("panels-fold").onclick = () => fold(!document.body.classList.contains("panels-folded"));
}
