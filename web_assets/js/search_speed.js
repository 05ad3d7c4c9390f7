// How slowly the search goes for whoever watches it. The choices and their words are the server's, the speed in use is
// the tracking process's own.

import { fetchJson, post } from "./api.js";
import { complain } from "./messages.js";
import { get, watch } from "./state.js";

const select = document.getElementById("search-speed");
let asking = false;

const inUse = () => String(get("work")?.seconds_a_layer ?? 0);
const isOffered = (seconds) => [...select.options].some((option) => option.value === seconds);

/** Whether each layer is given time to be looked at. */
export const isWatched = () => (get("work")?.seconds_a_layer ?? 0) > 0;

async function askForChoices() {
  if (asking) return;
  asking = true;
  try {
    const { choices } = await fetchJson("/api/worker/pace");
    select.replaceChildren(...choices.map((choice) => new Option(choice.label, choice.seconds_a_layer)));
  } catch (error) { complain(error); } finally { asking = false; }
  if (isOffered(inUse())) show();
}

/** Show the speed in use; one that is none of the choices (set by a script) becomes one. */
function show() {
  select.disabled = !get("connected");
  if (select.disabled) return;
  if (!isOffered(inUse())) askForChoices();
  else if (select.value !== inUse()) select.value = inUse();
}

/** Wire the select. */
export function startSearchSpeed() {
  select.onchange = () => post("/api/worker/pace", { seconds_a_layer: Number(select.value) }).catch((error) => { complain(error); show(); });
  watch(["work", "connected"], show);
}
