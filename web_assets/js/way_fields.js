// Fields with their labels, as the steps of the guided way have them.

import { element } from "./elements.js";

/** A text, select or number field with its label and a hint that the pointer shows. */
export function field(label, made, hint = "") {
  if (hint) made.title = hint;
  return element("label", {}, label, made);
}
/** A line of text. */
export const text = (properties) => element("input", { type: "text", ...properties });
/** A number of 0 or more. */
export const number = (value, properties = {}) => element("input", { type: "number", value, step: "any", min: 0, ...properties });
/** A choice; options: value to words. */
export const select = (options) => element("select", {}, ...Object.entries(options).map(([value, words]) => new Option(words, value)));
/** Files to be uploaded. */
export const files = (properties) => element("input", { type: "file", ...properties });
