// Dialogs: a form, a question, a list. One <dialog>, closed by Escape.

const dialog = document.getElementById("dialog");

function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

function show(content, className = "") {
  dialog.className = className;
  dialog.replaceChildren(content);
  if (!dialog.open) dialog.showModal();
}

/** Close whatever is open. */
export const closeDialog = () => dialog.close();

/** A list of pairs under a title. */
export function openList(heading, pairs) {
  const rows = pairs.map(([key, what]) => element("tr", {}, element("td", {}, element("kbd", { textContent: key })), element("td", { textContent: what })));
  const close = element("button", { textContent: "Close", onclick: closeDialog });
  show(element("div", {}, element("h2", { textContent: heading }), element("table", {}, ...rows), element("div", { className: "actions" }, close)));
}

/** A picture as large as the window allows. */
export function openPicture(caption, source) {
  const close = element("button", { textContent: "Close", onclick: closeDialog });
  const image = element("img", { src: source, alt: caption });
  show(element("div", {}, image, element("div", { className: "actions" }, element("span", { className: "quiet-text", textContent: caption }), element("span", { className: "spring" }), close)), "large-view");
  return image;
}

function field({ name, label, kind = "text", value = "", choices, hint, ...more }) {
  if (kind === "check") {
    return element("label", { className: "check" }, element("input", { type: "checkbox", name, checked: Boolean(value) }), label);
  }
  const input = choices
    ? element("select", { name }, ...choices.map((choice) => new Option(choice.label ?? choice, choice.value ?? choice, false, (choice.value ?? choice) === value)))
    : Object.assign(element("input", { name, type: kind, ...more }), kind === "file" ? {} : { value });
  if (more.webkitdirectory) input.setAttribute("webkitdirectory", "");
  return element("label", {}, label, input, ...(hint ? [element("span", { className: "hint", textContent: hint })] : []));
}

/**
 * A form. `fields`: rows of field descriptions; `send(values, report)` may throw an error with message and hint, which is
 * shown in place; the dialog closes when it returns. `changed(name, form)` is told of every field that a person changes.
 */
export function openForm({ heading, intro, rows, action, danger = false, send, changed = null }) {
  const wrong = element("p", { className: "wrong", hidden: true });
  const remedy = element("p", { className: "hint", hidden: true });
  const submit = element("button", { className: danger ? "danger" : "primary", textContent: action });
  const cancel = element("button", { type: "button", textContent: "Cancel", onclick: closeDialog });
  const lines = rows.map((row) => (row.length > 1 ? element("div", { className: "row" }, ...row.map(field)) : field(row[0])));
  const form = element("form", {}, element("h2", { textContent: heading }), ...(intro ? [element("p", { className: "hint", textContent: intro })] : []),
    ...lines, wrong, remedy, element("div", { className: "actions" }, cancel, submit));
  const report = (text) => { submit.textContent = text; };
  form.onsubmit = async (event) => {
    event.preventDefault();
    const values = {};
    for (const input of form.querySelectorAll("[name]")) values[input.name] = input.type === "checkbox" ? input.checked : input.type === "file" ? input.files : input.value.trim();
    submit.disabled = true;
    wrong.hidden = remedy.hidden = true;
    try {
      await send(values, report);
      closeDialog();
    } catch (error) {
      wrong.textContent = error.message;
      remedy.textContent = error.hint ?? "";
      wrong.hidden = false;
      remedy.hidden = !error.hint;
    } finally {
      submit.disabled = false;
      submit.textContent = action;
    }
  };
  if (changed) form.onchange = (event) => changed(event.target.name, form);
  show(form);
  form.querySelector("input, select")?.focus();
}

/** A menu of [label, action] at a button. */
export function openMenu(button, entries) {
  document.querySelector(".menu")?.remove();
  const menu = element("div", { className: "menu" });
  menu.setAttribute("role", "menu");
  const close = () => { menu.remove(); document.removeEventListener("pointerdown", outside, true); };
  const outside = (event) => { if (!menu.contains(event.target)) close(); };
  for (const [label, act] of entries) {
    const entry = element("button", { textContent: label, onclick: () => { close(); act(); } });
    entry.setAttribute("role", "menuitem");
    menu.append(entry);
  }
  const box = button.getBoundingClientRect();
  Object.assign(menu.style, { left: `${Math.min(box.left, innerWidth - 170)}px`, top: `${Math.min(box.bottom + 2, innerHeight - 34 * entries.length - 12)}px` });
  document.body.append(menu);
  document.addEventListener("pointerdown", outside, true);
  menu.addEventListener("keydown", (event) => { if (event.key === "Escape") { close(); button.focus(); } });
  menu.firstChild.focus();
}
