// What the studio page's components are made of: Preact, its hooks, signals, and `html`, markup in
// a template string.
//
// A component is a function of its properties that returns html`…`; it renders itself again when a
// signal that it read has changed. The page's values are read by `follow(name)` (of state.js)
// inside a component or an effect, and by `get(name)` in event handlers.

import htm from "../../vendor/htm.js";
import { h, render } from "../../vendor/preact.js";
import { get, onChange } from "../state.js";
import { signal } from "../../vendor/signals.js";

export { Fragment } from "../../vendor/preact.js";
export {
  useEffect,
  useLayoutEffect,
  useMemo,
  useRef,
  useState,
} from "../../vendor/preact_hooks.js";
export {
  batch,
  computed,
  effect,
  signal,
  useSignal,
  useSignalEffect,
} from "../../vendor/signals.js";

/** Markup in a template string: html`<b class="x" onClick=${act}>${text}</b>`. */
export const html = htm.bind(h);

/** @type {Map<string, import("@preact/signals").Signal>} */
const signals = new Map();

onChange((changes) => {
  for (const [name, value] of Object.entries(changes)) {
    const followed = signals.get(name);
    if (followed) followed.value = value;
  }
});

/**
 * The page's value under a name; the component or effect that asks runs again when it changes.
 * @param {string} name
 */
export function follow(name) {
  let followed = signals.get(name);
  if (!followed) {
    followed = signal(get(name));
    signals.set(name, followed);
  }
  return followed.value;
}

/**
 * What puts a value into a signal: for what calls back with it.
 * @template T
 * @param {import("@preact/signals").Signal<T>} held
 * @returns {(value: T) => void}
 */
export const into = (held) => (value) => {
  held.value = value;
};

/**
 * What does work and leaves in a signal what went wrong, null while nothing did.
 * @param {import("@preact/signals").Signal<any>} failed
 */
export const attempting = (failed) => async (/** @type {() => any} */ work) => {
  failed.value = null;
  try {
    await work();
  } catch (error) {
    failed.value = error;
  }
};

/**
 * Show a component in an element of the page, in place of what stands there.
 * @param {Element} place
 * @param {any} markup
 */
export function mount(place, markup) {
  render(markup, place);
}
