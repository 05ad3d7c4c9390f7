// A frame corrected by hand: its pose is edited in the scene, then the run is tracked on from it, or backwards; the new
// run is opened and the old one stays.

import { fault, fetchJson, post, remove, runPath } from "./api.js";
import { button, byId, element, fill } from "./elements.js";
import { onEvent } from "./live.js";
import { complain } from "./messages.js";
import { get, set, watch } from "./state.js";
import { followTrackJob } from "./studio/track_work.js";

const line = byId("correcting");
const opener = byId("correct");
const POSE_PATH = "/api/scene/edit";

let frame = null;      // that is being corrected, null while none is
let begun = false;     // whether the scene lets it be edited already

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

/** Leave the correction. Whether there was one to leave. */
export function leaveCorrecting() {
  if (frame === null) return false;
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
    followTrackJob(begunJob, { frame: edited.frame, starts: back === null });
    leave();
  } catch (error) { complain(error); }
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
  const words = element("span", {}, "Correcting frame ", element("b", {}, frame), ": drag the balls on the limbs");
  fill(line, words, button("Undo", undo, "small", { title: "Take the last change back (Ctrl Z)" }), button("Track on from here", () => track(null), "primary small"), backwards(),
    button("Leave", leave, "quiet small", { title: "Leave it as it was (Escape)" }));
}

/** Take the last change of the pose back. */
const undo = () => post(`${POSE_PATH}/undo`).catch(complain);

/** Ctrl Z takes a change back, unless a field or a dialog has the key. */
function takeKey(event) {
  if (frame === null || event.target.closest?.("input, textarea, dialog, [role=menu]")) return;
  if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z" || event.shiftKey) return;
  event.preventDefault();
  undo();
}

/** Go on with what this window corrected before it was loaded again. */
async function goOn() {
  const edited = await fetchJson(POSE_PATH);
  if (frame !== null || !edited.editing || edited.frame === null || edited.session !== get("session") || edited.run !== get("run")) return;
  frame = edited.frame;
  begun = true;
  draw();
}

/** Wire the button, the bar, and what the scene says. */
export function startCorrecting() {
  opener.onclick = correctFrame;
  document.addEventListener("keydown", takeKey);
  watch(["run", "frame", "summary", "work"], () => { if (frame === null) draw(); });
  watch(["session", "run"], () => { if (frame !== null) leave(); });
  let isKnown = false;
  watch(["summary"], () => {
    if (isKnown || !get("summary")) return;
    isKnown = true;
    goOn().catch(complain);
  });
  onEvent("scene", (event) => {
    if (frame === null) return;
    if (event.editing) begun = true;
    else if (begun) { frame = null; draw(); }
  });
}
