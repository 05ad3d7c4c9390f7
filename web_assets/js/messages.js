// Messages that pass: a cause and a remedy, never a traceback.

import { byId, element, fill } from "./elements.js";

const SECONDS_SHOWN = 9;
const MOST_SHOWN = 4;

/**
 * Show a message; errors stay until closed. act: a button that follows from it.
 * @param {string} text
 * @param {{ remedy?: string, kind?: string, act?: HTMLElement | null }} [how]
 */
export function say(text, { remedy = "", kind = "info", act = null } = {}) {
  const box = byId("toasts");
  const close = element("button", {
    className: "icon quiet small",
    textContent: "×",
    ariaLabel: "Close message",
    onclick: () => toast.remove(),
  });
  const toast = element(
    "div",
    { className: `toast ${kind}` },
    element("p", {}, text),
    close,
    remedy && element("p", { className: "remedy" }, remedy),
    act,
  );
  act?.addEventListener("click", () => toast.remove());
  fill(box, [...box.children, toast].slice(-MOST_SHOWN));
  if (kind !== "error") setTimeout(() => toast.remove(), SECONDS_SHOWN * 1000);
}

/** Show an error of the API (or of the network) in its own words. */
export function complain(error) {
  if (error.name === "AbortError") return;
  say(error.message || "Something went wrong.", { remedy: error.hint ?? "", kind: "error" });
}
