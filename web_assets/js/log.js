// The run's log: what the worker says, newest below.

import { fetchJson, runPath } from "./api.js";
import { get, watch } from "./state.js";

const list = document.getElementById("log");
const MOST_LINES = 500;

/** Add a line {level, time (seconds), text}. */
export function addLine({ level, time, text }) {
  const atEnd = list.scrollTop + list.clientHeight >= list.scrollHeight - 8;
  const line = document.createElement("li");
  line.className = level;
  const clock = document.createElement("time");
  clock.textContent = new Date(time * 1000).toLocaleTimeString();
  const words = document.createElement("span");
  words.textContent = text;
  line.append(clock, words);
  list.append(line);
  while (list.children.length > MOST_LINES) list.firstChild.remove();
  if (atEnd) list.scrollTop = list.scrollHeight;
}

/** Show the log of the run that is open. */
export function startLog() {
  watch(["session", "run"], async () => {
    list.replaceChildren();
    if (!get("run")) return;
    const asked = get("run");
    const told = await fetchJson(`${runPath(get("session"), asked)}/log`).catch(() => ({ lines: [] }));
    if (asked !== get("run")) return;
    list.replaceChildren();
    for (const line of told.lines ?? []) addLine(line);
  });
}
