// Step Start pose: found automatically with its confidence, checked in all views (left and right by
// colour), corrected by hand in the scene or by a turn, made better by a short search.

import { fault, fetchJson, post, put, remove, sessionPath } from "./api.js";
import { percent } from "./elements.js";
import { findJob, followJob, isGoing, progressOf } from "./jobs.js";
import { complain } from "./messages.js";
import { SceneFrame } from "./setup_views.js";
import { attempting, html, into, signal, useEffect, useState } from "./studio/component.js";
import { opensLarge } from "./studio/dialogs.js";
import { Action, Failure, Progress } from "./studio/parts.js";
import { foundWords } from "./studio/start_pose.js";

const PICTURE_HEIGHT = 360;
const REDRAW_MILLISECONDS = 250;
const SEARCHES = "/api/initialisations";
const REFINEMENTS = "/api/track-jobs";

/** @param {string} session */
export const load = (session) => fetchJson(`${sessionPath(session)}/start-pose`);

const isSame = (one, other) =>
  one?.length === other.length && one.every((value, at) => Math.abs(value - other[at]) < 1e-6);

/**
 * What the step knows, and what can be done.
 * @param {import("./setup.js").Setup} setup
 * @param {Awaited<ReturnType<typeof load>>} loaded
 */
export function modelOf(setup, loaded) {
  const here = sessionPath(setup.session);
  const last = Math.max(0, (setup.detail.frame_count ?? 1) - 1);
  const pose = signal(loaded);
  const frame = signal(Math.min(last, setup.detail.start_pose_frame ?? 0));
  /** What the automatic search found. */
  const found = signal(/** @type {any} */ (null));
  /** What the search around the pose found. */
  const better = signal(/** @type {any} */ (null));
  const failed = signal(/** @type {any} */ (null));
  const attempt = attempting(failed);
  const progress = signal(/** @type {Parameters<typeof Progress>[0] | null} */ (null));
  const isBusy = signal(false);
  const isEditing = signal(false);
  /** Rises when the pose may be another. */
  const age = signal(0);
  let isBegun = false; // whether the scene lets it be edited already
  let isLeft = false;

  async function reload() {
    try {
      const again = await load(setup.session);
      if (isLeft) return;
      pose.value = again;
      age.value += 1;
    } catch (error) {
      failed.value = error;
    }
    setup.refresh().catch(complain);
  }

  /** Do something that takes a while. @param {() => Promise<any>} work */
  async function during(work) {
    isBusy.value = true;
    await attempt(work);
    isBusy.value = false;
    if (!isLeft) await reload();
  }

  /**
   * Wait for a job of the background; what it found, null where it was cancelled. The job goes on
   * when the step is left, and is found again when it is shown.
   * @param {string} jobs
   * @param {any} job
   * @param {string} words
   */
  async function waitFor(jobs, { identifier }, words) {
    const cancel = () => remove(`${jobs}/${identifier}`).catch(complain);
    try {
      const report = (/** @type {any} */ job) => into(progress)(progressOf(job, words, cancel));
      const ended = await followJob(`${jobs}/${identifier}`, report, () => isLeft);
      return ended?.state === "done" ? ended : null;
    } finally {
      progress.value = null;
    }
  }

  const waitForFind = async (/** @type {any} */ job) => {
    found.value = (await waitFor(SEARCHES, job, "looking at the frame")) ?? found.value;
  };
  const waitForRefine = async (/** @type {any} */ job) => {
    better.value = (await waitFor(REFINEMENTS, job, "searching around the pose")) ?? better.value;
  };

  /**
   * What was begun before this step was shown: a search that is under way is followed, what the
   * last one found is said.
   */
  async function findAgain() {
    const [search, refinement] = await Promise.all([
      findJob({ session: setup.session, kind: "initialise" }),
      findJob(
        { session: setup.session, kind: "track" },
        (line) => line.verb === "pose" && !line.run,
      ),
    ]);
    if (isLeft || isBusy.value) return undefined;
    if (isGoing(search)) return during(() => waitForFind(search));
    if (isGoing(refinement)) return during(() => waitForRefine(refinement));
    const isStored = (/** @type {any} */ job) =>
      job?.state === "done" && pose.value.stored && isSame(job.pose, pose.value.pose);
    if (isStored(search)) found.value = search;
    if (isStored(refinement)) better.value = refinement;
    if (search?.state === "failed") failed.value = search;
    return undefined;
  }

  /** @param {any} values */
  async function keep(values) {
    await put(`${here}/start-pose`, { pose: values, frame: frame.value });
    found.value = null;
  }

  // The editor may be left in the scene itself.
  setup.on("scene", (event) => {
    if (!isEditing.value) return;
    if (event.editing) isBegun = true;
    else if (isBegun) {
      isEditing.value = isBegun = false;
      reload();
    }
  });
  findAgain().catch(complain);

  return {
    setup,
    here,
    last,
    pose,
    frame,
    found,
    better,
    failed,
    progress,
    isBusy,
    isEditing,
    age,
    find: () =>
      during(async () => {
        better.value = null;
        const request = { frame: frame.value, replace: true };
        await waitForFind(await post(`${here}/initialise`, request));
      }),
    refine: () =>
      during(async () => {
        const request = { frame: frame.value, pose: pose.value.pose, keep: true };
        await waitForRefine(await post(`${here}/pose/refine`, request));
      }),
    /** Go on with the pose as it is: where it was in doubt, it is so no longer. */
    confirm: () =>
      attempt(async () => {
        if (setup.step?.state === "done" && setup.step.why) {
          await put(`${here}/start-pose`, { pose: pose.value.pose, frame: pose.value.frame });
          await setup.refresh();
        }
        await setup.go("track", { begin: true });
      }),
    /** @param {"turned round" | "in place"} how */
    exchange: (how) =>
      during(async () => {
        const request = { pose: pose.value.pose, how };
        await keep((await post(`${here}/pose/mirror`, request)).pose);
      }),
    edit: () =>
      attempt(async () => {
        isEditing.value = true;
        isBegun = false;
        const shown = { session: setup.session, frame: frame.value };
        try {
          await post("/api/scene/show", shown);
          await post("/api/scene/edit", shown);
        } catch (error) {
          isEditing.value = false;
          throw error;
        }
      }),
    /** End the editing. @param {boolean} isKept */
    leave: async (isKept) => {
      await attempt(async () => {
        if (isKept) {
          const edited = await fetchJson("/api/scene/edit");
          if (!edited.editing)
            throw fault("The editing was ended in the scene.", "Edit by hand again.");
          await keep(edited.pose);
        }
        isEditing.value = false;
        await remove("/api/scene/edit");
      });
      await reload();
    },
    stop: () => {
      isLeft = true;
      if (isEditing.value) remove("/api/scene/edit").catch(() => {});
    },
  };
}

/** @typedef {ReturnType<typeof modelOf>} Model */

/** Which frame, and what finds or edits its pose. @param {{ model: Model }} properties */
function Make({ model }) {
  const isBusy = model.isBusy.value;
  const choose = ({ target }) => {
    if (target.checkValidity() && target.value !== "") model.frame.value = Number(target.value);
  };
  return html`<section class="start-pose-make">
    <label>
      In frame
      <input
        type="number"
        min="0"
        max=${model.last}
        step="1"
        aria-label="Frame"
        value=${model.frame.value}
        disabled=${isBusy}
        onInput=${choose}
      />
    </label>
    <p class="hint">
      The frame in which tracking begins: the whole subject in view, limbs away from the trunk if
      you can choose. Frames before it can be tracked backwards from it.
    </p>
    ${
      model.isEditing.value
        ? html`<${Editing} model=${model} />`
        : html`<div class="step-actions">
            <${Action}
              kind=${model.pose.value.stored ? "" : "primary"}
              act=${model.find}
              disabled=${isBusy}
            >
              Find it automatically
            </${Action}>
            <${Action} act=${model.edit} disabled=${isBusy}>Edit by hand</${Action}>
          </div>`
    }
    <${Failure} error=${model.failed.value} />
  </section>`;
}

/** @param {{ model: Model }} properties */
const Editing = ({ model }) => html`<div class="step-place">
  <p>
    Drag the balls on the limbs: the body follows, its joints keep their limits. The rings turn the
    whole body; the tab Pose has a slider for every angle, undo and a local search.
  </p>
  <div class="step-actions">
    <${Action} kind="primary" act=${() => model.leave(true)}>Use this pose</${Action}>
    <${Action} kind="quiet" act=${() => model.leave(false)}>Discard</${Action}>
  </div>
</div>`;

/** How sure the pose is, in words. @param {{ model: Model }} properties */
function Verdict({ model }) {
  const [found, better] = [model.found.value, model.better.value];
  const words = [
    found && `Found in frame ${found.frame}: ${foundWords(found)}.`,
    better &&
      (better.gain > 0 && better.overlap !== null
        ? `Improved: overlap with the masks ${percent(better.overlap_before)} → ${percent(better.overlap)}.`
        : "The search found no better pose near it."),
  ];
  return html`<div class="start-pose-verdict">
    <p class=${found?.unsure ? "notice" : ""}>
      ${
        words.filter(Boolean).join(" ") ||
        `The session has a start pose, of frame ${model.pose.value.frame}.`
      }
    </p>
    ${found?.note && html`<p class="notice">${found.note}</p>`}
  </div>`;
}

/** A pose of another frame than the chosen one. @param {{ model: Model }} properties */
function OfAnotherFrame({ model }) {
  const own = model.pose.value.frame;
  return html`
    <p class="notice">
      The start pose is of frame ${own}, where tracking begins. To begin in frame
      ${" "}${model.frame.value}, find or edit it here.
    </p>
    <div class="step-actions">
      <${Action} kind="small" act=${() => into(model.frame)(own)}>Show frame ${own}</${Action}>
    </div>
  `;
}

/** Whether left and right are so, and what mends them. @param {{ model: Model }} properties */
function Mending({ model }) {
  const hasSides = model.pose.value.has_sides;
  const act = (/** @type {string} */ words, /** @type {() => any} */ work, kind = "") =>
    html`<${Action} kind=${kind} act=${work} disabled=${model.isBusy.value}>${words}</${Action}>`;
  return html`
    ${
      hasSides &&
      html`<h2>Left and right</h2>
        <p class="side-check">
          <i class="side-swatch left"></i>the subject's left,${" "}
          <i class="side-swatch right"></i>the subject's right. Is it so in every picture?
        </p>`
    }
    <div class="step-actions">
      ${act("Yes, track all frames from here", model.confirm, "primary")}
      ${hasSides && act("No: facing the other way", () => model.exchange("turned round"))}
      ${hasSides && act("Mirror", () => model.exchange("in place"))}
      ${act("Refine from here", model.refine)}
    </div>
    <p class="hint">
      For some of the frames, or with other settings, go on to step Track below: its form has them.
    </p>
  `;
}

/** @param {{ model: Model }} properties */
export function Panel({ model }) {
  const pose = model.pose.value;
  const Next = model.frame.value === pose.frame ? Mending : OfAnotherFrame;
  return html`
    <${Make} model=${model} />
    ${model.progress.value && html`<${Progress} ...${model.progress.value} />`}
    ${
      pose.stored &&
      !model.isEditing.value &&
      html`<section class="start-pose-check">
        <${Verdict} model=${model} />
        <${Next} model=${model} />
      </section>`
    }
  `;
}

/**
 * A camera's picture; while another is drawn the one before it stays, and its caption says so.
 * @param {{ name: string, frame: number, words: string, address: string }} properties
 */
function PosePicture({ name, frame, words, address }) {
  const [drawn, setDrawn] = useState("");
  const isWaiting = drawn !== address;
  return html`<figure class=${isWaiting ? "picture redrawn" : "picture"}>
    <img
      alt=${`${name}, frame ${frame}${words}`}
      ...${opensLarge(`${name}, frame ${frame}${words}`)}
      loading="lazy"
      src=${address}
      onLoad=${() => setDrawn(address)}
      onError=${() => setDrawn(address)}
    />
    <figcaption>
      <b>${name}</b>
      <span>${isWaiting ? `frame ${frame} is being drawn…` : `frame ${frame}${words}`}</span>
    </figcaption>
  </figure>`;
}

/**
 * The pictures of all views, or the scene while it is edited. The start pose is drawn in its own
 * frame, in others the masks in which one would be searched for.
 * @param {{ model: Model }} properties
 */
export function Beside({ model }) {
  const frame = model.frame.value;
  const [pictured, setPictured] = useState(frame);
  useEffect(() => {
    const wait = setTimeout(() => setPictured(frame), REDRAW_MILLISECONDS);
    return () => clearTimeout(wait);
  }, [frame]);
  if (model.isEditing.value) return html`<${SceneFrame} />`;
  const { stored, frame: own } = model.pose.value;
  const isPosed = Boolean(stored) && pictured === own;
  const shown = isPosed ? "show=outline&pose=start" : "show=mask";
  const query = `${shown}&height=${PICTURE_HEIGHT}&age=${model.age.value}`;
  return html`<div class="pictures">
    ${model.setup.detail.cameras.map(
      ({ name }) =>
        html`<${PosePicture}
          key=${name}
          name=${name}
          frame=${pictured}
          words=${isPosed ? ", start pose" : ", masks"}
          address=${`${model.here}/frames/${pictured}/views/${encodeURIComponent(name)}.jpg?${query}`}
        />`,
    )}
  </div>`;
}
