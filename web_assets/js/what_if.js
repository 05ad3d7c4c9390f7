// A frame that was annealed again is shown but not stored: a line in the scene says so and offers to keep it.

import { post, runPath } from "./api.js";
import { openForm } from "./dialogs.js";
import { get, watch } from "./state.js";

const line = document.getElementById("what-if");

function keepForm(frame) {
  const path = runPath(get("session"), get("run"));
  openForm({
    heading: `Keep the new answer of frame ${frame}?`, action: "Keep it", rows: [],
    intro: "It replaces the stored one. The frames after it followed from the old answer and are dropped; tracking on computes them anew.",
    send: () => post(`${path}/reanneal`, { frame, keep: true }),
  });
}

/** Wire the line to the state. */
export function startWhatIf() {
  const words = document.createElement("span");
  const keep = Object.assign(document.createElement("button"), { className: "small", textContent: "Keep…" });
  line.append(words, keep);
  watch(["whatIf"], () => {
    const layers = get("whatIf");
    line.hidden = !layers;
    if (!layers) return;
    words.textContent = `Frame ${layers[0].frame} re-annealed, not stored; the stored answer stays beside it in grey.`;
    keep.onclick = () => keepForm(layers[0].frame);
  });
}
