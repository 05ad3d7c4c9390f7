// A frame corrected by hand: its pose is edited in the scene, then the run is tracked on from it, or backwards; the new
// run is opened and the old one stays.

import { fault, fetchJson, post, remove, runPath } from "./api.js";
import { bar, button, byId, element, fill } from "./elements.js";
import { followJob } from "./jobs.js";
import { onEvent } from "./live.js";
import { complain, say } from "./messages.js";
import { openSession, refreshSessions } from "./sessions.js";
import { get, set, watch } from "./state.js";

const line = byId("correcting");
const opener = byId("correct");
const POSE_PATH = "/api/scene/edit";

let frame = null;      // that is being corrected, null while none is
let begun = false;     // whether the scene lets it be edited already
let going = null;      // work in the background: its last state

const busy = () => ["tracking", "compiling", "reannealing"].includes(get("work")?.state) && get("work")?.run === get("run");

/** Let the shown frame be corrected in the scene. */
async function correctFrame() {
  const [session, run, shown] = [get("session"), get("run"), get("frame")];
  if (!run || shown === null) return;
  try {
    await post(POSE_PATH, { session, run, frame: shown });
    set({ follow: false });
    frame = shown;
    begun = false;
    draw();
  } catch (error) { complain(error); }
}

function leave() {
  frame = null;
  remove(POSE_PATH).catch(complain);
  draw();
}

/** Leave the correction, unless it is being tracked. Whether there was one to leave. */
export function leaveCorrecting() {
  if (frame === null || going) return false;
  leave();
  return true;
}

/** Make the corrected run and track it. back : the last frame to be tracked backwards; null: onwards. */
async function track(back) {
  const [session, run] = [get("session"), get("run")];
  try {
    const edited = await fetchJson(POSE_PATH);
    if (!edited.editing || edited.frame === null) throw fault("The editing was ended in the scene.", "Correct the frame again.");
    const begunJob = await post(`${runPath(session, run)}/correct`, { frame: edited.frame, pose: edited.pose, back_to: back });
    going = begunJob;
    draw();
    const ended = await followJob(`/api/track-jobs/${begunJob.identifier}`, (job) => { going = job; draw(); });
    const at = edited.frame;
    frame = going = null;
    draw();
    await remove(POSE_PATH);
    await refreshSessions();
    openSession(session, ended.made_run);
    say(`Frame ${at} of ${run} is corrected in ${ended.made_run}${ended.state === "cancelled" ? ", as far as it was tracked" : ""}; ${run} is unchanged.`);
    if (back === null) await post(`${runPath(session, ended.made_run)}/start`);
    else set({ frame: at });
  } catch (error) {
    going = null;
    draw();
    complain(error);
  }
}

/** Backwards to which frame: a field and its button. */
function backwards() {
  const first = get("summary")?.frames[0]?.frame ?? 0;
  if (frame <= 0) return [];
  const field = element("input", { type: "number", min: 0, max: frame - 1, step: 1, value: first < frame ? first : 0, ariaLabel: "Backwards to frame" });
  return [button("Track backwards to", () => { if (field.reportValidity()) return track(Number(field.value)); return null; }, "small"), field];
}

function draw() {
  line.hidden = frame === null;
  opener.disabled = !get("run") || get("frame") === null || !get("summary")?.frames.length || busy() || frame !== null;
  if (frame === null) return fill(line);
  if (going) {
    return fill(line, element("span", { role: "status" }, going.total ? `tracking backwards, ${going.done} of ${going.total} frames` : "making the corrected run"), bar(going.total ? going.done / going.total : 0),
      button("Cancel", () => remove(`/api/track-jobs/${going.identifier}`).catch(complain), "quiet small"));
  }
  const words = element("span", {}, "Correcting frame ", element("b", {}, frame), ": drag the balls on the limbs");
  fill(line, words, button("Undo", undo, "small", { title: "Take the last change back (Ctrl Z)" }), button("Track on from here", () => track(null), "primary small"), backwards(),
    button("Leave", leave, "quiet small", { title: "Leave it as it was (Escape)" }));
}

/** Take the last change of the pose back. */
const undo = () => post(`${POSE_PATH}/undo`).catch(complain);

/** Ctrl Z takes a change back, unless a field or a dialog has the key. */
function takeKey(event) {
  if (frame === null || going || event.target.closest?.("input, textarea, dialog, [role=menu]")) return;
  if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z" || event.shiftKey) return;
  event.preventDefault();
  undo();
}

/** Wire the button, the bar, and what the scene says. */
export function startCorrecting() {
  opener.onclick = correctFrame;
  document.addEventListener("keydown", takeKey);
  watch(["run", "frame", "summary", "work"], () => { if (frame === null) draw(); });
  watch(["session", "run"], () => { if (frame !== null && !going) leave(); });
  onEvent("scene", (event) => {
    if (frame === null) return;
    if (event.editing) begun = true;
    else if (begun && !going) { frame = null; draw(); }
  });
}
