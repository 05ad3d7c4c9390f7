// A walk through the automaton: the movement that it makes, played.

import { fetchJson } from "./api.js";
import { BodyDrawing } from "./body_drawing.js";
import { element } from "./elements.js";
import { complain } from "./messages.js";

const FRAMES = 600;

/** The card that generates and plays. Returns {box, close}. */
export function walkCard(path, told) {
  const canvas = element("canvas", { role: "img", ariaLabel: "The generated movement" });
  const again = element("button", { type: "button", className: "primary", textContent: "Generate" });
  const play = element("button", { type: "button", textContent: "Pause", disabled: true });
  const slider = element("input", { type: "range", min: 0, max: FRAMES - 1, value: 0, disabled: true, ariaLabel: "Frame" });
  const words = element("p", { className: "lead", textContent: "A walk from state to state by the automaton's probabilities, and the smooth movement that suits its clusters best; global position and orientation rest." });
  const box = element("section", { className: "card-box" }, element("h2", { textContent: "Generated movement" }),
    element("div", { className: "walk" }, canvas, element("div", { className: "walk-side" }, words,
      element("div", { className: "form-foot" }, again, play), slider)));
  let walk = null;
  let drawing = null;
  let frame = 0;
  let playing = false;
  let seed = 0;
  let last = 0;
  let closed = false;

  const show = () => {
    drawing.show(walk.frames[frame]);
    slider.value = frame;
    const history = walk.histories[frame];
    words.textContent = `Seed ${walk.seed}, frame ${frame} of ${walk.frames.length} (${(frame / walk.fps).toFixed(1)} s): cluster ${walk.clusters[frame]}, `
      + `predicted from ${history.length === 1 ? "the last frame" : `the last ${history.length} frames`}.`;
  };
  const step = (now) => {
    if (closed || !playing || !box.isConnected) return;
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
  again.onclick = async () => {
    again.disabled = true;
    try {
      walk = await fetchJson(`${path}/walk?frames=${FRAMES}&seed=${seed}`);
      seed += 1;
      frame = 0;
      drawing?.close();
      drawing = new BodyDrawing(canvas, told.limbs, walk.frames.flat());
      [play.disabled, slider.disabled] = [false, false];
      again.textContent = "Another one";
      show();
      run(true);
    } catch (error) { complain(error); } finally { again.disabled = false; }
  };
  play.onclick = () => run(!playing);
  slider.oninput = () => { run(false); frame = Number(slider.value); show(); };
  return { box, close: () => { closed = true; drawing?.close(); } };
}
