// Step Start pose: found automatically with its confidence, checked in all views (left and right by
// colour), corrected by hand in the scene or by a turn, made better by a short search.

import { fault, fetchJson, post, put, remove, sessionPath } from "./api.js";
import {
  actions,
  button,
  drawProgress,
  element,
  failure,
  field,
  fill,
  hint,
  notice,
  number,
  percent,
  picture,
} from "./elements.js";
import { findJob, followJob, isGoing, progressOf } from "./jobs.js";
import { complain } from "./messages.js";
import { foundWords, isUnsure } from "./studio/start_pose.js";

const PICTURE_HEIGHT = 360;
const REDRAW_MILLISECONDS = 250;

/** @param {string} session */
export const load = (session) => fetchJson(`${sessionPath(session)}/start-pose`);

/** @type {import("./setup.js").Mount<typeof load>} */
export function mount(place, setup, loaded) {
  const here = sessionPath(setup.session);
  const last = Math.max(0, (setup.detail.frame_count ?? 1) - 1);
  let pose = loaded;
  let frame = Math.min(last, setup.detail.start_pose_frame ?? 0);
  let found = null; // what the automatic search found
  let better = null; // what the search around the pose found
  let failed = null;
  let editing = false;
  let begun = false; // whether the scene lets it be edited already
  let going = false;
  let gone = false;
  let age = 0;
  let timer = 0;
  const steps = element("section", { className: "start-pose-make" });
  const progress = element("div", { className: "start-pose-progress" });
  const verdicts = element("section", { className: "start-pose-check" });
  place.append(steps, progress, verdicts);

  /**
   * Wait for a job of the background, its bar drawn meanwhile; what it found.
   * @param {string} jobs
   * @param {{ identifier?: string }} job
   */
  async function waited(jobs, { identifier }, words) {
    const cancel = () => remove(`${jobs}/${identifier}`).catch(complain);
    try {
      // The job goes on when the step is left, and is found again when it is shown.
      const ended = await followJob(
        `${jobs}/${identifier}`,
        (job) => drawProgress(progress, progressOf(job, words, cancel)),
        () => gone,
      );
      return ended?.state === "done" ? ended : null;
    } finally {
      drawProgress(progress, null);
    }
  }

  /** Do something that takes a while; its error is shown in place. */
  async function during(work) {
    failed = null;
    going = true;
    draw();
    try {
      await work();
    } catch (error) {
      failed = error;
    }
    going = false;
    if (gone) return;
    await loadAgain();
    setup.refresh().catch(complain);
  }

  const SEARCHES = "/api/initialisations",
    REFINEMENTS = "/api/track-jobs";

  const find = () =>
    during(async () => {
      better = null;
      await waitForFind(await post(`${here}/initialise`, { frame, replace: true }));
    });
  const waitForFind = async (job) => {
    found = (await waited(SEARCHES, job, "looking at the frame")) ?? found;
  };

  const refine = () =>
    during(async () => {
      await waitForRefine(
        await post(`${here}/pose/refine`, { frame, pose: pose.pose, keep: true }),
      );
    });
  const waitForRefine = async (job) => {
    better = (await waited(REFINEMENTS, job, "searching around the pose")) ?? better;
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
    if (gone || going) return;
    if (isGoing(search)) return during(() => waitForFind(search));
    if (isGoing(refinement)) return during(() => waitForRefine(refinement));
    const isStored = (job) => job?.state === "done" && pose.stored && isSame(job.pose, pose.pose);
    if (isStored(search)) found = search;
    if (isStored(refinement)) better = refinement;
    if (search?.state === "failed") failed = search;
    draw();
  }
  const isSame = (one, other) =>
    one?.length === other.length && one.every((value, at) => Math.abs(value - other[at]) < 1e-6);

  const keep = (values) => put(`${here}/start-pose`, { pose: values, frame });
  /** @param {"turned round" | "in place"} how */
  const exchange = (how) =>
    during(async () => {
      await keep((await post(`${here}/pose/mirror`, { pose: pose.pose, how })).pose);
      found = null;
    });

  async function edit() {
    failed = null;
    try {
      await setup.scene({ frame });
      await post("/api/scene/edit", { session: setup.session, frame });
      editing = true;
      begun = false;
    } catch (error) {
      failed = error;
    }
    draw();
  }

  async function leave(kept) {
    try {
      if (kept) {
        const edited = await fetchJson("/api/scene/edit");
        if (!edited.editing)
          throw fault("The editing was ended in the scene.", "Edit by hand again.");
        await keep(edited.pose);
        found = null;
      }
      editing = false;
      await remove("/api/scene/edit");
    } catch (error) {
      failed = error;
    }
    await loadAgain();
    setup.refresh().catch(complain);
  }

  // The panel.

  function draw() {
    const which = number(frame, { max: last, step: 1, ariaLabel: "Frame", disabled: going });
    which.onchange = () => {
      if (!which.checkValidity() || which.value === "") return;
      frame = Number(which.value);
      drawVerdicts();
      drawPictures();
    };
    const disabled = going || editing;
    fill(
      steps,
      field("In frame", which),
      hint(
        "The frame in which tracking begins: the whole subject in view, limbs away from the trunk if you can choose. Frames before it can be tracked backwards from it.",
      ),
      editing
        ? editingBox()
        : actions(
            button("Find it automatically", find, pose.stored ? "" : "primary", { disabled }),
            button("Edit by hand", edit, "", { disabled }),
          ),
      failure(failed),
    );
    drawVerdicts();
    if (!editing) drawPictures();
  }

  function drawVerdicts() {
    fill(verdicts, pose.stored && !editing && [verdict(), ...mending()]);
  }

  const editingBox = () =>
    element(
      "div",
      { className: "step-place" },
      element(
        "p",
        {},
        "Drag the balls on the limbs: the body follows, its joints keep their limits. The rings turn the whole body; the tab Pose has a slider for every angle, undo and a local search.",
      ),
      actions(
        button("Use this pose", () => leave(true), "primary"),
        button("Discard", () => leave(false), "quiet"),
      ),
    );

  /** How sure the pose is, in words. */
  function verdict() {
    const words = [
      found && `Found in frame ${found.frame}: ${foundWords(found)}.`,
      better &&
        (better.gain > 0 && better.overlap !== null
          ? `Improved: overlap with the masks ${percent(better.overlap_before)} → ${percent(better.overlap)}.`
          : "The search found no better pose near it."),
    ];
    const unsure = found && isUnsure(found);
    return element(
      "div",
      { className: "start-pose-verdict" },
      element(
        "p",
        { className: unsure ? "notice" : "" },
        words.filter(Boolean).join(" ") || `The session has a start pose, of frame ${pose.frame}.`,
      ),
      unsure && notice("It may face the other way: check left and right before you track."),
      found?.note && hint(found.note),
    );
  }

  function mending() {
    if (frame !== pose.frame) {
      return [
        notice(
          `The start pose is of frame ${pose.frame}, where tracking begins. To begin in frame ${frame}, find or edit it here.`,
        ),
        actions(
          button(
            `Show frame ${pose.frame}`,
            () => {
              frame = pose.frame;
              draw();
            },
            "small",
          ),
        ),
      ];
    }
    const swatch = (side) => element("i", { className: `side-swatch ${side}` });
    const act = (label, work, className = "") =>
      button(label, work, className, { disabled: going });
    return [
      ...(pose.has_sides
        ? [
            element("h2", {}, "Left and right"),
            element(
              "p",
              { className: "side-check" },
              swatch("left"),
              "the subject's left, ",
              swatch("right"),
              "the subject's right. Is it so in every picture?",
            ),
          ]
        : []),
      actions(
        act("Yes, track from here", () => setup.go("track", { begin: true }), "primary"),
        pose.has_sides && [
          act("No: facing the other way", () => exchange("turned round")),
          act("Mirror", () => exchange("in place")),
        ],
        act("Refine from here", refine),
      ),
    ];
  }

  // The pictures of all views.

  function drawPictures() {
    clearTimeout(timer);
    timer = setTimeout(() => {
      if (gone || editing) return;
      const stored = Boolean(pose.stored);
      fill(
        setup.aside,
        element(
          "div",
          { className: "pictures" },
          setup.detail.cameras.map(({ name }) =>
            picture(
              element("img", {
                alt: `${name}, frame ${frame}${stored ? ", start pose" : ""}`,
                loading: "lazy",
                src: `${here}/frames/${frame}/views/${encodeURIComponent(name)}.jpg?show=outline&height=${PICTURE_HEIGHT}${stored ? "&pose=start" : ""}&age=${age}`,
              }),
              name,
            ),
          ),
        ),
      );
    }, REDRAW_MILLISECONDS);
  }

  async function loadAgain() {
    try {
      const answer = await load(setup.session);
      if (gone) return;
      pose = answer;
      age += 1;
      draw();
    } catch (error) {
      if (!gone) fill(place, failure(error));
    }
  }

  // The editor may be left in the scene itself.
  setup.on("scene", (event) => {
    if (!editing) return;
    if (event.editing) begun = true;
    else if (begun) {
      editing = begun = false;
      loadAgain();
    }
  });
  draw();
  findAgain().catch(complain);
  return () => {
    gone = true;
    clearTimeout(timer);
    if (editing) remove("/api/scene/edit").catch(() => {});
  };
}
