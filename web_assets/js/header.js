// The header: the run, the state of the tracking process, progress and time left; and its buttons.

import { fetchJson, post, runPath } from "./api.js";
import { byId, element, fill, offer } from "./elements.js";
import { complain } from "./messages.js";
import { standingOf } from "./run_standing.js";
import { get, set, watch } from "./state.js";

const WORDS = {
  idle: "idle", compiling: "compiling kernels, once", tracking: "tracking", paused: "paused", reannealing: "re-annealing",
  finished: "finished", cancelled: "cancelled", failed: "failed", lost: "tracking process lost",
};

const isOpen = (work) => work && work.session === get("session") && work.run === get("run");

function clock(seconds) {
  const whole = Math.max(0, Math.round(seconds));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

/** How a live run keeps up, in one line. */
function liveLine(work, word) {
  const { dropped, incomplete, latency_ms: latency, frames_per_second: rate } = work.live;
  const parts = [work.state === "tracking" ? "live" : `${word} (live)`];
  if (work.state === "tracking" && rate) parts.push(`${rate.toFixed(1)} fps`);
  if (work.state === "tracking" && latency !== null) parts.push(`latency ${latency.toFixed(0)} ms`);
  return [...parts, `${dropped} dropped`, ...(incomplete ? [`${incomplete} incomplete`] : [])].join(" · ");
}

/** What the tracking process does, in one line. */
function stateLine(work) {
  if (!work) return "idle";
  const parts = [WORDS[work.state] ?? work.state];
  if (work.live) return liveLine(work, parts[0]);
  if (work.state === "tracking" && work.frames_per_second) parts[0] += ` ${work.frames_per_second.toPrecision(2)} fps`;
  if (["tracking", "paused", "reannealing", "lost"].includes(work.state)) parts.push(`${work.done} of ${work.last - work.first} frames`);
  if (work.state === "paused" && work.layer > 0) parts.push(`layer ${work.layer}`);
  if (work.state === "tracking" && work.seconds_left !== null) parts.push(`ETA ${clock(work.seconds_left)}`);
  return parts.join(" · ");
}

function drawState() {
  const work = get("work");
  const here = isOpen(work);
  const { state, words } = standingOf({ session: get("session"), run: get("run"), work, summary: get("summary"), connected: get("connected") });
  byId("state").dataset.state = state;
  const elsewhere = work && !here && work.run && work.state === "tracking" ? `${work.session}: ` : "";
  byId("state-text").textContent = words || elsewhere + stateLine(work);
  byId("state").title = work?.message ? `${work.message} ${work.hint}` : "";
  const progress = byId("run-progress");
  progress.hidden = !here || !["tracking", "paused", "compiling"].includes(work.state);
  progress.classList.toggle("unknown", work?.state === "compiling");
  if (work && work.last > work.first) progress.firstElementChild.style.width = `${(100 * (work.live ? work.frame - work.first : work.done)) / (work.last - work.first)}%`;
  drawButtons(work, here);
}

function toggleWord(work, here, complete) {
  if (here && work.state === "tracking") return "Pause";
  if (here && work.state === "lost") return "Resume";
  if (!get("summary")?.frames.length) return "Track";
  return complete ? "Tracked" : "Continue";
}

function drawButtons(work, here) {
  const usable = get("run") && get("connected");
  const busy = here && ["tracking", "compiling", "reannealing"].includes(work.state);
  const summary = get("summary");
  const complete = summary && (summary.frames.length >= summary.last - summary.first || (here && work.state === "finished"));
  const toggle = byId("track-toggle");
  toggle.textContent = toggleWord(work, here, complete);
  toggle.classList.toggle("primary", !complete || busy);
  toggle.disabled = !usable || (complete && !busy);
  for (const id of ["step-layer", "step-frame"]) byId(id).disabled = !usable || busy || complete;
  byId("reanneal").disabled = !usable || !summary?.frames.length || get("frame") === null || (here && work.state === "tracking");
  byId("cancel").disabled = !here || !["tracking", "paused", "compiling"].includes(work.state);
}

/** @param {"start" | "pause" | "cancel" | "step-layer" | "step-frame" | "reanneal"} what */
const command = (what, body = undefined) => post(`${runPath(get("session"), get("run"))}/${what}`, body).catch(complain);

/** Anneal the shown frame again with the knobs as they are. */
export function reanneal() {
  if (!byId("reanneal").disabled) command("reanneal", { frame: get("frame") });
}

// The speed at which the search is slowed down to be watched. The choices and their labels are the server's, the speed in use is the
// tracking process's own.

/** @type {HTMLSelectElement} */
const speed = byId("search-speed");
let asking = false;

const speedInUse = () => String(get("work")?.seconds_a_layer ?? 0);
const isOffered = () => [...speed.options].some((option) => option.value === speedInUse());

/** Whether each layer is given time to be looked at. */
export const isWatched = () => (get("work")?.seconds_a_layer ?? 0) > 0;

async function loadSpeeds() {
  if (asking) return;
  asking = true;
  try {
    const { choices } = await fetchJson("/api/worker/pace");
    offer(speed, choices.map((one) => [String(one.seconds_a_layer), one.label]));
  } catch (error) { complain(error); } finally { asking = false; }
  if (isOffered()) showSpeed();
}

/** Show the speed in use; one that is none of the choices (set by a script) becomes one. */
function showSpeed() {
  speed.disabled = !get("connected");
  if (speed.disabled) return;
  if (!isOffered()) loadSpeeds();
  else if (speed.value !== speedInUse()) speed.value = speedInUse();
}

/** Wire the header. */
export function startHeader() {
  byId("track-toggle").onclick = () => {
    if (isOpen(get("work")) && get("work").state === "tracking") return command("pause");
    set({ follow: true });
    return command("start");
  };
  for (const id of /** @type {const} */ (["step-layer", "step-frame"])) byId(id).onclick = () => { set({ follow: true }); command(id); };
  byId("cancel").onclick = () => command("cancel");
  byId("reanneal").onclick = reanneal;
  watch(["work", "run", "session", "connected", "summary", "frame"], drawState);
  watch(["session", "run", "summary"], () => {
    const [session, run, summary] = [get("session"), get("run"), get("summary")];
    fill(byId("crumbs"), session && [element("b", {}, session), run && ` / ${run}`, summary && ` · ${summary.describe ?? ""}`]);
    if (session) document.title = `${session} – Capture studio`;
  });
  speed.onchange = () => post("/api/worker/pace", { seconds_a_layer: Number(speed.value) }).catch((error) => { complain(error); showSpeed(); });
  watch(["work", "connected"], showSpeed);
}
