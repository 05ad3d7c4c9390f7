// A frame that was annealed again is shown but not stored: a line in the scene says so and offers to keep it.

import { post, runPath } from "./api.js";
import { openForm } from "./dialogs.js";
import { button, byId, element, fill } from "./elements.js";
import { get, watch } from "./state.js";

function keepForm(frame) {
  const path = runPath(get("session"), get("run"));
  openForm({
    heading: `Keep the new result of frame ${frame}?`, action: "Keep it", rows: [],
    intro: "It replaces the stored one. The frames after it followed from the old result and are dropped; tracking on computes them again.",
    send: () => post(`${path}/reanneal`, { frame, keep: true }),
  });
}

/** Wire the line to the state. */
export function startWhatIf() {
  const line = byId("what-if");
  watch(["whatIf"], () => {
    const frame = get("whatIf")?.[0].frame;
    line.hidden = frame === undefined;
    if (!line.hidden) fill(line, element("span", {}, `Frame ${frame} re-annealed, not stored; the stored result stays beside it in grey.`), button("Keep…", () => keepForm(frame), "small"));
  });
}
