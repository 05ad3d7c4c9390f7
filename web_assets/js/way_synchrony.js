// The cameras in step: offsets by hand, by a recorder's times, or estimated; an estimate is shown and applied only by a click.

import { button, element } from "./elements.js";
import { followJob, isGoing, shareOf, withTimeLeft } from "./jobs.js";
import { complain } from "./messages.js";

/** Draw in `place`; `offered(offsets)` applies offsets. */
export function synchroniser(place, way, { offered }) {
  const { post, remove, sessionPath } = way.api;
  const here = sessionPath(way.session);
  const state = { told: null, estimate: null, stopped: false, from: "" };

  const inputs = () => [...place.querySelectorAll("input[data-camera]")];
  const asked = () => Object.fromEntries(inputs().map((input) => [input.dataset.camera, Number(input.value || 0)]));
  const isChanged = () => state.told.cameras.some((camera) => asked()[camera.name] !== camera.offset);

  function rows() {
    return state.told.cameras.map((camera) => {
      const input = element("input", { type: "number", step: 1, value: camera.offset, ariaLabel: `Offset of ${camera.name}, frames` });
      input.dataset.camera = camera.name;
      input.oninput = () => { place.querySelector(".apply-offsets").hidden = !isChanged(); };
      const found = state.estimate?.offsets?.[camera.name];
      const sure = state.estimate?.confidence?.[camera.name];
      const spread = state.estimate?.spread?.[camera.name];
      const words = found === undefined ? "" : [`${found}`, spread ? `± ${spread}` : "", sure ? `peak ${sure.toFixed(1)}×` : ""].filter(Boolean).join(" ");
      return element("tr", {}, element("td", { textContent: camera.name }), element("td", {}, input), element("td", { textContent: words }));
    });
  }

  function estimateWords() {
    const { estimate } = state;
    if (!estimate || estimate.state !== "done") return [];
    const same = state.told.cameras.every((camera) => (estimate.offsets[camera.name] ?? 0) === camera.offset);
    const verdict = state.from ? `From ${state.from}.` : estimate.sure ? "The estimate is sure: all pairs of cameras agree." : "The estimate is not sure: look at the pictures before you use it.";
    return [element("p", { className: estimate.sure ? "hint" : "notice", textContent: `${verdict}${same ? " It is what is in use." : ""}` }), ...(estimate.notes ?? []).map((note) => element("p", { className: "hint", textContent: note })),
      !same && element("div", { className: "step-actions" }, button("Use these offsets", async () => { await offered(estimate.offsets); }, "use-estimate"))].filter(Boolean);
  }

  function draw(told) {
    state.told = told;
    if (told.cameras.length < 2) return place.replaceChildren();
    const going = isGoing(state.estimate);
    const bar = element("div", {});
    const apply = button("Apply", () => offered(asked()), "apply-offsets");
    apply.hidden = true;
    const times = element("input", { type: "file", accept: ".csv", hidden: true });
    times.onchange = () => readTimes(times.files[0]).catch(complain);
    const failed = state.estimate?.state === "failed";
    place.replaceChildren(...[
      element("h2", { textContent: "In step" }),
      element("p", { className: "hint", textContent: "The frame of each camera's file that was taken with frame 0 of the others." }),
      element("table", { className: "figures offsets" }, element("thead", {}, element("tr", {}, ...["camera", "offset", "found"].map((head) => element("th", { textContent: head })))), element("tbody", {}, ...rows())),
      element("div", { className: "step-actions" }, apply, button("Estimate from motion", estimate, "small"), button("From timestamps.csv…", () => times.click(), "quiet small"), times),
      bar, failed && element("p", { className: "wrong" }, state.estimate.message, element("span", { className: "hint", textContent: ` ${state.estimate.hint}` })),
      ...estimateWords(),
      told.stale_runs.length > 0 && element("p", { className: "notice", textContent: `Tracked on the footage as it was before: ${told.stale_runs.join(", ")}.` }),
    ].filter(Boolean));
    if (going) {
      way.progress(bar, { words: withTimeLeft(state.estimate, "beginning"), share: shareOf(state.estimate), cancel: () => remove(`${here}/synchrony`).catch(complain) });
    }
  }

  async function readTimes(file) {
    if (!file) return;
    const answer = await fetch(`${here}/footage/times`, { method: "POST", body: file });
    const told = await answer.json();
    if (!answer.ok) throw Object.assign(new Error(told.message), { hint: told.hint });
    state.from = file.name;
    state.estimate = { state: "done", sure: true, offsets: told.offsets, notes: [...told.notes, `${told.apart.toFixed(2)} frames apart at most.`] };
    draw(state.told);
  }

  async function estimate() {
    state.from = "";
    try {
      await post(`${here}/synchrony`, {});
      state.estimate = await followJob(`${here}/synchrony`, (told) => { state.estimate = told; draw(state.told); }, () => state.stopped);
    } catch (error) { state.estimate = { state: "failed", message: error.message, hint: error.hint }; }
    if (!state.stopped) draw(state.told);
  }

  return { draw, stop() { state.stopped = true; } };
}
