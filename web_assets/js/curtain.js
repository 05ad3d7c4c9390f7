// What lies over the scene: that there is nothing to look at yet, that the studio does not answer, that a frame was annealed
// again and is shown but not stored.

import { post, readOnly, remove, runPath } from "./api.js";
import { figure } from "./chart_looks.js";
import { bar, button, byId, element, fill } from "./elements.js";
import { importForm } from "./importing.js";
import { onEvent } from "./live.js";
import { complain } from "./messages.js";
import { newRunForm } from "./new_run.js";
import { lacks, openSession, refreshSessions, setupPath } from "./sessions.js";
import { get, set, watch } from "./state.js";
import { keepAsNewRun, replaceStored } from "./studio/keeping.js";

const MOST_MOVED = 4;
const curtain = byId("curtain");
const invitation = byId("invitation");

function cover(heading, text, ...below) {
  fill(curtain, element("div", { className: "card" }, element("h2", {}, heading), element("p", {}, text), ...below));
  curtain.hidden = false;
}

const group = (...buttons) => element("div", { className: "group" }, ...buttons);

/** A line above the scene that leaves the scene in view. */
function banner(text) {
  fill(curtain, element("p", {}, text));
  curtain.classList.add("banner");
  curtain.hidden = false;
}

/** A session without runs: the scene stays free, because its start pose is set there. */
function invite(entry) {
  if (entry.next_step) fill(invitation, `${entry.name}: ${lacks(entry)}.`, button("Guided set-up", () => { location.href = setupPath(entry); }, "primary small"));
  else fill(invitation, "No run yet. Set a start pose under “Pose” if the session has none, then", button("New run", () => newRunForm(entry), "primary small"));
  invitation.hidden = false;
}

async function addSample() {
  try {
    const { name } = await post("/api/samples", { name: "walk" });
    await refreshSessions();
    openSession(name);
  } catch (error) { complain(error); }
}

function draw() {
  const sessions = get("sessions");
  const work = get("work");
  const entry = sessions?.find((one) => one.name === get("session"));
  curtain.classList.remove("banner");
  invitation.hidden = true;
  document.body.classList.toggle("disconnected", get("connected") === false);
  if (get("stranger")) return cover("The studio was started again", "This page belongs to the previous start. Open the address that the new one printed in its terminal.");
  if (get("connected") === false) return banner("Disconnected. The last state is shown; trying to reach the studio again …");
  if (sessions?.length === 0) {
    return cover("Nothing here yet", "Import the footage of your cameras, or start with the bundled walk.",
      group(button("Open the sample", addSample, "primary"), button("From my own cameras", () => { location.href = "/way?new"; }), button("Import footage", importForm)));
  }
  if (work?.state === "lost" && work.session === get("session")) {
    const resume = () => post(`${runPath(work.session, work.run)}/start`).catch(complain);
    return cover("The tracking process ended", `${work.message} Tracked frames are kept. ${work.hint}`, group(button("Resume", resume, "primary")));
  }
  if (work?.state === "compiling" && work.session === get("session")) return cover("Compiling the kernels, once", "The first run on this machine takes about half a minute longer.", bar(0, "progress unknown"));
  curtain.hidden = true;
  if (entry && !entry.runs.length) invite(entry);
}

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

/** Wire what lies over the scene. */
export function startCurtain() {
  watch(["sessions", "session", "run", "work", "connected", "stranger"], draw);
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
