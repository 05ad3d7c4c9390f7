// A frame corrected by hand: its pose is edited in the scene, then the run is tracked on from it, or backwards; the new
// run is opened and the old one stays.

import { fetchJson, post, remove, runPath } from "./api.js";
import { button, element } from "./elements.js";
import { followJob } from "./jobs.js";
import { onEvent } from "./live.js";
import { complain, say } from "./messages.js";
import { openSession, refreshSessions } from "./rail.js";
import { get, set, watch } from "./state.js";

const bar = document.getElementById("correcting");
const opener = document.getElementById("correct");
const POSE_PATH = "/api/scene/edit";

let frame = null;      // that is being corrected, null while none is
let begun = false;     // whether the scene has said that it lets it be edited
let going = null;      // work in the background: its last state

const busy = () => ["tracking", "compiling", "reannealing"].includes(get("work")?.state) && get("work")?.run === get("run");

/** Let the shown frame be corrected in the scene. */
export async function correctFrame() {
  const [session, run, wish] = [get("session"), get("run"), get("frame")];
  if (!run || wish === null) return;
  try {
    await post(POSE_PATH, { session, run, frame: wish });
    set({ follow: false });
    frame = wish;
    begun = false;
    draw();
  } catch (error) { complain(error); }
}

function leave() {
  frame = null;
  remove(POSE_PATH).catch(complain);
  draw();
}

/** Make the corrected run and track it. back : the last frame to be tracked backwards; null: onwards. */
async function track(back) {
  const [session, run] = [get("session"), get("run")];
  try {
    const edited = await fetchJson(POSE_PATH);
    if (!edited.editing || edited.frame === null) throw Object.assign(new Error("The editing was ended in the scene."), { hint: "Correct the frame again." });
    const begunJob = await post(`${runPath(session, run)}/correct`, { frame: edited.frame, pose: edited.pose, back_to: back });
    going = begunJob;
    draw();
    const ended = await followJob(`/api/track-jobs/${begunJob.identifier}`, (told) => { going = told; draw(); });
    const at = edited.frame;
    frame = going = null;
    draw();
    await remove(POSE_PATH);
    await refreshSessions();
    openSession(session, ended.made_run);
    say(`Frame ${at} of ${run} is corrected in ${ended.made_run}${ended.state === "cancelled" ? ", as far as it came" : ""}; ${run} stays as it was.`);
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
  bar.hidden = frame === null;
  opener.disabled = !get("run") || get("frame") === null || !get("summary")?.frames.length || busy() || frame !== null;
  if (frame === null) return bar.replaceChildren();
  if (going) {
    const share = going.total ? going.done / going.total : 0;
    const line = element("div", { className: "progress" }, element("i"));
    line.firstChild.style.width = `${Math.round(100 * share)}%`;
    return bar.replaceChildren(element("span", { role: "status", textContent: going.total ? `tracking backwards, ${going.done} of ${going.total} frames` : "making the corrected run" }), line,
      button("Cancel", () => remove(`/api/track-jobs/${going.identifier}`).catch(complain), "quiet small"));
  }
  const title = element("span", {}, "Correcting frame ", element("b", { textContent: String(frame) }), ": drag the balls on the limbs");
  return bar.replaceChildren(title, button("Track on from here", () => track(null), "primary small"), ...backwards(), button("Leave", leave, "quiet small"));
}

/** Wire the button, the bar, and what the scene says. */
export function startCorrecting() {
  opener.onclick = correctFrame;
  watch(["run", "frame", "summary", "work"], () => { if (frame === null) draw(); });
  watch(["session", "run"], () => { if (frame !== null && !going) leave(); });
  onEvent("scene", (event) => {
    if (frame === null) return;
    if (event.editing) begun = true;
    else if (begun && !going) { frame = null; draw(); }
  });
}
