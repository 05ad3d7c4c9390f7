// Step Track: the short form of a run, how far it is, and the outlines over the pictures as they are found.

import { button, duration, element } from "./elements.js";
import { followJob } from "./jobs.js";
import { complain } from "./messages.js";
import { viewWall } from "./way_views.js";

const PICTURE_MILLISECONDS = 700;
const POLL_MILLISECONDS = 1500;
const EFFORTS = [[1000, "quick · 1000 poses a frame"], [2000, "usual · 2000 poses a frame"], [5000, "thorough · 5000 poses a frame"], [0, "as the settings say"]];
const BUSY = ["tracking", "compiling", "reannealing"];

export function mount(place, way) {
  const { fetchJson, post, remove, runPath, sessionPath } = way.api;
  const here = sessionPath(way.session);
  const status = element("section", { className: "track-status" });
  const form = element("form", { className: "footage-form" });
  const fold = element("details", {}, element("summary", { textContent: "Track anew" }), form);
  place.append(status, fold);
  const state = { runs: way.detail.runs, work: null, job: null, frame: null, stopped: false, timer: 0, shownAt: 0, failed: null };
  const wall = viewWall(way);
  const newest = () => state.runs[0] ?? null;
  const path = () => runPath(way.session, newest().name);
  const isHere = () => state.work && newest() && state.work.session === way.session && state.work.run === newest().name;
  const isBusy = () => Boolean(isHere() && BUSY.includes(state.work.state));

  async function loadRuns() { state.runs = (await fetchJson(here)).runs; }

  function workWords() {
    const { work } = state;
    if (work.state === "compiling") return "compiling the kernels, once";
    return [`${work.state} frame ${work.frame} of ${work.first}–${work.last - 1}`, work.frames_per_second ? `${work.frames_per_second.toPrecision(2)} a second` : "", work.seconds_left !== null && work.seconds_left !== undefined ? `${duration(work.seconds_left)} left` : ""].filter(Boolean).join(" · ");
  }

  function drawStatus() {
    const run = newest();
    fold.open = !run || fold.open;
    fold.classList.toggle("alone", !run);
    if (!run) {
      status.replaceChildren();
      return;
    }
    if (state.job) {
      const { done, total, seconds_left: left } = state.job;
      const words = [`tracking backwards${total ? `, ${done} of ${total} frames` : ""}`, left > 2 ? `${duration(left)} left` : ""].filter(Boolean).join(" · ");
      way.progress(status, { words, share: total ? done / total : 0, cancel: () => remove(`/api/track-jobs/${state.job.identifier}`).catch(complain) });
      return;
    }
    const complete = run.done >= run.last - run.first;
    const stale = way.step?.state === "stale";
    if (isBusy()) {
      const share = state.work.last > state.work.first ? state.work.done / (state.work.last - state.work.first) : 0;
      way.progress(status, { words: workWords(), share, cancel: () => post(`${path()}/cancel`).catch(complain) });
      return;
    }
    const which = run.first > 0 ? ` (from frame ${run.first} on)` : "";
    const words = `${run.name}: ${run.done} of ${run.last - run.first} frames${which}, ${run.describe}${run.mean_mm !== null && run.mean_mm !== undefined ? `, ${run.mean_mm.toPrecision(3)} mm from the truth` : ""}.`;
    const failed = isHere() && ["failed", "lost"].includes(state.work.state) ? state.work : state.failed;
    const on = !complete && !stale ? button(run.done ? "Track on" : "Track", () => start(run.name), "primary") : null;
    const before = run.done && run.first > 0 && !stale ? button("Track back to frame 0", goBack) : null;
    if (before) before.title = `The run begins in frame ${run.first}. The frames before it are tracked backwards from there, into a new run; ${run.name} stays.`;
    status.replaceChildren(...[element("p", { textContent: words }), failed && element("p", { className: "wrong", role: "alert" }, failed.message, element("span", { className: "hint", textContent: ` ${failed.hint ?? ""}` })),
      element("div", { className: "step-actions" }, ...[on, before, element("a", { className: "download", href: `/?session=${encodeURIComponent(way.session)}&run=${encodeURIComponent(run.name)}`, textContent: "Open in the studio" })].filter(Boolean))].filter(Boolean));
    fold.open ||= stale;
  }

  async function start(name) {
    state.failed = null;
    try {
      await post(`${runPath(way.session, name)}/start`);
      state.work = { session: way.session, run: name, state: "compiling", frame: 0, first: 0, last: 1, done: 0 };
    } catch (error) { state.failed = error; }
    drawStatus();
  }

  /** The frames before the first one, tracked backwards from it into a new run. */
  async function goBack() {
    const run = newest();
    state.failed = null;
    try {
      state.job = await post(`${path()}/correct`, { frame: run.first, track: "raw", back_to: 0 });
      followBack();
    } catch (error) { state.failed = error; }
    drawStatus();
  }

  async function followBack() {
    try {
      await followJob(`/api/track-jobs/${state.job.identifier}`, (told) => { state.job = told; drawStatus(); }, () => state.stopped);
    } catch (error) { state.failed = error; }
    state.job = null;
    if (state.stopped) return;
    state.frame = null;
    await loadRuns().catch(complain);
    drawStatus();
    showNewest();
    way.refresh().catch(complain);
  }

  async function begin(event) {
    event?.preventDefault();
    const values = Object.fromEntries([...form.querySelectorAll("[name]")].map((input) => [input.name, input.value.trim()]));
    state.failed = null;
    try {
      const settings = Number(values.evaluations) ? await fetchJson(`/api/evaluations?tracker=${values.tracker}&evaluations=${values.evaluations}`) : {};
      const made = await post(`${here}/runs`, { tracker: values.tracker, weighting: values.weighting, first: Number(values.first), last: Number(values.last) + 1, settings, despite_findings: Boolean(form.querySelector(".despite")?.checked) });
      fold.open = false;
      await loadRuns();
      await start(made.name);
      await way.refresh();
    } catch (error) { state.failed = error; drawFailure(); }
  }

  function drawFailure() {
    form.querySelector(".wrong")?.remove();
    if (state.failed) form.append(element("p", { className: "wrong", role: "alert" }, state.failed.message, element("span", { className: "hint", textContent: ` ${state.failed.hint ?? ""}` })));
  }

  /** What the footage says against the calibration, and the consent to track all the same. */
  function doubtLines() {
    const { doubts } = way.detail;
    if (!doubts.length) return [];
    return [element("p", { className: "notice", textContent: `The footage speaks against the calibration. ${doubts[0]}` }),
      element("label", { className: "check" }, element("input", { type: "checkbox", className: "despite" }), "track all the same")];
  }

  async function drawForm() {
    state.choices = await fetchJson("/api/choices");
    const last = way.detail.frame_count - 1;
    const plain = state.choices.trackers.filter((one) => !one.needs_behaviour);
    const select = (name, options, value) => element("select", { name }, ...options.map(([key, words]) => new Option(words, key, false, key === value)));
    const submit = element("button", { type: "submit", className: "primary", textContent: newest() ? "Track anew" : "Track" });
    const tracker = select("tracker", plain.map((one) => [one.name, one.label]), way.detail.tracker);
    const weighting = select("weighting", state.choices.weightings.map((one) => [one.name, one.label]), state.weighting ?? way.detail.weighting);
    weighting.onchange = () => { state.weighting = weighting.value; };
    form.replaceChildren(
      element("label", {}, "Tracker", tracker),
      element("label", {}, "Poses are judged by", weighting),
      element("p", { className: "hint", textContent: "Edges and silhouette suit a room that is full of things: edges inside the masks are often the room's." }),
      element("label", {}, "Effort", select("evaluations", EFFORTS, 2000)),
      element("div", { className: "step-row" }, element("label", {}, "First frame", element("input", { name: "first", type: "number", min: 0, max: last, value: way.detail.start_pose_frame })),
        element("label", {}, "Last frame", element("input", { name: "last", type: "number", min: 0, max: last, value: last }))),
      way.detail.start_pose_frame > 0 ? element("p", { className: "hint", textContent: `The start pose is of frame ${way.detail.start_pose_frame}: tracking begins there. The frames before it can be tracked backwards afterwards.` }) : "",
      !way.detail.has_start_pose ? element("p", { className: "hint", textContent: "There is no start pose yet: it is looked for in the first frame, which takes a while." }) : "",
      ...doubtLines(),
      element("div", { className: "step-actions" }, submit));
    form.onsubmit = async (event) => {
      event.preventDefault();
      submit.disabled = true;
      try { await begin(); } finally { submit.disabled = false; }
    };
  }

  async function showNewest() {
    const run = newest();
    if (!run?.done && !isBusy()) return wall.empty("The outlines will be drawn over the pictures as they are found.");
    const frame = state.frame ?? Math.max(run.first, run.tracked_to - 1);
    wall.show({ run: run.name, frame, show: "outline" });
  }

  way.on("state", async (event) => {
    const before = state.work?.state;
    state.work = event;
    if (BUSY.includes(before) && !BUSY.includes(event.state)) { await loadRuns().catch(complain); showNewest(); way.refresh().catch(() => {}); }
    if (!state.stopped) drawStatus();
  });
  way.on("frame", (event) => {
    if (!newest() || event.run !== newest().name || event.reannealed) return;
    state.frame = event.frame;
    if (performance.now() - state.shownAt < PICTURE_MILLISECONDS) return;
    state.shownAt = performance.now();
    showNewest();
  });

  async function poll() {
    if (state.stopped) return;
    try {
      const told = await fetchJson("/api/worker");
      const was = isBusy();
      state.work = told;
      if (was || isBusy()) drawStatus();
    } catch { /* the next one may answer */ }
    if (!state.stopped) state.timer = setTimeout(poll, POLL_MILLISECONDS);
  }

  drawForm().then(poll).catch(complain);
  drawStatus();
  showNewest();
  return () => { state.stopped = true; clearTimeout(state.timer); wall.stop(); };
}
