// A frame that was annealed again and is shown but not stored: what it changes, and what becomes of it.

import { post, readOnly, remove, runPath } from "./api.js";
import { figure } from "./chart_looks.js";
import { button, byId, element, fill } from "./elements.js";
import { onEvent } from "./live.js";
import { complain } from "./messages.js";
import { get, set, watch } from "./state.js";
import { keepAsNewRun, replaceStored } from "./studio/keeping.js";

const MOST_MOVED = 4;

/** Leave the stored result as it is; the knobs stay as they were moved. */
function discard() {
  set({ whatIf: null, outcome: null });
  post("/api/scene/show", { discard: true }).catch(complain);
}

const change = (before, after, unit = "") => [element("span", { className: "before" }, figure(before)), " → ", element("span", { className: "after" }, figure(after)), unit && ` ${unit}`];

/** What the new result changes: error, log weight, evaluations, time, and the limbs that it changes most. */
function outcomeWords({ before, after, stored, result }) {
  const limbs = before && after ? Object.keys(before.limbs).filter((limb) => Number.isFinite(before.limbs[limb]) && Number.isFinite(after.limbs[limb])).sort((a, b) => Math.abs(after.limbs[b] - before.limbs[b]) - Math.abs(after.limbs[a] - before.limbs[a])) : [];
  const row = (name, ...cells) => element("tr", {}, element("th", { scope: "row" }, name), element("td", {}, ...cells));
  return element("table", { className: "outcome" }, before && after && row("error", change(before.error_mm, after.error_mm, "mm")), row("log weight", change(stored.log_weight, result.log_weight)), row("evaluations", change(stored.evaluations, result.evaluations)),
    row("time", change(stored.milliseconds, result.milliseconds, "ms")), limbs.map((limb) => row(limb, change(before.limbs[limb], after.limbs[limb], "mm"))));
}

/** Put the knobs that were moved back to those of the run; what was annealed with them goes as well. */
async function putBack() {
  try {
    await remove(`${runPath(get("session"), get("run"))}/settings/moved`);
    discard();
  } catch (error) { complain(error); }
}

const valueWords = (value) => (typeof value === "number" ? figure(value) : typeof value === "boolean" ? (value ? "yes" : "no") : String(value || "–"));

/** The knobs that were moved and that no stored frame uses, with a way back. */
function movedWords(moved) {
  const words = moved.slice(0, MOST_MOVED).map(({ label, before, after }) => `${label} ${valueWords(before)} → ${valueWords(after)}`);
  const more = moved.length > MOST_MOVED ? ` and ${moved.length - MOST_MOVED} more` : "";
  return element("div", { className: "moved-knobs" }, element("span", {}, `Moved, used by no stored frame: ${words.join(", ")}${more}.`),
    !readOnly && button("Put back", putBack, "quiet small", { title: "The knobs go back to the run's own; otherwise the search goes on with them, also after a reload" }));
}

/** @type {any[]} */
let drawnWhatIf = [];

/** A frame that was annealed again: what it changed, and whether it is kept; and the knobs that were moved. */
function drawWhatIf() {
  const line = byId("what-if");
  const frame = get("whatIf")?.[0].frame;
  const [outcome, work] = [get("outcome"), get("work")];
  // While the run is tracked its next layer takes them.
  const isTracked = ["tracking", "compiling"].includes(work?.state) && work.session === get("session") && work.run === get("run");
  const moved = isTracked ? [] : get("moved") ?? [];
  // The state of the search comes many times a second; what has not changed keeps its buttons.
  const shows = [frame, outcome, ...moved];
  if (shows.length === drawnWhatIf.length && shows.every((one, at) => one === drawnWhatIf[at])) return;
  drawnWhatIf = shows;
  line.hidden = frame === undefined && !moved.length;
  if (line.hidden) return;
  const result = frame !== undefined && [element("span", {}, `Frame ${frame} re-annealed, not stored; the stored result stays beside it in grey.`), outcome?.frame === frame && outcomeWords(outcome), button("Keep as a new run", () => keepAsNewRun(frame), "small primary", { title: "The frames before this one, then this result and what follows from it, as another run; this run stays" }), button("Replace…", () => replaceStored(frame), "quiet small"), button("Discard", discard, "quiet small")];
  fill(line, result, moved.length > 0 && movedWords(moved));
}

/** Compare the re-annealed result with the stored one. */
async function measure(event) {
  if (event.frame !== get("frame")) return;
  const [session, run] = [get("session"), get("run")];
  try {
    const stored = await post(`${runPath(session, run)}/frames/${event.frame}/outcome`, { pose: event.pose });
    if (session === get("session") && run === get("run") && event.frame === get("frame") && get("whatIf")) set({ outcome: { frame: event.frame, before: stored.before, after: stored.after, stored, result: event } });
  } catch (error) { complain(error); }
}

/** Wire it to the state. */
export function startWhatIf() {
  watch(["whatIf", "outcome", "moved", "work", "session", "run"], drawWhatIf);
  // An outcome is that of one search: its first layer stays the same.
  let first = null;
  watch(["whatIf"], () => {
    if (get("whatIf")?.[0] === first) return;
    first = get("whatIf")?.[0];
    set({ outcome: null });
  });
  onEvent("frame", (event, here) => { if (here && event.reannealed) measure(event); });
}
