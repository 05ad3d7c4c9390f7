// Do the cameras agree? How far silhouettes miss, camera by camera; turning the cameras until they do, and back.

import { button, duration, element } from "./elements.js";
import { complain } from "./messages.js";
import { isGoing } from "./jobs.js";

const ASKED = "A tripod that was touched after the calibration turns a camera by a degree, which is twenty pixels. Silhouettes tell, without a board.";
const pixels = (value) => (value === null ? "–" : `${value.toFixed(1)} px`);

/** The box in `place`; `changed()` is called when the session has other cameras. Returns {ask, measure, stop}. */
export function alignmentBox(way, place, changed) {
  const { fetchJson, post, remove, sessionPath } = way.api;
  const here = `${sessionPath(way.session)}/alignment`;
  const state = { told: null, failed: null, busy: false, stopped: false, asked: false };

  function table(job) {
    const head = ["camera", "misses by", "turned by", job.kept ? "misses now by" : "would miss by"];
    const rows = job.cameras.map((line) => element("tr", {}, element("td", { textContent: line.camera }), element("td", { textContent: pixels(line.before_px) }),
      element("td", { textContent: `${line.turn_degrees.toFixed(2)}°` }), element("td", { textContent: pixels(line.after_px) })));
    return element("table", { className: "figures" }, element("thead", {}, element("tr", {}, ...head.map((words) => element("th", { textContent: words })))), element("tbody", {}, ...rows));
  }

  function verdict(job) {
    if (job.kept) return "The session uses the turned cameras.";
    if (!job.needed) return "The cameras agree: nothing has to be turned.";
    return job.better ? `${job.words} Lenses and places stay as they are.` : job.words;
  }

  function actions(job) {
    const turn = job?.needed && job.better && !job.kept && button("Turn the cameras", () => change("keep"), "small");
    const back = state.told.turned && button("Turn them back", () => change("undo"), "small quiet");
    if (turn) turn.title = "The calibration before is kept; what was made with it is marked as stale.";
    if (back) back.title = "Use the calibration again that the cameras were turned from.";
    for (const one of [turn, back]) if (one) one.disabled = state.busy;
    return (turn || back) && element("div", { className: "step-actions" }, ...[turn, back].filter(Boolean));
  }

  function draw() {
    if (state.stopped || !state.told) return;
    const { job, possible, turned, notes } = state.told;
    place.hidden = !possible;
    const going = isGoing(job);
    const measure = button(job?.state === "done" ? "Measure again" : "Measure", () => { state.asked = true; return begin(); }, "small");
    measure.disabled = going || state.busy;
    measure.setAttribute("aria-label", "Measure whether the cameras agree");
    const bar = element("div", {});
    const failed = state.failed ?? (job?.state === "failed" ? job : null);
    const alarm = state.asked || state.failed;  // nobody asked for what was measured by itself
    const done = job?.state === "done" ? job : null;
    place.replaceChildren(...[
      element("div", { className: "head-line" }, element("h2", { textContent: "Do the cameras agree?" }), measure), bar,
      done && table(done), done && element("p", { className: done.needed && !done.kept ? "notice" : "hint", textContent: verdict(done) }),
      !done && !going && element("p", { className: "hint", textContent: turned ? "The cameras in use were turned by their silhouettes." : ASKED }),
      actions(done), ...notes.map((note) => element("p", { className: "notice", textContent: note })),
      failed && element("p", alarm ? { className: "wrong", role: "alert" } : { className: "hint" }, failed.message, element("span", { className: "hint", textContent: ` ${failed.hint ?? ""}` })),
    ].filter(Boolean));
    if (!going) return;
    const share = job.total ? job.done / job.total : null;
    const words = [job.done < job.total || !job.total ? job.step || "beginning" : "turning the cameras", job.done < job.total && share ? `${Math.round(100 * share)} %` : "", job.seconds_left > 2 ? `${duration(job.seconds_left)} left` : ""].filter(Boolean).join(" · ");
    way.progress(bar, { words, share, cancel: () => remove(here).catch(complain) });
  }

  async function ask() {
    state.told = await fetchJson(here);
    draw();
  }

  async function begin() {
    state.failed = null;
    try {
      const job = await post(here, {});
      state.told = { ...state.told, job, notes: [] };
    } catch (error) { state.failed = error; }
    draw();
  }

  async function change(how) {
    state.failed = null;
    state.busy = true;
    draw();
    try { state.told = await post(`${here}/${how}`); changed(); } catch (error) { state.failed = error; }
    state.busy = false;
    draw();
  }

  way.on("alignment", (job) => {
    if (!state.told) return;
    state.told = { ...state.told, job };
    draw();
    if (!isGoing(job)) way.refresh().catch(complain);
  });

  return { ask, measure: begin, stop: () => { state.stopped = true; } };
}
