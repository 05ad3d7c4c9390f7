// Elements from words: tag, class, text, children.

/** An element with a class, properties and children (elements or texts; null and false are left out). */
export function element(tag, { className = "", ...properties } = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  if (className) made.className = className;
  made.append(...children.filter((child) => child !== null && child !== undefined && child !== false));
  return made;
}

/** A button that does something; while it is being done it cannot be pressed again. */
export function button(label, act, className = "") {
  const made = element("button", { type: "button", className, textContent: label });
  made.onclick = async () => {
    made.disabled = true;
    try { await act(); } finally { made.disabled = false; }
  };
  return made;
}

/** Seconds as a person says them. */
export function duration(seconds) {
  if (seconds === null || seconds === undefined) return "";
  if (seconds < 90) return `${Math.max(1, Math.round(seconds))} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  return `${(seconds / 3600).toFixed(1)} h`;
}
