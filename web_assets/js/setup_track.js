// Step Track: the short form of a run, how far it is, and the outlines over the pictures as they
// are found.

import { fetchJson, post, remove, runPath, sessionPath } from "./api.js";
import { valuesOf } from "./studio/dialogs.js";
import {
  actions,
  button,
  check,
  dotted,
  drawProgress,
  duration,
  element,
  failure,
  field,
  fill,
  hint,
  notice,
  number,
  optional,
  select,
  sends,
} from "./elements.js";
import { findJob, followJob, isGoing, timeLeft } from "./jobs.js";
import { complain } from "./messages.js";
import { studioPath } from "./sessions.js";
import { viewWall } from "./setup_views.js";
import { isBusy } from "./work_states.js";

const PICTURE_MILLISECONDS = 700;
const POLL_MILLISECONDS = 1500;
/** @type {[string, string][]} */
const EFFORTS = [
  ["1000", "quick · 1000 poses a frame"],
  ["2000", "usual · 2000 poses a frame"],
  ["5000", "thorough · 5000 poses a frame"],
  ["0", "as the settings say"],
];

/** @param {HTMLElement} place @param {import("./setup.js").Setup} setup */
export function mount(place, setup) {
  const here = sessionPath(setup.session);
  const status = element("section", { className: "track-status" });
  const form = element("form", { className: "footage-form" });
  const fold = element("details", {}, element("summary", {}, "Track again"), form);
  place.append(status, fold);
  let { runs } = setup.detail;
  let work = null; // the tracking process's last state
  let job = null; // what is tracked backwards
  let latest = null; // the frame that was found last
  let failed = null;
  let stopped = false;
  let timer = 0;
  let shownAt = 0;
  const wall = viewWall(setup);
  const newest = () => runs[0] ?? null;
  const path = () => runPath(setup.session, newest().name);
  const isHere = () =>
    work && newest() && work.session === setup.session && work.run === newest().name;
  const isTracked = () => isHere() && isBusy(work);

  async function loadRuns() {
    runs = (await fetchJson(here)).runs;
  }

  const workWords = () =>
    work.state === "compiling"
      ? "compiling the kernels, once"
      : dotted(
          `${work.state} frame ${work.frame} of ${work.first}–${work.last - 1}`,
          work.frames_per_second && `${work.frames_per_second.toPrecision(2)} a second`,
          work.seconds_left != null && `${duration(work.seconds_left)} left`,
        );

  function drawStatus() {
    const run = newest();
    fold.open = !run || fold.open;
    fold.classList.toggle("alone", !run);
    if (!run) return fill(status);
    if (job) {
      const { identifier, done, total, seconds_left: left } = job;
      return drawProgress(status, {
        words: dotted(
          `tracking backwards${total ? `, ${done} of ${total} frames` : ""}`,
          timeLeft(left),
        ),
        share: total ? done / total : 0,
        cancel: () => remove(`/api/track-jobs/${identifier}`).catch(complain),
      });
    }
    if (isTracked())
      return drawProgress(status, {
        words: workWords(),
        share: work.last > work.first ? work.done / (work.last - work.first) : 0,
        cancel: () => post(`${path()}/cancel`).catch(complain),
      });
    const stale = setup.step?.state === "stale";
    const complete = run.done >= run.last - run.first;
    const which = run.first > 0 ? ` (from frame ${run.first} on)` : "";
    fill(
      status,
      element(
        "p",
        {},
        `${run.name}: ${run.done} of ${run.last - run.first} frames${which}, ${run.describe}${run.mean_mm != null ? `, ${run.mean_mm.toPrecision(3)} mm from the truth` : ""}.`,
      ),
      failure(isHere() && ["failed", "lost"].includes(work.state) ? work : failed),
      actions(
        !complete &&
          !stale &&
          button(run.done ? "Track on" : "Track", () => start(run.name), "primary"),
        run.done > 0 &&
          run.first > 0 &&
          !stale &&
          button("Track back to frame 0", goBack, "", {
            title: `The run begins in frame ${run.first}. The frames before it are tracked backwards from there, into a new run; ${run.name} stays.`,
          }),
        element(
          "a",
          { className: "download", href: studioPath(setup.session, run.name) },
          "Open in the studio",
        ),
      ),
    );
    fold.open ||= stale;
  }

  async function start(name) {
    failed = null;
    try {
      await post(`${runPath(setup.session, name)}/start`);
      work = {
        session: setup.session,
        run: name,
        state: "compiling",
        frame: 0,
        first: 0,
        last: 1,
        done: 0,
      };
    } catch (error) {
      failed = error;
    }
    drawStatus();
  }

  /** The frames before the first one, tracked backwards from it into a new run. */
  async function goBack() {
    failed = null;
    try {
      job = await post(`${path()}/correct`, { frame: newest().first, track: "raw", back_to: 0 });
    } catch (error) {
      failed = error;
      return drawStatus();
    }
    await followBack();
  }

  async function followBack() {
    drawStatus();
    try {
      await followJob(
        `/api/track-jobs/${job.identifier}`,
        (state) => {
          job = state;
          drawStatus();
        },
        () => stopped,
      );
    } catch (error) {
      failed = error;
    }
    job = null;
    if (stopped) return;
    latest = null;
    await loadRuns().catch(complain);
    drawStatus();
    showNewest();
    setup.refresh().catch(complain);
  }

  async function begin() {
    const values = valuesOf(form);
    const settings = Number(values.evaluations)
      ? await fetchJson(
          `/api/evaluations?tracker=${values.tracker}&evaluations=${values.evaluations}`,
        )
      : {};
    const made = await post(`${here}/runs`, {
      tracker: values.tracker,
      weighting: values.weighting,
      first: Number(values.first),
      last: Number(values.last) + 1,
      settings,
      allow_inconsistent: Boolean(values.inconsistent),
    });
    fold.open = false;
    await loadRuns();
    await start(made.name);
    await setup.refresh();
  }

  async function drawForm() {
    const { trackers, weightings } = await fetchJson("/api/choices");
    const {
      start_pose_frame: first,
      frame_count: count,
      has_start_pose: known,
      doubts,
    } = setup.detail;
    /** @returns {[string, string][]} */
    const named = (entries) => entries.map((one) => [one.name, one.label]);
    const submit = element(
      "button",
      { type: "submit", className: "primary" },
      newest() ? "Track again" : "Track",
    );
    const wrong = optional();
    fill(
      form,
      field(
        "Tracker",
        select(named(trackers.filter((one) => !one.needs_behaviour)), setup.detail.tracker, {
          name: "tracker",
        }),
      ),
      field("Likelihood", select(named(weightings), setup.detail.weighting, { name: "weighting" })),
      hint(
        "Edges and silhouette suit a cluttered room, where edges inside the masks are often the room's.",
      ),
      field("Effort", select(EFFORTS, "2000", { name: "evaluations" })),
      element(
        "div",
        { className: "step-row" },
        field("First frame", number(first, { name: "first", max: count - 1, step: 1 })),
        field("Last frame", number(count - 1, { name: "last", max: count - 1, step: 1 })),
      ),
      first > 0 &&
        hint(
          `The start pose is of frame ${first}: tracking begins there. The frames before it can be tracked backwards afterwards.`,
        ),
      !known &&
        hint(
          "There is no start pose yet: the first frame is searched for one, which takes a while.",
        ),
      doubts.length > 0 && [
        notice(`The footage contradicts the calibration. ${doubts[0]}`),
        check("track all the same", { name: "inconsistent", className: "inconsistent" }),
      ],
      actions(submit),
      wrong,
    );
    sends(form, submit, wrong, begin);
  }

  function showNewest() {
    const run = newest();
    if (!run?.done && !isTracked())
      return wall.empty("The outlines will be drawn over the pictures as they are found.");
    wall.show({
      run: run.name,
      frame: latest ?? Math.max(run.first, run.tracked_to - 1),
      show: "outline",
    });
  }

  setup.on("state", async (event) => {
    const wasBusy = isBusy(work);
    work = event;
    if (wasBusy && !isBusy(event)) {
      await loadRuns().catch(complain);
      showNewest();
      setup.refresh().catch(() => {});
    }
    if (!stopped) drawStatus();
  });
  setup.on("frame", (event) => {
    if (!newest() || event.run !== newest().name || event.reannealed) return;
    latest = event.frame;
    if (performance.now() - shownAt < PICTURE_MILLISECONDS) return;
    shownAt = performance.now();
    showNewest();
  });

  async function poll() {
    if (stopped) return;
    const was = isTracked();
    work = await fetchJson("/api/worker").catch(() => work);
    if (stopped) return;
    if (was || isTracked()) drawStatus();
    timer = setTimeout(poll, POLL_MILLISECONDS);
  }

  /** What was begun before this step was shown goes on to be followed. */
  async function findAgain() {
    const known = await findJob(
      { session: setup.session, kind: "track" },
      (line) => line.verb === "correct",
    );
    if (stopped || job || !isGoing(known)) return;
    job = known;
    await followBack();
  }

  /** "Yes, track from here": the run that waits, else a new one as the form has it. */
  async function trackNow() {
    const run = newest();
    if (
      run &&
      !run.done &&
      run.first === setup.detail.start_pose_frame &&
      setup.step?.state !== "stale"
    )
      return start(run.name);
    return form.requestSubmit();
  }

  drawForm()
    .then(() => {
      if (setup.asked.begin && !isTracked()) return trackNow();
      return findAgain();
    })
    .then(poll)
    .catch(complain);
  drawStatus();
  showNewest();
  return () => {
    stopped = true;
    clearTimeout(timer);
    wall.stop();
  };
}
