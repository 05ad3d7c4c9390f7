// How slowly the search goes for whoever watches it. The choices and their words are the server's, the speed in use is
// the tracking process's own.

import { fetchJson, post } from "./api.js";
import { byId } from "./elements.js";
import { complain } from "./messages.js";
import { get, watch } from "./state.js";

/** @type {HTMLSelectElement} */
const choice = byId("search-speed");
let asking = false;

const inUse = () => String(get("work")?.seconds_a_layer ?? 0);
const isOffered = () => [...choice.options].some((option) => option.value === inUse());

/** Whether each layer is given time to be looked at. */
export const isWatched = () => (get("work")?.seconds_a_layer ?? 0) > 0;

async function loadChoices() {
  if (asking) return;
  asking = true;
  try {
    const { choices } = await fetchJson("/api/worker/pace");
    choice.replaceChildren(...choices.map((one) => new Option(one.label, String(one.seconds_a_layer))));
  } catch (error) { complain(error); } finally { asking = false; }
  if (isOffered()) show();
}

/** Show the speed in use; one that is none of the choices (set by a script) becomes one. */
function show() {
  choice.disabled = !get("connected");
  if (choice.disabled) return;
  if (!isOffered()) loadChoices();
  else if (choice.value !== inUse()) choice.value = inUse();
}

/** Wire the choice. */
export function startSearchSpeed() {
  choice.onchange = () => post("/api/worker/pace", { seconds_a_layer: Number(choice.value) }).catch((error) => { complain(error); show(); });
  watch(["work", "connected"], show);
}
