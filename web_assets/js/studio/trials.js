// Trials of the shown frame: which of them is shown, what it is compared with, and what the studio
// keeps of them. A trial is a frame that was annealed again with moved knobs and is not stored; the
// address names it.

import { fetchJson, post, remove, runPath } from "../api.js";
import { onEvent } from "../live.js";
import { complain } from "../messages.js";
import { paced } from "../pacing.js";
import { isStored } from "../selection.js";
import { get, set, watch } from "../state.js";

const LIST_MILLISECONDS = 200;

/** The trial whose layers are in the state. @type {string | null} */
let held = null;

const here = () => `${get("session")}/${get("run")}/${get("frame")}`;

/** What was tried of the shown frame, where anything was. */
async function loadList() {
  const [session, run, frame, place] = [get("session"), get("run"), get("frame"), here()];
  if (!run || frame === null || !isStored()) return set({ trials: null });
  if (!get("trial") && !get("moved")?.length) return set({ trials: null });
  try {
    const trials = await fetchJson(`${runPath(session, run)}/frames/${frame}/trials`);
    if (place === here()) set({ trials });
  } catch (/** @type {any} */ error) {
    if (error.status !== 404) complain(error);
  }
}

const listLater = paced(loadList, LIST_MILLISECONDS);

/** The layers of the trial that the address or the tray names; the scene shows it. */
async function loadLayers() {
  const [session, run, name, place] = [get("session"), get("run"), get("trial"), here()];
  if (!run || !name || name === held || !get("detail")) return;
  held = name;
  try {
    const { layers, frame, ...searched } = await fetchJson(
      `${runPath(session, run)}/trials/${name}`,
    );
    if (place !== here() || name !== get("trial")) return;
    if (frame !== get("frame")) return leave();
    const { search_layers, searches } = searched;
    set({ whatIf: layers.map((layer) => ({ ...layer, search_layers, searches })) });
    await post("/api/scene/show", { trial: placeOf(name) });
  } catch (/** @type {any} */ error) {
    if (get("trial") === name) leave();
    complain(error);
  }
}

/** A trial of the open run as the scene takes it; "" for none. @param {string | null} name */
export const placeOf = (name) => (name ? `${get("session")}/${get("run")}/${name}` : "");

/** No trial is shown any more; what else is stays. */
function leave() {
  held = null;
  set({ whatIf: null, trial: null, against: null });
}

/** Show a trial. @param {string} name */
export function showTrial(name) {
  set({ trial: name, against: get("against") === name ? null : get("against") });
}

/**
 * Compare the shown trial with another one, or (null) with what is stored.
 * @param {string | null} name
 */
export function compareWith(name) {
  set({ against: name });
  post("/api/scene/show", { against: placeOf(name) }).catch(complain);
}

/** Leave the stored result as it is; the knobs stay as they were moved. */
export function discard() {
  leave();
  post("/api/scene/show", { discard: true }).catch(complain);
}

/** Put the knobs that were moved back to those of the run. */
export async function putBack() {
  try {
    await remove(`${runPath(get("session"), get("run"))}/settings/moved`);
    discard();
  } catch (error) {
    complain(error);
  }
}

/** Follow what is tried and what is shown of it. */
export function startTrials() {
  watch(["whatIf"], () => {
    if (get("whatIf")) return;
    held = null;
    // Another frame or run is shown, or the stored result.
    if (get("trial") && get("detail")) set({ trial: null, against: null });
  });
  watch(["trial"], () => {
    if (!get("trial") && held && get("whatIf")) discard();
  });
  watch(["trial", "detail"], loadLayers);
  watch(["session", "run", "frame", "moved", "trial"], listLater);
  onEvent("frame", (/** @type {any} */ event, /** @type {boolean} */ isHere) => {
    if (!isHere || !event.reannealed || event.frame !== get("frame")) return;
    // By then its layers are taken; those that came before this window's scene showed the run are
    // missing.
    queueMicrotask(() => {
      const isWhole = get("whatIf")?.length === event.layers;
      held = isWhole ? (event.trial ?? null) : null;
      set({ trial: event.trial ?? null });
      loadLayers();
      listLater();
    });
  });
}
