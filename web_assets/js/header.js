// The header: which run, what the worker does, how far, how long still; and the buttons that tell it what to do.

import { post, runPath } from "./api.js";
import { complain } from "./messages.js";
import { get, set, watch } from "./state.js";

const byId = (id) => document.getElementById(id);
const WORDS = {
  idle: "idle", compiling: "compiling kernels, once", tracking: "tracking", paused: "paused", reannealing: "re-annealing",
  finished: "finished", cancelled: "cancelled", failed: "failed", lost: "worker lost",
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

/** What the worker does, in one line. */
export function stateLine(work) {
  if (!work) return "idle";
  const parts = [WORDS[work.state] ?? work.state];
  if (work.live) return liveLine(work, parts[0]);
  if (work.state === "tracking" && work.frames_per_second) parts[0] += ` ${work.frames_per_second.toPrecision(2)} fps`;
  if (["tracking", "paused", "reannealing", "lost"].includes(work.state)) parts.push(`frame ${work.frame}/${work.last - 1}`);
  if (work.state === "paused" && work.layer > 0) parts.push(`layer ${work.layer}`);
  if (work.state === "tracking" && work.seconds_left !== null) parts.push(`ETA ${clock(work.seconds_left)}`);
  return parts.join(" · ");
}

function drawState() {
  const work = get("work");
  const here = isOpen(work);
  const state = get("connected") === false ? "disconnected" : (work?.state ?? "idle");
  byId("state").dataset.state = state;
  byId("state-text").textContent = state === "disconnected" ? "disconnected, reconnecting" : (work && !here && work.run && work.state === "tracking" ? `${work.session}: ` : "") + stateLine(work);
  byId("state").title = work?.message ? `${work.message} ${work.hint}` : "";
  const bar = byId("run-progress");
  bar.hidden = !here || !["tracking", "paused", "compiling"].includes(work.state);
  bar.classList.toggle("unknown", work?.state === "compiling");
  if (work && work.last > work.first) bar.firstElementChild.style.width = `${(100 * (work.live ? work.frame - work.first : work.done)) / (work.last - work.first)}%`;
  drawButtons(work, here);
}

function drawButtons(work, here) {
  const run = Boolean(get("run"));
  const busy = here && ["tracking", "compiling", "reannealing"].includes(work.state);
  const complete = get("summary") && (get("summary").frames.length >= get("summary").last - get("summary").first || (here && work.state === "finished"));
  const toggle = byId("track-toggle");
  toggle.textContent = here && work.state === "tracking" ? "Pause" : here && work.state === "lost" ? "Resume" : get("summary")?.frames.length ? (complete ? "Tracked" : "Track on") : "Track";
  toggle.classList.toggle("primary", !(complete && !busy));
  toggle.disabled = !run || !get("connected") || (complete && !busy);
  for (const id of ["step-layer", "step-frame"]) byId(id).disabled = !run || !get("connected") || busy || complete;
  byId("reanneal").disabled = !run || !get("connected") || !get("summary")?.frames.length || get("frame") === null || (here && work.state === "tracking");
  byId("cancel").disabled = !here || !["tracking", "paused", "compiling"].includes(work.state);
}

const tell = (what, body) => post(`${runPath(get("session"), get("run"))}/${what}`, body).catch(complain);

/** Anneal the shown frame again with the knobs as they are. */
export function reanneal() {
  if (!byId("reanneal").disabled) tell("reanneal", { frame: get("frame") });
}

/** Wire the header. */
export function startHeader() {
  byId("track-toggle").onclick = () => {
    const work = get("work");
    if (isOpen(work) && work.state === "tracking") return tell("pause");
    set({ follow: true });
    return tell("start");
  };
  byId("step-layer").onclick = () => { set({ follow: true }); tell("step-layer"); };
  byId("step-frame").onclick = () => { set({ follow: true }); tell("step-frame"); };
  byId("cancel").onclick = () => tell("cancel");
  byId("reanneal").onclick = reanneal;
  byId("rail-toggle").onclick = () => byId("rail-toggle").setAttribute("aria-expanded", String(document.body.classList.toggle("rail-open")));
  watch(["work", "run", "session", "connected", "summary", "frame"], drawState);
  watch(["session", "run", "summary"], () => {
    const crumbs = byId("crumbs");
    crumbs.replaceChildren();
    if (!get("session")) return;
    const name = document.createElement("b");
    name.textContent = get("session");
    crumbs.append(name, get("run") ? ` / ${get("run")}` : "", get("summary") ? ` · ${get("summary").describe ?? ""}` : "");
    document.title = `${get("session")} – Capture studio`;
  });
}
