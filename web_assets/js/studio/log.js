// The run's log: what the tracking process says, newest below.

import { fetchJson, runPath } from "../api.js";
import { get, watch } from "../state.js";
import { follow, html, signal, useLayoutEffect, useRef } from "./component.js";

/** @typedef {{ number: number, level: string, time: number, text: string }} Line */

const MOST_LINES = 500;
const NEAR_THE_END = 8;
const lines = signal(/** @type {Line[]} */ ([]));
let number = 0;

const numbered = (line) => {
  number += 1;
  return { ...line, number };
};

/** Add a line {level, time (seconds), text}. */
export function addLine(line) {
  lines.value = [...lines.value, numbered(line)].slice(-MOST_LINES);
}

/** The lines; the newest stays in sight unless another place was scrolled to. */
export function Log() {
  const list = useRef(/** @type {HTMLElement | null} */ (null));
  const atEnd = useRef(true);
  const open = follow("panel") === "log";
  useLayoutEffect(() => {
    if (open && atEnd.current && list.current) list.current.scrollTop = list.current.scrollHeight;
  }, [lines.value, open]);
  const scrolled = ({ currentTarget: { scrollTop, clientHeight, scrollHeight } }) => {
    atEnd.current = scrollTop + clientHeight >= scrollHeight - NEAR_THE_END;
  };
  if (!lines.value.length) {
    const words = follow("run")
      ? "Nothing is said of this run yet."
      : "Open a run to read its log.";
    return html`<p class="empty" id="log">${words}</p>`;
  }
  return html`<ol class="log" id="log" ref=${list} onScroll=${scrolled}>
    ${lines.value.map(
      ({ number: key, level, time, text }) =>
        html`<li key=${key} class=${level}>
          <time>${new Date(time * 1000).toLocaleTimeString()}</time><span>${text}</span>
        </li>`,
    )}
  </ol>`;
}

async function load() {
  lines.value = [];
  const [session, run] = [get("session"), get("run")];
  if (!run) return;
  const stored = await fetchJson(`${runPath(session, run)}/log`).catch(() => ({ lines: [] }));
  if (session !== get("session") || run !== get("run")) return;
  lines.value = stored.lines.map(numbered).slice(-MOST_LINES);
}

/** Load the log of the run that is open. */
export function startLog() {
  watch(["session", "run"], load);
}
