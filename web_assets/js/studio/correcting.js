// A frame corrected by hand: its pose is edited in the scene, then the run is tracked on from it,
// or backwards; the new run is opened and the old one stays.

import { fault, fetchJson, post, remove, runPath } from "../api.js";
import { byId } from "../elements.js";
import { onEvent } from "../live.js";
import { complain } from "../messages.js";
import { get, set, watch } from "../state.js";
import { follow, html, mount, signal, useRef } from "./component.js";
import { followTrackJob } from "./track_work.js";
import { isBusy } from "../work_states.js";

const POSE_PATH = "/api/scene/edit";

/** The frame that is being corrected, null while none is. */
const corrected = signal(/** @type {number | null} */ (null));
let begun = false; // whether the scene lets it be edited already

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
  corrected.value = null;
  remove(POSE_PATH).catch(complain);
}

/** Leave the correction. Whether there was one to leave. */
export function leaveCorrecting() {
  if (corrected.value === null) return false;
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
    const job = await post(`${runPath(session, run)}/correct`, { frame, pose, back_to: back });
    followTrackJob(job, { frame, starts: back === null });
    leave();
  } catch (error) {
    complain(error);
  }
}

/** Take the last change of the pose back. */
const undo = () => post(`${POSE_PATH}/undo`).catch(complain);

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
    <${Choices} frame=${frame} />
  </div>`;
}

function canCorrect(run, frame, summary, work) {
  const isWorkedOn = isBusy(work) && work.run === run;
  return (
    run && frame !== null && summary?.frames.length > 0 && !isWorkedOn && corrected.value === null
  );
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
  if (corrected.value === null || isElsewhere) return;
  const isUndo = (event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z";
  if (!isUndo || event.shiftKey) return;
  event.preventDefault();
  undo();
}

/** Go on with what this window corrected before it was loaded again. */
async function goOn() {
  const { editing, session, run, frame } = await fetchJson(POSE_PATH);
  const isHere = editing && session === get("session") && run === get("run");
  if (!isHere || frame == null || corrected.value !== null) return;
  begun = true;
  corrected.value = frame;
}

/** Show the button and what it opens, and follow what the scene says. */
export function startCorrecting() {
  mount(byId("correct-place"), html`<${Opener} />`);
  mount(byId("correcting-place"), html`<${Correcting} />`);
  document.addEventListener("keydown", takeKey);
  watch(["session", "run"], leaveCorrecting);
  let isKnown = false;
  watch(["summary"], () => {
    if (isKnown || !get("summary")) return;
    isKnown = true;
    goOn().catch(complain);
  });
  onEvent("scene", (event) => {
    if (corrected.value === null) return;
    if (event.editing) begun = true;
    else if (begun) corrected.value = null;
  });
}
