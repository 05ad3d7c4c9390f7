// Dialogs: a form, a list, a picture. One <dialog>, closed by Escape.

import { byId, showPicture } from "../elements.js";
import { Fragment, html, into, mount, useEffect, useRef, useSignal } from "./component.js";
import { Failure, Select } from "./parts.js";

/** @type {HTMLDialogElement} */
const dialog = byId("dialog");
let opened = 0;

/** Show a component in the dialog, in place of what is there. */
export function openDialog(/** @type {any} */ content, className = "") {
  opened += 1;
  dialog.className = className;
  mount(dialog, html`<${Fragment} key=${opened}>${content}</${Fragment}>`);
  if (!dialog.open) dialog.showModal();
  /** @type {HTMLElement | null} */ (dialog.querySelector("input, select"))?.focus();
}

/** Close whatever is open. */
export const closeDialog = () => dialog.close();

dialog.addEventListener("close", () => {
  if (!dialog.open) mount(dialog, null);
});

const Close = () => html`<button type="button" onClick=${closeDialog}>Close</button>`;

/** A list of pairs under a title. @param {string} heading @param {string[][]} pairs */
export function openList(heading, pairs) {
  openDialog(html`<div>
    <h2>${heading}</h2>
    <table>
      <tbody>
        ${pairs.map(
          ([key, what]) => html`<tr key=${key}><td><kbd>${key}</kbd></td><td>${what}</td></tr>`,
        )}
      </tbody>
    </table>
    <div class="actions"><${Close} /></div>
  </div>`);
}

/** @param {{ caption: string, source: () => string | null, ratio?: number }} properties */
function LargePicture({ caption, source, ratio }) {
  const image = useRef(/** @type {HTMLImageElement | null} */ (null));
  const address = source();
  useEffect(() => {
    if (address) showPicture(image.current, address);
  }, [address]);
  return html`<div>
    <img
      ref=${image}
      alt=${caption}
      class=${ratio ? "fills" : ""}
      style=${ratio ? { "--ratio": ratio } : {}}
    />
    <div class="actions">
      <span class="quiet-text">${caption}</span><span class="spring"></span><${Close} />
    </div>
  </div>`;
}

/**
 * A picture as large as the window allows, another whenever its address is.
 * @param {string} caption
 * @param {() => string | null} source its address
 * @param {number} [ratio] its width by its height: then a small one is enlarged, too
 */
export const openPicture = (caption, source, ratio) =>
  openDialog(
    html`<${LargePicture} caption=${caption} source=${source} ratio=${ratio} />`,
    "large-view",
  );

/**
 * What makes a picture one that opens large, by a click, Enter or the space bar: attributes of its
 * <img>. `caption`: stands below it; its address is requested without a height, as it is stored.
 * @param {string} caption
 */
export function opensLarge(caption) {
  /** @param {Event & { currentTarget: any }} event */
  const open = ({ currentTarget: image }) => {
    if (!image.naturalHeight) return;
    const address = new URL(image.src, location.href);
    address.searchParams.delete("height");
    const ratio = image.naturalWidth / image.naturalHeight;
    openPicture(caption, () => address.href, ratio);
  };
  return {
    tabIndex: 0,
    role: "button",
    title: "See it large",
    onClick: open,
    onKeyDown: (/** @type {KeyboardEvent & { currentTarget: any }} */ event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      // Enter alone would go to the next step.
      event.preventDefault();
      event.stopPropagation();
      open(event);
    },
  };
}

/**
 * A field of a form. `kind`: of its input, or "check", or "file"; `choices`: those of a select, as
 * {value, label} or words; `hint`: stands below it, `help`: where the pointer rests; all else are
 * the input's own attributes.
 */
export function Field(
  /** @type {Record<string, any>} */ {
    name,
    label,
    kind = "text",
    value = "",
    choices = null,
    hint: below = "",
    help = "",
    hidden = false,
    ...more
  },
) {
  if (kind === "check") {
    return html`<label class="check">
      <input type="checkbox" name=${name} defaultChecked=${Boolean(value)} ...${more} />${label}
    </label>`;
  }
  const options = choices?.map((one) => [String(one.value ?? one), one.label ?? one]);
  const input = choices
    ? html`<${Select} name=${name} options=${options} value=${String(value)} />`
    : kind === "file"
      ? html`<input type="file" name=${name} ...${more} />`
      : html`<input type=${kind} name=${name} defaultValue=${value} ...${more} />`;
  return html`<label title=${help} hidden=${hidden}>
    ${label}${input}${below && html`<span class="hint">${below}</span>`}
  </label>`;
}

const held = (input) =>
  input.type === "checkbox"
    ? input.checked
    : input.type === "file"
      ? input.files
      : input.value.trim();

/** What a form's fields hold, by their names. */
export const valuesOf = (form) =>
  Object.fromEntries(
    [...form.querySelectorAll("[name]")].map((input) => [input.name, held(input)]),
  );

/**
 * A form with a heading and its buttons. `send(values, report)` may throw an error with message and
 * hint, which is shown in place; the dialog closes when it returns. `changed(name, form)` is called
 * for every field that a person changes.
 * @param {{ heading: string, intro?: string, action: string, danger?: boolean, children?: any,
 *   send: (values: any, report: (words: string) => void) => any,
 *   changed?: (name: string, form: HTMLFormElement) => void }} properties
 */
export function Form({ heading, intro, action, danger = false, children, send, changed }) {
  const wrong = useSignal(/** @type {{ message: string, hint?: string } | null} */ (null));
  const isSent = useSignal(false);
  /** What the button says while it is sent. */
  const said = useSignal("");
  const alert = useRef(/** @type {HTMLElement | null} */ (null));
  useEffect(() => alert.current?.scrollIntoView({ block: "nearest" }), [wrong.value]);
  const report = into(said);
  const submit = async (event) => {
    event.preventDefault();
    isSent.value = true;
    wrong.value = null;
    try {
      await send(valuesOf(event.currentTarget), report);
      closeDialog();
    } catch (error) {
      wrong.value = /** @type {any} */ (error);
    }
    isSent.value = false;
    said.value = "";
  };
  const change = ({ currentTarget, target }) => changed?.(target.name, currentTarget);
  return html`<form onSubmit=${submit} onChange=${change}>
    <h2>${heading}</h2>
    ${intro && html`<p class="hint">${intro}</p>`} ${children}
    <div ref=${alert} class="optional"><${Failure} error=${wrong.value} /></div>
    <div class="actions">
      <button type="button" onClick=${closeDialog}>Cancel</button>
      <button class=${danger ? "danger" : "primary"} disabled=${isSent.value}>
        ${said.value || action}
      </button>
    </div>
  </form>`;
}

/** Rows of fields. @param {{ rows: any[][] }} properties */
const Rows = ({ rows }) =>
  rows.map((row) => {
    const fields = row.map((one) => html`<${Field} key=${one.name} ...${one} />`);
    return row.length > 1 ? html`<div class="row">${fields}</div>` : fields;
  });

/**
 * Open a form. `rows`: rows of field descriptions (see Field).
 * @param {{ heading: string, intro?: string, rows: object[][], action: string, danger?: boolean,
 *   send: (values: any, report: (words: string) => void) => any }} what
 */
export const openForm = ({ rows, ...what }) =>
  openDialog(html`<${Form} ...${what}><${Rows} rows=${rows} /></${Form}>`);

/** Wait for work of the background that ends when the dialog is closed: then `stop` is called. */
export async function whileOpen(stop, work) {
  dialog.addEventListener("close", stop, { once: true });
  try {
    return await work();
  } finally {
    dialog.removeEventListener("close", stop);
  }
}
