// The tabs under the timeline: one panel at a time, each with its tools; all of it can be folded away.

import { cameraTools } from "./cameras.js";
import { get } from "./state.js";
import { varianceCsv } from "./variance.js";

const byId = (id) => document.getElementById(id);

function download(name, text) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(new Blob([text], { type: "text/csv" })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

function toolsOf(panel) {
  if (panel === "cameras") return cameraTools();
  if (panel !== "variance") return [];
  const csv = Object.assign(document.createElement("button"), { className: "quiet small", textContent: "CSV", title: "This frame's variances as CSV" });
  csv.onclick = () => {
    const detail = get("detail");
    if (detail) download(`${get("session")}-${get("run")}-frame${detail.frame}-variance.csv`, varianceCsv(detail, get("whatIf") ?? detail.layers));
  };
  return [csv];
}

function fold(folded) {
  const button = byId("panels-fold");
  document.body.classList.toggle("panels-folded", folded);
  localStorage.setItem("panels-folded", folded ? "yes" : "");
  button.setAttribute("aria-expanded", String(!folded));
  button.title = folded ? "Show the charts" : "Fold the charts";
  button.setAttribute("aria-label", button.title);
}

/** Show a panel, from elsewhere on the page. */
export function showPanel(name) {
  document.querySelector(`[role=tab][data-panel="${name}"]`)?.click();
}

/** Wire tabs, tools and the fold. */
export function startTabs() {
  const tabs = [...document.querySelectorAll("[role=tab]")];
  const choose = (tab) => {
    for (const one of tabs) {
      one.setAttribute("aria-selected", String(one === tab));
      one.tabIndex = one === tab ? 0 : -1;
      byId(`panel-${one.dataset.panel}`).hidden = one !== tab;
    }
    localStorage.setItem("panel", tab.dataset.panel);
    byId("tab-tools").replaceChildren(...toolsOf(tab.dataset.panel));
    document.dispatchEvent(new Event("panel"));
  };
  for (const tab of tabs) {
    tab.onclick = (event) => {
      fold(false);
      choose(tab);
      // Whoever clicks goes on with the timeline's keys; whoever came by keyboard walks the tabs with the arrows.
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
