// Dialogs: a form, a list, a picture, a menu. One <dialog>, closed by Escape.

import { button, byId, check, element, field, files, fill, hint, optional, select, sends, spring } from "./elements.js";

/** @type {HTMLDialogElement} */
const dialog = byId("dialog");

function show(content, className = "") {
  dialog.className = className;
  fill(dialog, content);
  if (!dialog.open) dialog.showModal();
}

/** Close whatever is open. */
export const closeDialog = () => dialog.close();

const buttons = (...children) => element("div", { className: "actions" }, ...children);
const close = () => button("Close", closeDialog);

/** A list of pairs under a title. */
export function openList(heading, pairs) {
  const rows = pairs.map(([key, what]) => element("tr", {}, element("td", {}, element("kbd", {}, key)), element("td", {}, what)));
  show(element("div", {}, element("h2", {}, heading), element("table", {}, rows), buttons(close())));
}

/** A picture as large as the window allows. */
export function openPicture(caption, source) {
  show(element("div", {}, element("img", { src: source, alt: caption }), buttons(element("span", { className: "quiet-text" }, caption), spring(), close())), "large-view");
}

function fieldOf({ name, label, kind = "text", value = /** @type {any} */ (""), choices = null, hint: below = "", webkitdirectory = false, ...more }) {
  if (kind === "check") return check(label, { name, checked: Boolean(value) });
  if (kind === "file") return field(label, files({ name, folder: webkitdirectory, ...more }), { below });
  const made = choices ? select(choices.map((one) => [String(one.value ?? one), one.label ?? one]), String(value), { name }) : element("input", { name, type: kind, value, ...more });
  return field(label, made, { below });
}

/** What a form's fields hold, by their names. */
export const valuesOf = (form) => Object.fromEntries([...form.querySelectorAll("[name]")].map((input) => [input.name, input.type === "checkbox" ? input.checked : input.type === "file" ? input.files : input.value.trim()]));

/**
 * A form. `rows`: rows of field descriptions; `send(values, report)` may throw an error with message and hint, which is
 * shown in place; the dialog closes when it returns. `changed(name, form)` is called for every field that a person changes.
 * @param {{ heading: string, intro?: string, rows: object[][], action: string, danger?: boolean,
 *   send: (values: any, report: (words: string) => void) => any, changed?: (name: string, form: HTMLFormElement) => void }} what
 */
export function openForm({ heading, intro = "", rows, action, danger = false, send, changed = null }) {
  const wrong = optional();
  const submit = element("button", { className: danger ? "danger" : "primary" }, action);
  const lines = rows.map((row) => (row.length > 1 ? element("div", { className: "row" }, row.map(fieldOf)) : fieldOf(/** @type {any} */ (row[0]))));
  const form = element("form", {}, element("h2", {}, heading), intro && hint(intro), lines, wrong, buttons(button("Cancel", closeDialog), submit));
  sends(form, submit, wrong, async (report) => {
    await send(valuesOf(form), report);
    closeDialog();
  });
  if (changed) form.onchange = (event) => changed(/** @type {HTMLInputElement} */ (event.target).name, form);
  show(form);
  form.querySelector(/** @type {"input"} */ ("input, select"))?.focus();
}

/** Wait for work of the background that ends when the dialog is closed: then `stop` is called. */
export async function whileOpen(stop, work) {
  dialog.addEventListener("close", stop, { once: true });
  try { return await work(); } finally { dialog.removeEventListener("close", stop); }
}

/** A menu of [label, action] at a button. */
export function openMenu(opener, entries) {
  document.querySelector(".menu")?.remove();
  const end = () => { menu.remove(); document.removeEventListener("pointerdown", outside, true); };
  const outside = (event) => { if (!menu.contains(event.target)) end(); };
  const menu = element("div", { className: "menu", role: "menu" }, entries.map(([label, act]) => element("button", { role: "menuitem", onclick: () => { end(); act(); } }, label)));
  const box = opener.getBoundingClientRect();
  Object.assign(menu.style, { left: `${Math.min(box.left, innerWidth - 170)}px`, top: `${Math.min(box.bottom + 2, innerHeight - 34 * entries.length - 12)}px` });
  document.body.append(menu);
  document.addEventListener("pointerdown", outside, true);
  menu.addEventListener("keydown", (event) => { if (event.key === "Escape") { end(); opener.focus(); } });
  /** @type {HTMLElement} */ (menu.firstChild).focus();
}
