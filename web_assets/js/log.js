// The run's log: what the tracking process says, newest below.

import { fetchJson, runPath } from "./api.js";
import { byId, element } from "./elements.js";
import { get, watch } from "./state.js";

const list = byId("log");
const MOST_LINES = 500;

/** Add a line {level, time (seconds), text}. */
export function addLine({ level, time, text }) {
  const atEnd = list.scrollTop + list.clientHeight >= list.scrollHeight - 8;
  list.append(element("li", { className: level }, element("time", {}, new Date(time * 1000).toLocaleTimeString()), element("span", {}, text)));
  while (list.children.length > MOST_LINES) list.firstChild.remove();
  if (atEnd) list.scrollTop = list.scrollHeight;
}

/** Show the log of the run that is open. */
export function startLog() {
  watch(["session", "run"], async () => {
    list.replaceChildren();
    const run = get("run");
    if (!run) return;
    const { lines } = await fetchJson(`${runPath(get("session"), run)}/log`).catch(() => ({ lines: [] }));
    if (run !== get("run")) return;
    list.replaceChildren();
    for (const line of lines) addLine(line);
  });
}
