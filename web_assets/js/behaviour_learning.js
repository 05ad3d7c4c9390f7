// Learning a model: the form, and the card with its progress.

import { post } from "./api.js";
import {
  bar,
  button,
  card,
  element,
  failure,
  field,
  fill,
  hint,
  lead,
  NAME,
  number,
  optional,
  pageHead,
  select,
  sends,
  table,
} from "./elements.js";
import { isGoing, progressOf } from "./jobs.js";
import { studioPath } from "./sessions.js";
import { uploadFiles } from "./uploading.js";

/** @type {[string, string][]} */
const USES = [
  ["", "–"],
  ["learn", "learn"],
  ["test", "test"],
];

/** One knob as a field, from its declaration. */
function knobField(knob) {
  const { name } = knob;
  const made = knob.choices.length
    ? select(knob.choices, knob.default, { name })
    : number(knob.default, {
        name,
        min: knob.low,
        max: knob.high,
        step: knob.step ?? "any",
        required: true,
      });
  return field(knob.unit ? `${knob.label} (${knob.unit})` : knob.label, made, { title: knob.help });
}

/** The knobs under their groups' titles, each folded away. */
const knobGroups = (knobs) =>
  [...Map.groupBy(knobs, (knob) => knob.group)].map(([group, members]) =>
    element(
      "details",
      { className: "card-box" },
      element("summary", {}, group),
      element("div", { className: "fields" }, members.map(knobField)),
    ),
  );

/** A row for each run with frames: whether it is used for learning, for the test, or not. */
function runRows(sessions) {
  const rows = sessions.flatMap((session) =>
    session.runs
      .filter((run) => run.done > 1)
      .map((run) => {
        const source = `${session.name}/${run.name}`;
        return [
          session.name,
          element("a", { href: studioPath(session.name, run.name) }, run.name),
          `${run.done} frames`,
          select(USES, "", { ariaLabel: `What ${source} is for`, dataset: { source } }),
        ];
      }),
  );
  if (!rows.length) return hint("No run has any frames yet.");
  return element(
    "div",
    { className: "scrolls low-list" },
    table(["session", "run", "", "use"], rows),
  );
}

/** What the form requests, as `POST /api/learning` takes it, but for the upload. */
function read(form, knobs) {
  const chosen = (use) =>
    [...form.querySelectorAll("select[data-source]")]
      .filter((one) => one.value === use)
      .map((one) => one.dataset.source);
  const value = (name) => form.elements[name].value.trim();
  const changed = knobs
    .filter((knob) => value(knob.name) !== String(knob.default))
    .map((knob) => [knob.name, knob.choices.length ? value(knob.name) : Number(value(knob.name))]);
  return {
    name: value("name"),
    body: value("body"),
    fps: Number(value("fps")),
    sources: chosen("learn"),
    tests: chosen("test"),
    settings: Object.fromEntries(changed),
  };
}

/**
 * Show the form in `content`. choices: as `GET /api/learning` has them. started: called when it has
 * begun.
 */
export function showLearningForm(content, { choices, sessions, started }) {
  const wrong = optional();
  const accept = choices.endings.join(",");
  const motions = element("input", { type: "file", name: "files", multiple: true, accept });
  const submit = element("button", { className: "primary" }, "Learn");
  const name = element("input", { name: "name", ...NAME });
  const form = element(
    "form",
    { className: "compare-form" },
    card(
      "",
      element(
        "div",
        { className: "fields" },
        field("Name of the model", name),
        field("Body", select(choices.bodies, choices.default_body, { name: "body" })),
        field(
          "Frames per second",
          number(choices.fps, { name: "fps", min: 5, max: 240, required: true }),
        ),
      ),
    ),
    card(
      "Learnt from",
      field(`Motion files (${choices.endings.join(" ")}); an .amc comes with its .asf`, motions),
      runRows(sessions),
      hint("If no run is chosen for the test, the last fifth of each source is used."),
    ),
    knobGroups(choices.knobs),
    wrong,
    element(
      "div",
      { className: "form-foot" },
      submit,
      element(
        "span",
        { className: "hint" },
        "In the background; the studio can be used meanwhile.",
      ),
    ),
  );
  sends(form, submit, wrong, async (report) => {
    const request = read(form, choices.knobs);
    const upload = motions.files?.length
      ? { upload: await uploadFiles(motions.files, report) }
      : {};
    report("Beginning…");
    started(await post("/api/learning", { ...request, ...upload }));
  });
  fill(
    content,
    element(
      "div",
      { className: "column" },
      pageHead(
        "Learn a behaviour",
        "Recorded motion and earlier runs are put on one body, copied with different smoothing and clustered into elementary movements, whose order is learnt.",
      ),
      form,
    ),
  );
  name.focus();
}

/** The progress in one line. */
export const progressWords = (job) =>
  isGoing(job) ? progressOf(job, "beginning").words : job.state;

const shareOf = (job) => (job.total ? job.done / job.total : 0);

/** The card of the model being learnt, or of why it failed. again: called for another form. */
export function showLearning(content, job, { cancel, again }) {
  const running = isGoing(job);
  const ended =
    { cancelled: "It was cancelled; nothing was stored.", failed: job.message }[job.state] ?? "";
  const box = card(
    "",
    running
      ? [
          element("p", { className: "lead words-of-progress" }, progressWords(job)),
          bar(shareOf(job), "long-progress"),
        ]
      : [failure({ message: ended }), job.hint && lead(job.hint)],
  );
  box.id = "learning";
  fill(
    content,
    element(
      "div",
      { className: "column" },
      pageHead(
        job.name,
        `body ${job.body}`,
        running ? button("Cancel", cancel) : button("Try again", again),
      ),
      box,
    ),
  );
}

/** Bring the card up to date where it shows one in the making; whether it did. */
export function updateLearning(content, job) {
  const words = content.querySelector("#learning .words-of-progress");
  if (!words || !isGoing(job)) return false;
  words.textContent = progressWords(job);
  content.querySelector("#learning .long-progress i").style.width = `${100 * shareOf(job)}%`;
  return true;
}
