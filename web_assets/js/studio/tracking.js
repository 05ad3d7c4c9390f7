// The tracking process as the page operates it: what it does, in words, its commands, and the speed
// of the search.

import { fetchJson, post, runPath } from "../api.js";
import { complain } from "../messages.js";
import { get, set } from "../state.js";
import { isBusy } from "../work_states.js";
import { signal } from "./component.js";

/** @typedef {import("../work_states.js").Work} Work */
/** @typedef {Work["state"]} RunState */

/** @type {Record<RunState, string>} */
const WORDS = {
  idle: "idle",
  compiling: "compiling kernels, once",
  tracking: "tracking",
  paused: "paused",
  reannealing: "re-annealing",
  finished: "finished",
  cancelled: "cancelled",
  failed: "failed",
  lost: "tracking process lost",
};
/** @type {RunState[]} */
const COUNTED = ["tracking", "paused", "reannealing", "lost"];
/** @type {RunState[]} */
const CANCELLABLE = ["tracking", "paused", "compiling"];

/** Whether the tracking process has a run open that the page shows. */
export const isOpen = (work, session = get("session"), run = get("run")) =>
  Boolean(work && work.session === session && work.run === run);

function clock(seconds) {
  const whole = Math.max(0, Math.round(seconds));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

/**
 * How a live run keeps up, in one line.
 * @param {Work} work
 * @param {NonNullable<Work["live"]>} live
 * @param {string} word
 */
function liveLine(work, live, word) {
  const { dropped, incomplete, latency_ms: latency, frames_per_second: rate } = live;
  const isTracking = work.state === "tracking";
  const parts = [isTracking ? "live" : `${word} (live)`];
  if (isTracking && rate) parts.push(`${rate.toFixed(1)} fps`);
  if (isTracking && latency !== null) parts.push(`latency ${latency.toFixed(0)} ms`);
  return [...parts, `${dropped} dropped`, ...(incomplete ? [`${incomplete} incomplete`] : [])].join(
    " · ",
  );
}

/** What the tracking process does, in one line. @param {Work | null} work */
function stateLine(work) {
  if (!work) return "idle";
  const parts = [WORDS[work.state]];
  if (work.live) return liveLine(work, work.live, parts[0]);
  const isTracking = work.state === "tracking";
  if (isTracking && work.frames_per_second) {
    parts[0] += ` ${work.frames_per_second.toPrecision(2)} fps`;
  }
  if (COUNTED.includes(work.state)) parts.push(`${work.done} of ${work.last - work.first} frames`);
  if (work.state === "paused" && work.layer > 0) parts.push(`layer ${work.layer}`);
  if (isTracking && work.seconds_left !== null) parts.push(`ETA ${clock(work.seconds_left)}`);
  return parts.join(" · ");
}

/**
 * How a run stands by what is stored of it: how the tracking process ended elsewhere says nothing
 * of this one.
 */
function storedStanding(session, run, summary) {
  const idle = (words) => ({ name: "idle", words, title: "", share: null });
  if (!run) return idle(session ? "no run" : "idle");
  if (!summary) return idle("idle");
  const [done, all] = [summary.frames.length, summary.last - summary.first];
  if (!done) return idle("not tracked yet");
  return done < all ? idle(`${done} of ${all} frames`) : { ...idle("finished"), name: "finished" };
}

/**
 * The state of tracking as the header shows it. `name`: of its colour; `share`: of the frames that
 * are done, null where no bar is shown.
 */
export function standing(work, session, run, connected, summary) {
  const here = isOpen(work, session, run) && Boolean(run);
  if (connected === false) {
    return { name: "disconnected", words: "disconnected, reconnecting", title: "", share: null };
  }
  const searches = isBusy(work) || work?.state === "paused";
  if (here ? work.state === "idle" : !searches) return storedStanding(session, run, summary);
  const elsewhere =
    work && !here && work.run && work.state === "tracking" ? `${work.session}: ` : "";
  const isGoingOn = here && CANCELLABLE.includes(work.state);
  const done = isGoingOn && (work.live ? work.frame - work.first : work.done);
  return {
    name: work?.state ?? "idle",
    words: elsewhere + stateLine(work),
    title: work?.message ? `${work.message} ${work.hint}` : "",
    share: isGoingOn ? done / Math.max(1, work.last - work.first) : null,
  };
}

/** What the tracking buttons say and whether they can be pressed. */
export function offers(work, session, run, connected, summary, frame) {
  const here = isOpen(work, session, run);
  const usable = Boolean(run && connected);
  const busy = here && isBusy(work);
  const tracked = summary?.frames.length ?? 0;
  const complete =
    Boolean(summary) &&
    (tracked >= summary.last - summary.first || (here && work.state === "finished"));
  const isTracking = here && work.state === "tracking";
  let word = complete ? "Tracked" : "Continue";
  if (!tracked) word = "Track";
  if (here && work.state === "lost") word = "Resume";
  if (isTracking) word = "Pause";
  return {
    word,
    isFirst: !complete || busy,
    toggle: usable && (!complete || busy),
    step: usable && !busy && !complete,
    reanneal: usable && tracked > 0 && frame !== null && !isTracking,
    cancel: here && CANCELLABLE.includes(work.state),
  };
}

/** @param {"start" | "pause" | "cancel" | "step-layer" | "step-frame" | "reanneal"} what */
export const command = (what, body = /** @type {any} */ (undefined)) =>
  post(`${runPath(get("session"), get("run"))}/${what}`, body).catch(complain);

/** Track on, or pause. */
export function toggleTracking() {
  const work = get("work");
  if (isOpen(work) && work.state === "tracking") return command("pause");
  set({ follow: true });
  return command("start");
}

/** One layer, or the rest of the frame. @param {"step-layer" | "step-frame"} what */
export function step(what) {
  set({ follow: true });
  command(what);
}

/** Anneal the shown frame again with the knobs as they are. */
export function reanneal() {
  const names = ["work", "session", "run", "connected", "summary", "frame"];
  const [work, session, run, connected, summary, frame] = names.map(get);
  if (offers(work, session, run, connected, summary, frame).reanneal) {
    command("reanneal", { frame });
  }
}

// The speed at which the search is slowed down to be watched. The choices and their words are the
// server's, the speed in use is the tracking process's own.

/** The offered speeds, fast to slow: {label, seconds_a_layer}. */
export const speeds = signal(/** @type {any[]} */ ([]));
let isAsking = false;

/** Ask what is offered. The server counts a speed that a script has set among the choices. */
export async function loadSpeeds() {
  if (isAsking) return;
  isAsking = true;
  try {
    speeds.value = (await fetchJson("/api/worker/pace")).choices;
  } catch (error) {
    complain(error);
  }
  isAsking = false;
}

/** Let each layer take at least so many seconds. */
export const setSpeed = (seconds) =>
  post("/api/worker/pace", { seconds_a_layer: seconds }).catch(complain);

/** Whether each layer is given time to be looked at. */
export const isWatched = () => (get("work")?.seconds_a_layer ?? 0) > 0;
