// The pages' components, made of elements: texts, fields, tables, progress, errors. Every page uses
// these and no others.

/**
 * @typedef {Node | string | number | false | null | undefined} Child
 * @typedef {{ className?: string, dataset?: Record<string, string | number>, [property: string]:
 *   any }} Properties
 */

/**
 * An element with a class, data, properties and children; null and false are left out.
 * @template {keyof HTMLElementTagNameMap} T
 * @param {T} tag
 * @param {Properties} [properties]
 * @param {(Child | Child[])[]} children
 * @returns {HTMLElementTagNameMap[T]}
 */
export function element(tag, { dataset = {}, ...properties } = {}, ...children) {
  const made = document.createElement(tag);
  Object.assign(made, properties);
  Object.assign(made.dataset, dataset);
  made.append(...present(children));
  return made;
}

/** @param {(Child | Child[])[]} children @returns {(Node | string)[]} */
const present = (children) =>
  children
    .flat(2)
    .filter((child) => child !== null && child !== undefined && child !== false && child !== "")
    .map((child) => (child instanceof Node ? child : String(child)));

/** A part of a page by its id. @returns {any} */
export const byId = (id) => document.getElementById(id);

/**
 * What finds an element again among those that replace it: its key, label, id or name (with the
 * value, of several alike).
 */
function keyOf(focused) {
  const name = ["data-key", "aria-label", "id", "name"].find((one) => focused.getAttribute(one));
  const has = (attribute) => `[${attribute}="${CSS.escape(focused.getAttribute(attribute))}"]`;
  return name && has(name) + (name === "name" && focused.type === "radio" ? has("value") : "");
}

/**
 * Put children into a place instead of what is there. What has the focus keeps it, found again by
 * its key, name, id or label; a list that was scrolled stays so.
 * @param {Element} place
 * @param {(Child | Child[])[]} children
 */
export function fill(place, ...children) {
  const focused = place.contains(document.activeElement) ? document.activeElement : null;
  const key = focused && keyOf(focused);
  const scrolled = place.scrollTop;
  place.replaceChildren(...present(children));
  place.scrollTop = scrolled;
  if (focused && document.activeElement !== focused)
    /** @type {HTMLElement} */ (
      focused.isConnected ? focused : key && place.querySelector(key)
    )?.focus();
}

/** An element of a drawing (SVG). */
export function shape(tag, attributes, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

// Texts.

/** A quiet line of explanation. */
export const hint = (...children) => element("p", { className: "hint" }, ...children);
/** A notice. */
export const notice = (...children) => element("p", { className: "notice" }, ...children);
/** The introduction to a part of the page. */
export const lead = (...children) => element("p", { className: "lead" }, ...children);
/**
 * An error with its remedy; nothing without an error.
 * @param {{ message: string, hint?: string } | null} error
 */
export const failure = (error) =>
  error &&
  element(
    "p",
    { className: "wrong", role: "alert" },
    error.message,
    error.hint && element("span", { className: "hint" }, ` ${error.hint}`),
  );
/** A place that takes no room while it is empty. */
export const optional = () => element("div", { className: "optional" });
/** The content of an empty page. */
export const nothing = (heading, ...children) =>
  element("div", { className: "nothing" }, element("h1", {}, heading), ...children);
/** A part of a page in a frame, under its heading. */
export const card = (heading, ...children) =>
  element("section", { className: "card-box" }, heading && element("h2", {}, heading), ...children);
/** A page's heading, with what can be done at its right. */
export const pageHead = (heading, words, ...actions) =>
  element(
    "header",
    { className: "head" },
    element("div", {}, element("h1", {}, heading), words && lead(words)),
    ...actions,
  );
/** Buttons beside one another. */
export const actions = (...children) => element("div", { className: "step-actions" }, ...children);
/** Whatever pushes what follows to the other end of its line. */
export const spring = () => element("span", { className: "spring" });

/** A table of figures. @param {string[]} heads @param {Child[][]} rows */
export const table = (heads, rows, className = "figures") =>
  element(
    "table",
    { className },
    element(
      "thead",
      {},
      element(
        "tr",
        {},
        heads.map((head) => element("th", {}, head)),
      ),
    ),
    element(
      "tbody",
      {},
      rows.map((cells) =>
        element(
          "tr",
          {},
          cells.map((cell) =>
            cell instanceof HTMLTableCellElement ? cell : element("td", {}, cell),
          ),
        ),
      ),
    ),
  );

// Buttons and fields.

/**
 * A button that does something; while it is being done it cannot be pressed again.
 * @param {Properties} [more]
 */
export function button(label, act, className = "", more = {}) {
  const made = element("button", { type: "button", className, textContent: label, ...more });
  made.onclick = async () => {
    made.disabled = true;
    try {
      await act();
    } finally {
      made.disabled = false;
    }
  };
  return made;
}

/**
 * A field under its label; what it is for stands below it or, as `title`, where the pointer rests.
 */
export const field = (label, made, { title = "", below = "" } = {}) =>
  element("label", { title }, label, made, below && element("span", { className: "hint" }, below));
/** A box to be checked before its label. @param {Properties} [properties] */
export const check = (label, properties = {}, title = "") =>
  element(
    "label",
    { className: "check", title },
    element("input", { type: "checkbox", ...properties }),
    label,
  );
/** A line of text. @param {Properties} [properties] */
export const text = (properties = {}) => element("input", { type: "text", ...properties });
/** A number of 0 or more. @param {Properties} [properties] */
export const number = (value, properties = {}) =>
  element("input", { type: "number", value, step: "any", min: 0, ...properties });
/**
 * A choice.
 * @param {([string, string] | string)[]} options values with their words, or words alone
 * @param {string} [value]
 * @param {Properties} [properties]
 */
export const select = (options, value = undefined, properties = {}) =>
  offer(element("select", properties), options, value);

/**
 * Offer other options in a choice.
 * @param {HTMLSelectElement} choice
 * @param {([string, string] | string)[]} options
 * @param {string} [value]
 */
export function offer(choice, options, value = undefined) {
  choice.replaceChildren(
    ...options.map((one) => {
      const [own, words] = Array.isArray(one) ? one : [one, one];
      return new Option(words, own, false, own === value);
    }),
  );
  return choice;
}

/**
 * What a canvas is drawn with.
 * @param {HTMLCanvasElement} canvas
 * @param {CanvasRenderingContext2DSettings} [how]
 */
export function penOf(canvas, how) {
  const pen = canvas.getContext("2d", how);
  if (!pen) throw new Error("This browser gives no room to draw in: close other tabs.");
  return pen;
}

/** Let the browser keep bytes as a file. */
export function download(name, content) {
  const link = element("a", { href: URL.createObjectURL(content), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
/** What a session, a run or a track may be called. */
export const NAME = {
  required: true,
  pattern: "[A-Za-z0-9_\\-]{1,64}",
  title: "Letters, digits, - and _, up to 64",
};

/**
 * Let a form be sent: what went wrong stands over its buttons (`wrong`), the button is pressed once
 * at a time.
 */
export function sends(form, submit, wrong, send) {
  const label = submit.textContent;
  form.onsubmit = async (event) => {
    event.preventDefault();
    submit.disabled = true;
    fill(wrong);
    try {
      await send((words) => {
        submit.textContent = words;
      });
    } catch (error) {
      fill(wrong, failure(error));
      wrong.scrollIntoView({ block: "nearest" });
    }
    submit.disabled = false;
    submit.textContent = label;
  };
}

// Progress.

/** A progress bar. share: 0 to 1. */
export const bar = (share, className = "progress") =>
  element(
    "div",
    { className },
    element("i", { style: `width: ${Math.round(100 * (share ?? 0))}%` }),
  );

/**
 * A bar with words and a button that cancels; null takes it away. What is there already is changed
 * in place.
 * @param {HTMLElement} place
 * @param {{ words: string, share: number | null, cancel?: () => void } | null} state
 */
export function drawProgress(place, state) {
  if (!state) return fill(place);
  let shown = drawn.get(place);
  if (shown?.whole.parentElement !== place) {
    const words = element("p", { className: "hint", role: "status" });
    const share = element("i");
    const whole = element(
      "div",
      { className: "step-progress" },
      words,
      element("div", { className: "long-progress" }, share),
      state.cancel && actions(button("Cancel", () => drawn.get(place)?.cancel?.(), "quiet small")),
    );
    shown = { words, share, whole };
    drawn.set(place, shown);
    fill(place, whole);
  }
  shown.cancel = state.cancel;
  shown.words.textContent = state.words;
  shown.share.style.width = `${Math.round(100 * (state.share ?? 0))}%`;
}

/**
 * What stands in a place that shows progress.
 * @type {WeakMap<HTMLElement, { whole: HTMLElement, words: HTMLElement, share: HTMLElement,
 *   cancel?: () => void }>}
 */
const drawn = new WeakMap();

/**
 * Show a picture when it is decoded, so that nothing flickers; of several requests the newest wins.
 */
export function showPicture(image, address) {
  if (image.wanted === address) return;
  image.wanted = address;
  if (image.loading_next) return;
  image.loading_next = true;
  const next = new Image();
  const done = () => {
    image.loading_next = false;
    if (image.wanted === address) return;
    const newest = image.wanted;
    image.wanted = null;
    showPicture(image, newest);
  };
  next.onload = () => {
    image.src = address;
    done();
  };
  next.onerror = done;
  next.src = address;
}

// Words.

/**
 * In how many of its frames a track was measured, where it was not in all; begins with a space.
 * @param {number} measured @param {number} all
 */
export const partWords = (measured, all) =>
  measured < all ? ` in ${measured} of ${all} frames` : "";

/** Seconds as text. */
export function duration(seconds) {
  if (seconds === null || seconds === undefined) return "";
  if (seconds < 90) return `${Math.max(1, Math.round(seconds))} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  return `${(seconds / 3600).toFixed(1)} h`;
}

/** A share as a percentage; "–" where there is none. */
export const percent = (share) =>
  share === null || share === undefined ? "–" : `${Math.round(100 * share)} %`;
/** Parts of a line between dots; empty ones are left out. */
export const dotted = (...parts) => parts.filter(Boolean).join(" · ");
