// A frame corrected by hand: its pose is edited in the scene, then the run is tracked on from it, or backwards; the new
// run is opened and the old one stays.

import { fault, fetchJson, post, remove, runPath } from "../api.js";
import { byId } from "../elements.js";
import { followJob } from "../jobs.js";
import { onEvent } from "../live.js";
import { complain, say } from "../messages.js";
import { openSession, refreshSessions } from "../sessions.js";
import { get, set, watch } from "../state.js";
import { batch, follow, html, mount, signal, useRef } from "./component.js";

const POSE_PATH = "/api/scene/edit";
const BUSY = ["tracking", "compiling", "reannealing"];

/** The frame that is being corrected, null while none is. */
const corrected = signal(/** @type {number | null} */ (null));
/** Work in the background: its last state. */
const going = signal(/** @type {any} */ (null));
let begun = false; // whether the scene lets it be edited already

const end = () =>
  batch(() => {
    corrected.value = null;
    going.value = null;
  });

/** Let the shown frame be corrected in the scene, where that can be done now. */
export async function correctFrame() {
  const [session, run, frame] = [get("session"), get("run"), get("frame")];
  if (!canCorrect(get("run"), get("frame"), get("summary"), get("work"))) return;
  try {
    await post(POSE_PATH, { session, run, frame });
    set({ follow: false });
    begun = false;
    corrected.value = frame;
  } catch (error) {
    complain(error);
  }
}

function leave() {
  end();
  remove(POSE_PATH).catch(complain);
}

/** Leave the correction, unless it is being tracked. Whether there was one to leave. */
export function leaveCorrecting() {
  if (corrected.value === null || going.value) return false;
  leave();
  return true;
}

/**
 * Make the corrected run and track it.
 * @param {number | null} back the last frame to be tracked backwards; null: onwards
 */
async function track(back) {
  const [session, run] = [get("session"), get("run")];
  try {
    const edited = await fetchJson(POSE_PATH);
    if (!edited.editing || edited.frame == null) {
      throw fault("The editing was ended in the scene.", "Correct the frame again.");
    }
    const { frame, pose } = edited;
    going.value = await post(`${runPath(session, run)}/correct`, { frame, pose, back_to: back });
    const ended = await followJob(`/api/track-jobs/${going.value.identifier}`, (job) => {
      going.value = job;
    });
    end();
    await remove(POSE_PATH);
    await refreshSessions();
    const made = ended.made_run;
    openSession(session, made);
    const partly = ended.state === "cancelled" ? ", as far as it was tracked" : "";
    say(`Frame ${frame} of ${run} is corrected in ${made}${partly}; ${run} is unchanged.`);
    if (back === null) await post(`${runPath(session, made)}/start`);
    else set({ frame });
  } catch (error) {
    going.value = null;
    complain(error);
  }
}

/** Take the last change of the pose back. */
const undo = () => post(`${POSE_PATH}/undo`).catch(complain);

/** How far tracking backwards is, and a way to stop it. */
function Going() {
  const { identifier, total, done } = going.value;
  const words = total
    ? `tracking backwards, ${done} of ${total} frames`
    : "making the corrected run";
  const cancel = () => remove(`/api/track-jobs/${identifier}`).catch(complain);
  return html`<span role="status">${words}</span>
    <div class="progress">
      <i style=${{ width: `${Math.round(100 * (total ? done / total : 0))}%` }}></i>
    </div>
    <button type="button" class="quiet small" onClick=${cancel}>Cancel</button>`;
}

/** Backwards to which frame: a button and its field. @param {{ frame: number }} properties */
function Backwards({ frame }) {
  const field = useRef(/** @type {HTMLInputElement | null} */ (null));
  const first = follow("summary")?.frames[0]?.frame ?? 0;
  const trackBack = () => {
    if (field.current?.reportValidity()) track(Number(field.current.value));
  };
  return html`<button type="button" class="small" onClick=${trackBack}>Track backwards to</button>
    <input
      ref=${field}
      type="number"
      min="0"
      max=${frame - 1}
      step="1"
      defaultValue=${first < frame ? first : 0}
      aria-label="Backwards to frame"
    />`;
}

/** What can be done with the frame. @param {{ frame: number }} properties */
function Choices({ frame }) {
  return html`<span>Correcting frame <b>${frame}</b>: drag the balls on the limbs</span>
    <button type="button" class="small" title="Take the last change back (Ctrl Z)" onClick=${undo}>
      Undo
    </button>
    <button type="button" class="primary small" onClick=${() => track(null)}>
      Track on from here
    </button>
    ${frame > 0 && html`<${Backwards} frame=${frame} />`}
    <button
      type="button"
      class="quiet small"
      title="Leave it as it was (Escape)"
      onClick=${leave}
    >
      Leave
    </button>`;
}

/** The bar over the scene while a frame is corrected. */
function Correcting() {
  const frame = corrected.value;
  if (frame === null) return null;
  return html`<div class="what-if correcting" id="correcting">
    ${going.value ? html`<${Going} />` : html`<${Choices} frame=${frame} />`}
  </div>`;
}

function canCorrect(run, frame, summary, work) {
  const isBusy = BUSY.includes(work?.state) && work?.run === run;
  return run && frame !== null && summary?.frames.length > 0 && !isBusy && corrected.value === null;
}

const Opener = () => html`<button
  class="small"
  id="correct"
  disabled=${!canCorrect(follow("run"), follow("frame"), follow("summary"), follow("work"))}
  title="Correct this frame by hand, and track forwards or backwards from it (c)"
  onClick=${correctFrame}
>
  Correct…
</button>`;

/** Ctrl Z takes a change back, unless a field or a dialog has the key. */
function takeKey(event) {
  const isElsewhere = event.target.closest?.("input, textarea, dialog, [role=menu]");
  if (corrected.value === null || going.value || isElsewhere) return;
  const isUndo = (event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z";
  if (!isUndo || event.shiftKey) return;
  event.preventDefault();
  undo();
}

/** Show the button and what it opens, and follow what the scene says. */
export function startCorrecting() {
  mount(byId("correct-place"), html`<${Opener} />`);
  mount(byId("correcting-place"), html`<${Correcting} />`);
  document.addEventListener("keydown", takeKey);
  watch(["session", "run"], leaveCorrecting);
  onEvent("scene", (event) => {
    if (corrected.value === null) return;
    if (event.editing) begun = true;
    else if (begun && !going.value) corrected.value = null;
  });
}
