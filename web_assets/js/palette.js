// The command palette: all that can be found, by a few letters of its name.

import { byId, element, fill } from "./elements.js";
import { askForFindable, findable } from "./findable.js";

/** @import { Entry } from "./findable.js" */

/** @type {HTMLDialogElement} */
const dialog = element("dialog", { className: "palette", ariaLabel: "Find" });
const MOST = 40;
let chosen = 0;
/** @type {Entry[]} */
let found = [];

/** How well words fit what is looked for; -1: not at all. */
function fit({ words, more, kind, also = "" }, wanted) {
  const text = `${words} ${more} ${kind} ${also}`.toLowerCase();
  if (kind === "Frame") return 3;
  if (!wanted.split(" ").every((part) => text.includes(part))) return -1;
  return words.toLowerCase().startsWith(wanted) ? 2 : words.toLowerCase().includes(wanted) ? 1 : 0;
}

function draw(list, wanted) {
  found = findable(wanted).map((entry) => ({ entry, score: fit(entry, wanted) })).filter(({ score }) => score >= 0).sort((a, b) => b.score - a.score).slice(0, MOST).map(({ entry }) => entry);
  chosen = Math.min(chosen, Math.max(0, found.length - 1));
  fill(list, found.map((entry, at) => element("li", { role: "option", id: `palette-${at}`, ariaSelected: String(at === chosen), onclick: () => take(at) }, element("span", { className: "kind" }, entry.kind), entry.words, element("small", {}, entry.more))),
    !found.length && element("li", { className: "empty" }, "Nothing is called that."));
  list.children[chosen]?.scrollIntoView({ block: "nearest" });
}

function take(at) {
  const entry = found[at];
  dialog.close();
  entry?.act();
}

/** Open the palette. */
function openPalette() {
  chosen = 0;
  const list = element("ul", { className: "palette-list", role: "listbox", ariaLabel: "What there is", id: "palette-list" });
  const field = element("input", { type: "text", placeholder: "A view, a knob, a frame, a limb, a page, a run, help …", ariaLabel: "Find", role: "combobox", ariaExpanded: "true", autocomplete: "off" });
  field.setAttribute("aria-controls", "palette-list");
  const redraw = () => { draw(list, field.value.trim().toLowerCase()); field.setAttribute("aria-activedescendant", `palette-${chosen}`); };
  field.oninput = () => { chosen = 0; redraw(); };
  field.onkeydown = (event) => {
    const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (by) { event.preventDefault(); chosen = (chosen + by + found.length) % Math.max(1, found.length); redraw(); }
    if (event.key === "Enter") { event.preventDefault(); take(chosen); }
  };
  fill(dialog, element("div", { className: "palette-box" }, field, list));
  if (!dialog.isConnected) document.body.append(dialog);
  dialog.showModal();
  redraw();
  field.focus();
  askForFindable(() => { if (dialog.open) redraw(); });
}

/** Wire its key and its button. */
export function startPalette() {
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "k") return;
    event.preventDefault();
    if (dialog.open) dialog.close();
    else openPalette();
  });
  byId("palette-open").onclick = openPalette;
}
