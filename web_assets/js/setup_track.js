// Step Track: the short form of a run, how far it is, and the outlines over the pictures as they
// are found.

import { fetchJson, post, remove, runPath, sessionPath } from "./api.js";
import { dotted, duration, partWords } from "./elements.js";
import { listen } from "./events.js";
import { findJob, followJob, isGoing, timeLeft } from "./jobs.js";
import { complain } from "./messages.js";
import { studioPath } from "./sessions.js";
import { ViewWall } from "./setup_views.js";
import {
  attempting,
  html,
  into,
  signal,
  useEffect,
  useLayoutEffect,
  useRef,
  useState,
} from "./studio/component.js";
import { valuesOf } from "./studio/dialogs.js";
import { Action, Failure, Progress, Select } from "./studio/parts.js";
import { isBusy } from "./work_states.js";

/** @import { Schemas } from "./api_types" */
/** @import { Work } from "./work_states.js" */

const PICTURE_MILLISECONDS = 700;
/** @type {[string, string][]} */
const EFFORTS = [
  ["1000", "quick · 1000 poses a frame"],
  ["2000", "usual · 2000 poses a frame"],
  ["5000", "thorough · 5000 poses a frame"],
  ["0", "as the settings say"],
];

export const load = (/** @type {string} */ _session) =>
  Promise.all([fetchJson("/api/choices"), fetchJson("/api/worker")]);

/**
 * What the step knows, and what can be done.
 * @param {import("./setup.js").Setup} setup
 * @param {Awaited<ReturnType<typeof load>>} loaded
 */
export function modelOf(setup, [choices, state]) {
  const here = sessionPath(setup.session);
  const runs = signal(setup.detail.runs);
  /** What the tracking process said last. */
  const work = signal(/** @type {Work} */ ({ type: "state", ...state }));
  /** Whether a run is being made, which takes a while: nothing is said of it meanwhile. */
  const isStarting = signal(false);
  /** Whether it said something since. */
  let isHeard = false;
  /** What is tracked backwards. */
  const job = signal(/** @type {any} */ (null));
  const failed = signal(/** @type {any} */ (null));
  const attempt = attempting(failed);
  const isStale = () => setup.step?.state === "stale";
  const isFormOpen = signal(!setup.detail.runs.length || isStale());
  /** What the wall shows. */
  const shown = signal(/** @type {{ run: string, frame: number } | null} */ (null));
  /** The frame that was found last, of which run. */
  let latest = shown.value;
  let shownAt = 0;
  let isLeft = false;

  const newest = () => runs.value[0] ?? null;
  const isHere = () =>
    work.value.session === setup.session && work.value.run === runs.value[0]?.name;
  const isTracked = () => isHere() && isBusy(work.value);

  function showNewest() {
    const run = newest();
    if (!run?.done && !isTracked()) shown.value = null;
    else if (latest?.run === run.name) shown.value = latest;
    else shown.value = { run: run.name, frame: Math.max(run.first, run.tracked_to - 1) };
  }

  async function loadRuns() {
    runs.value = (await fetchJson(here)).runs;
  }

  /** The run has ended: how far it came. */
  async function end() {
    await loadRuns().catch(complain);
    if (isLeft) return;
    showNewest();
    setup.refresh().catch(complain);
  }

  /** @param {Work} state */
  function take(state) {
    const isOurs = (/** @type {Work} */ one) => one.session === setup.session && isBusy(one);
    const wasOurs = isOurs(work.value);
    isHeard = true;
    work.value = state;
    if (wasOurs && !isOurs(state)) end();
  }

  const stopListening = listen("state", take);
  setup.on("frame", (event) => {
    if (event.run !== newest()?.name || event.reannealed) return;
    latest = { run: event.run, frame: event.frame };
    if (performance.now() - shownAt < PICTURE_MILLISECONDS) return;
    shownAt = performance.now();
    showNewest();
  });

  /** @param {string} run */
  const start = (run) =>
    attempt(async () => {
      await post(`${runPath(setup.session, run)}/start`);
      isHeard = true;
      const begun = { session: setup.session, run, state: "compiling" };
      work.value = /** @type {any} */ ({ ...begun, frame: 0, first: 0, last: 1, done: 0 });
    });

  /** Follow what is tracked backwards to its end. @param {any} begun */
  async function followBack(begun) {
    await attempt(async () => {
      job.value = await begun;
      await followJob(`/api/track-jobs/${job.value.identifier}`, into(job), () => isLeft);
    });
    job.value = null;
    if (!isLeft) await end();
  }

  /** What the tracking process said before it was listened to. */
  async function ask() {
    const now = await fetchJson("/api/worker");
    if (!isHeard) take({ type: "state", ...now });
  }

  /** What was begun before this step was shown goes on to be followed. */
  async function findAgain() {
    const which = { session: setup.session, kind: "track" };
    const known = await findJob(which, (line) => line.verb === "correct");
    if (!isLeft && !job.value && isGoing(known)) await followBack(known);
  }

  showNewest();
  ask().then(findAgain).catch(complain);

  return {
    setup,
    choices,
    work,
    job,
    isStarting,
    failed,
    isFormOpen,
    shown,
    newest,
    isHere,
    isTracked,
    isStale,
    start,
    cancel: () => post(`${runPath(setup.session, newest().name)}/cancel`).catch(complain),
    /** The frames before the first one, tracked backwards from it into a new run. */
    goBack: () => {
      const { name, first } = newest();
      const request = { frame: first, track: "raw", back_to: 0 };
      return followBack(post(`${runPath(setup.session, name)}/correct`, request));
    },
    /** Make a run as the form has it, and track it. @param {Record<string, any>} values */
    begin: async (values) => {
      isStarting.value = true;
      try {
        const { tracker, weighting, evaluations } = values;
        const settings = Number(evaluations)
          ? await fetchJson(`/api/evaluations?tracker=${tracker}&evaluations=${evaluations}`)
          : {};
        const made = await post(`${here}/runs`, {
          tracker,
          weighting,
          first: Number(values.first),
          last: Number(values.last) + 1,
          settings,
          allow_inconsistent: Boolean(values.inconsistent),
        });
        isFormOpen.value = false;
        await loadRuns();
        await start(made.name);
      } finally {
        isStarting.value = false;
      }
      await setup.refresh();
    },
    stop: () => {
      isLeft = true;
      stopListening();
    },
  };
}

/** @typedef {ReturnType<typeof modelOf>} Model */

/** @param {Work} work */
const workWords = (work) =>
  work.state === "compiling"
    ? "compiling the kernels, once"
    : dotted(
        `${work.state} frame ${work.frame} of ${work.first}–${work.last - 1}`,
        work.frames_per_second && `${work.frames_per_second.toPrecision(2)} a second`,
        work.seconds_left != null && `${duration(work.seconds_left)} left`,
      );

/** @param {Model} model */
const startingWords = (model) =>
  model.setup.detail.has_start_pose
    ? "starting… the body's shape is fitted to the first frames, which takes up to a minute"
    : "starting… a start pose is searched for, and the body's shape fitted, which takes some minutes";

/** What is being done, as `Progress` takes it; null where nothing is. @param {Model} model */
function doingOf(model) {
  const [job, work] = [model.job.value, model.work.value];
  if (job)
    return {
      words: dotted(
        `tracking backwards${job.total ? `, ${job.done} of ${job.total} frames` : ""}`,
        timeLeft(job.seconds_left),
      ),
      share: job.total ? job.done / job.total : 0,
      cancel: () => remove(`/api/track-jobs/${job.identifier}`).catch(complain),
    };
  if (model.isStarting.value) return { words: startingWords(model), share: 0 };
  if (!model.isTracked()) return null;
  const share = work.last > work.first ? work.done / (work.last - work.first) : 0;
  return { words: workWords(work), share, cancel: model.cancel };
}

/** The newest run: how far it is, and what can be done with it. @param {{ model: Model }} properties */
function Status({ model }) {
  const run = model.newest();
  const doing = doingOf(model);
  if (doing) return html`<section class="track-status"><${Progress} ...${doing} /></section>`;
  if (!run) return null;
  const work = model.work.value;
  const count = run.last - run.first;
  const isStale = model.isStale();
  const from = run.first > 0 && ` (from frame ${run.first} on)`;
  const backwards =
    `The run begins in frame ${run.first}. The frames before it are tracked backwards from there, ` +
    `into a new run; ${run.name} stays.`;
  const truth =
    run.mean_mm != null &&
    `, ${run.mean_mm.toPrecision(3)} mm from the truth${partWords(run.measured_frames, run.done)}`;
  const isFailed = model.isHere() && ["failed", "lost"].includes(work.state);
  return html`<section class="track-status">
    <p>${run.name}: ${run.done} of ${count} frames${from}, ${run.describe}${truth}.</p>
    <${Failure} error=${isFailed ? work : model.failed.value} />
    <div class="step-actions">
      ${
        run.done < count &&
        !isStale &&
        html`<${Action} kind="primary" act=${() => model.start(run.name)}>
          ${run.done ? "Track on" : "Track"}
        </${Action}>`
      }
      ${
        run.done > 0 &&
        run.first > 0 &&
        !isStale &&
        html`<${Action} act=${model.goBack} title=${backwards}>
          Track back to frame 0
        </${Action}>`
      }
      <a class="download" href=${studioPath(model.setup.session, run.name)}>Open in the studio</a>
    </div>
  </section>`;
}

/**
 * The fields of a run.
 * @param {{ detail: import("./setup.js").Setup["detail"], choices: Schemas["Choices"] }} properties
 */
function Fields({ detail, choices }) {
  const { start_pose_frame: first, frame_count: count, has_start_pose: isKnown, doubts } = detail;
  /** @returns {[string, string][]} */
  const named = (entries) => entries.map((one) => [one.name, one.label]);
  const trackers = named(choices.trackers.filter((one) => !one.needs_behaviour));
  const likelihoods = named(choices.weightings);
  const frame = (/** @type {string} */ name, /** @type {number} */ value) =>
    html`<input type="number" name=${name} min="0" max=${count - 1} step="1" defaultValue=${value} />`;
  return html`
    <${Select} label="Tracker" name="tracker" options=${trackers} value=${detail.tracker} />
    <${Select} label="Likelihood" name="weighting" options=${likelihoods} value=${detail.weighting} />
    <p class="hint">
      Edges and silhouette suit a cluttered room, where edges inside the masks are often the room's.
    </p>
    <${Select} label="Effort" name="evaluations" options=${EFFORTS} value="2000" />
    <div class="step-row">
      <label>First frame${frame("first", first)}</label>
      <label>Last frame${frame("last", count - 1)}</label>
    </div>
    ${
      first > 0 &&
      html`<p class="hint">
        The start pose is of frame ${first}: tracking begins there. The frames before it can be
        tracked backwards afterwards.
      </p>`
    }
    ${
      !isKnown &&
      html`<p class="hint">
        There is no start pose yet: the first frame is searched for one, which takes a while.
      </p>`
    }
    ${
      doubts.length > 0 &&
      html`<p class="notice">The footage contradicts the calibration. ${doubts[0]}</p>
        <label class="check">
          <input type="checkbox" name="inconsistent" class="inconsistent" />track all the same
        </label>`
    }
  `;
}

/** The form of a run, folded away where there is one. @param {{ model: Model }} properties */
function RunForm({ model }) {
  const [isSent, setSent] = useState(false);
  const [wrong, setWrong] = useState(/** @type {any} */ (null));
  const form = useRef(/** @type {HTMLFormElement | null} */ (null));
  const alert = useRef(/** @type {HTMLElement | null} */ (null));
  useEffect(() => alert.current?.scrollIntoView({ block: "nearest" }), [wrong]);
  const send = async (event) => {
    event.preventDefault();
    setSent(true);
    setWrong(null);
    await model.begin(valuesOf(event.currentTarget)).catch(setWrong);
    setSent(false);
  };
  const isFirst = !model.newest();
  // "Yes, track all frames from here": the run that waits, else a new one as the form has it.
  useLayoutEffect(() => {
    if (!model.setup.asked.begin || model.isTracked()) return;
    const [run, first] = [model.newest(), model.setup.detail.start_pose_frame];
    if (run && !run.done && run.first === first && !model.isStale()) model.start(run.name);
    else form.current?.requestSubmit();
  }, []);
  return html`<details
    class=${isFirst ? "alone" : ""}
    open=${isFirst || model.isFormOpen.value}
    onToggle=${({ currentTarget }) => into(model.isFormOpen)(currentTarget.open)}
  >
    <summary>Track again</summary>
    <form ref=${form} class="footage-form" onSubmit=${send}>
      <${Fields} detail=${model.setup.detail} choices=${model.choices} />
      <div class="step-actions">
        <button type="submit" class="primary" disabled=${isSent}>
          ${isSent ? "Starting…" : isFirst ? "Track" : "Track again"}
        </button>
      </div>
      <div class="optional" ref=${alert}><${Failure} error=${wrong} /></div>
    </form>
  </details>`;
}

/** @param {{ model: Model }} properties */
export const Panel = ({ model }) => html`
  <${Status} model=${model} />
  <${RunForm} model=${model} />
`;

/** @param {{ model: Model }} properties */
export const Beside = ({ model }) => html`<${ViewWall}
  setup=${model.setup}
  shown=${model.shown.value}
  words="The outlines will be drawn over the pictures as they are found."
/>`;
