// A walk through the automaton: the movement that it makes, played.

import { fetchJson } from "./api.js";
import { BodyDrawing } from "./body_drawing.js";
import { button, card, element, lead } from "./elements.js";
import { complain } from "./messages.js";

const FRAMES = 600;

/**
 * The card that generates and plays. Returns {box, close}.
 * @param {`/api/behaviours/${string}`} path
 */
export function walkCard(path, model) {
  const canvas = element("canvas", { role: "img", ariaLabel: "The generated movement" });
  const again = button("Generate", generate, "primary");
  const play = button("Pause", () => run(!playing), "", { disabled: true });
  const slider = element("input", {
    type: "range",
    min: 0,
    max: FRAMES - 1,
    value: 0,
    disabled: true,
    ariaLabel: "Frame",
  });
  const words = lead(
    "A random walk through the automaton's states, and the smooth movement that fits its clusters best; global position and orientation stay fixed.",
  );
  const box = card(
    "Generated movement",
    element(
      "div",
      { className: "walk" },
      canvas,
      element(
        "div",
        { className: "walk-side" },
        words,
        element("div", { className: "form-foot" }, again, play),
        slider,
      ),
    ),
  );
  /** @type {import("./api_types").Schemas["GeneratedWalk"] | null} */
  let walk = null;
  let drawing = null;
  let frame = 0;
  let playing = false;
  let seed = 0;
  let last = 0;
  let closed = false;

  const show = () => {
    if (!walk) return;
    drawing.show(walk.frames[frame]);
    slider.value = String(frame);
    const history = walk.histories[frame];
    words.textContent =
      `Seed ${walk.seed}, frame ${frame} of ${walk.frames.length} (${(frame / walk.fps).toFixed(1)} s): cluster ${walk.clusters[frame]}, ` +
      `predicted from ${history.length === 1 ? "the last frame" : `the last ${history.length} frames`}.`;
  };
  const step = (now) => {
    if (closed || !playing || !walk || !box.isConnected) return;
    const due = Math.floor(((now - last) * walk.fps) / 1000);
    if (due >= 1) {
      last = due > 10 ? now : last + (due * 1000) / walk.fps;
      frame = (frame + due) % walk.frames.length;
      show();
    }
    requestAnimationFrame(step);
  };
  const run = (on) => {
    playing = on;
    play.textContent = on ? "Pause" : "Play";
    last = performance.now();
    if (on) requestAnimationFrame(step);
  };
  async function generate() {
    try {
      walk = await fetchJson(`${path}/walk?frames=${FRAMES}&seed=${seed}`);
      seed += 1;
      frame = 0;
      drawing?.close();
      drawing = new BodyDrawing(canvas, model.limbs, walk.frames.flat());
      play.disabled = slider.disabled = false;
      again.textContent = "Another one";
      show();
      run(true);
    } catch (error) {
      complain(error);
    }
  }
  slider.oninput = () => {
    run(false);
    frame = Number(slider.value);
    show();
  };
  return {
    box,
    close: () => {
      closed = true;
      drawing?.close();
    },
  };
}
