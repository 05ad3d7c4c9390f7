// Step Subject: which body, how tall, what follows from it; and the fit to the footage, with
// lengths before and after.

import { fault, fetchJson, post, put, remove, sessionPath } from "./api.js";
import {
  actions,
  button,
  check,
  drawProgress,
  element,
  failure,
  field,
  fill,
  hint,
  number,
  optional,
  percent,
  select,
  table,
  text,
} from "./elements.js";
import { findJob, followJob, isGoing, progressOf } from "./jobs.js";
import { complain } from "./messages.js";
import { drawStature } from "./setup_stature.js";

/** @import { Schemas } from "./api_types" */

const PREVIEW_MILLISECONDS = 150;
const USUAL_HEIGHT = 1750;
const LEAST_MM = 1000;
const MOST_MM = 2200;
const LEAST_METRES = 0.3;
const MOST_METRES = 3;
const PICTURE_HEIGHT = 300;

const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

/** @typedef {Schemas["FitSubjectState"]} Fit */

/** @param {string} session */
export const load = (session) =>
  Promise.all([
    fetchJson(`${sessionPath(session)}/subject`),
    fetchJson(`/api/choices?session=${encodeURIComponent(session)}`),
  ]);

/** @type {import("./setup.js").Mount<typeof load>} */
export function mount(place, setup, [loaded, choices]) {
  const here = sessionPath(setup.session);
  let subject = loaded;
  let body = subject.body;
  let height = subject.height_mm; // null while it is unknown
  /** @type {{ name: string, label: string, by_height?: boolean }[]} */
  const bodies = choices.bodies;
  if (!bodies.some((one) => one.name === body)) bodies.push({ name: body, label: body });
  /** @type {Schemas["FitSubjectState"] | null} */
  let fit = null;
  let failed = null; // what went wrong with the height
  let unfitted = null; // what went wrong with the fit
  let preview = 0;
  let gone = false;
  const options = { symmetric: true, lengths: true, radii: true, count: 5, frames: "", run: "" };
  const who = element("section", { className: "subject-who background-make" });
  const fitting = element("section", { className: "subject-fit background-quality" });
  const progress = optional();
  place.append(who, fitting);

  const changed = () => body !== subject.body || height !== subject.height_mm;
  /** Whether the body is as large as its file says: an animal, a machine, a body of one's own. */
  const isSized = () => bodies.find((one) => one.name === body)?.by_height === false;

  // Who it is.

  function drawWho() {
    const take = (value) => {
      height = value;
      look();
      drawFit();
    };
    const typed = number(height ? height / 10 : "", {
      min: 30,
      max: 300,
      step: 0.5,
      placeholder: "unknown",
      ariaLabel: "Height in centimetres",
    });
    const slider = element("input", {
      type: "range",
      min: LEAST_MM,
      max: MOST_MM,
      step: 5,
      value: height ?? USUAL_HEIGHT,
      ariaLabel: "Height",
    });
    typed.oninput = () => {
      if (typed.value === "" || !typed.checkValidity()) return;
      take(Number(typed.value) * 10);
      slider.value = String(height);
    };
    // "1.80" is metres: no person is that many centimetres tall.
    typed.onchange = () => {
      const metres = Number(typed.value);
      if (metres < LEAST_METRES || metres > MOST_METRES) return;
      typed.value = String(Math.round(1000 * metres) / 10);
      typed.dispatchEvent(new Event("input"));
    };
    slider.oninput = () => {
      take(Number(slider.value));
      typed.value = String(Number(slider.value) / 10);
    };
    saveHeight.textContent =
      isSized() || (!height && body !== subject.body) ? "Take this body" : "Set the height";
    fill(
      who,
      field(
        "Body",
        select(
          bodies.map((one) => [one.name, one.label]),
          body,
          {
            onchange: ({ target }) => {
              body = target.value;
              if (isSized()) height = null;
              drawWho();
              look();
              drawFit();
            },
          },
        ),
      ),
      !isSized() &&
        field("Height (cm)", element("div", { className: "height-row" }, typed, slider)),
      hint(
        isSized()
          ? "As large as its file says: the run fits radii and ends to the first frames, a fit below finds the lengths too."
          : `Every length follows from the height by published proportions. ${subject.fitted ? "A new height replaces the fitted measures." : "A guess within 3 cm will do; the fit finds the rest."}`,
      ),
      actions(
        saveHeight,
        element(
          "a",
          { href: `/bodies?${new URLSearchParams({ session: setup.session, body })}` },
          "Change it, or make one of your own",
        ),
      ),
      failure(failed),
    );
  }

  const saveHeight = button("Set the height", async () => {
    failed = null;
    try {
      if (!height && !isSized() && body === subject.body)
        throw fault("The height is not known yet.", "Type it, or move the slider.");
      await put(`${here}/subject`, { ...(height ? { height_mm: height } : {}), body });
      await loadAgain();
      fit = null;
      setup.refresh().catch(complain);
    } catch (error) {
      failed = error;
    }
    draw();
  });

  /** Draw the body as it would be. */
  function look() {
    clearTimeout(preview);
    preview = setTimeout(async () => {
      const query = new URLSearchParams({ body, ...(height ? { height_mm: String(height) } : {}) });
      try {
        const shown = changed() ? await fetchJson(`${here}/subject?${query}`) : subject;
        if (!gone && !fit?.limbs?.length && !(fit && isGoing(fit) && fit.frames.length))
          drawStature(setup.aside, shown.limbs, [], note(shown));
      } catch (error) {
        complain(error);
      }
    }, PREVIEW_MILLISECONDS);
  }

  const note = (shown) =>
    shown !== subject
      ? "Preview."
      : shown.fitted
        ? "Fitted to the footage."
        : isSized()
          ? "As its file says."
          : shown.saved
            ? "By published proportions."
            : "Average size: no measures of the person yet.";

  // The fit.

  function drawFit() {
    saveHeight.classList.toggle("primary", !subject.saved || changed());
    const going = isGoing(fit);
    const found = fit?.state === "done";
    const isReady = subject.saved && !changed();
    const box = (name, title) =>
      check(
        name === "symmetric" ? "left and right alike" : name,
        {
          checked: options[name],
          onchange: ({ target }) => {
            options[name] = target.checked;
          },
        },
        title,
      );
    /** @type {[string, string][]} */
    const runs = setup.detail.runs
      .filter((run) => run.done)
      .map((run) => [run.name, `of ${run.name}`]);
    fill(
      fitting,
      element("h2", {}, "Fit the subject to the footage"),
      hint(
        isReady
          ? "Lengths and radii are found together with the poses of a few frames, on the silhouettes. Frames without a pose are searched first, which takes longest."
          : isSized()
            ? "Take the body first."
            : "Set the height first: it is the one measure that the pictures alone cannot give.",
      ),
      element(
        "div",
        { className: "step-row" },
        field(
          "How many frames",
          number(options.count, {
            min: 1,
            max: 24,
            step: 1,
            onchange: ({ target }) => {
              options.count = Number(target.value) || 5;
            },
          }),
        ),
        field(
          "or these frames",
          text({
            value: options.frames,
            placeholder: "chosen for variety",
            pattern: "[0-9, ]*",
            onchange: ({ target }) => {
              options.frames = target.value;
            },
          }),
        ),
      ),
      field(
        "First poses",
        select([["", "the newest run's, else searched for"], ...runs], options.run, {
          onchange: ({ target }) => {
            options.run = target.value;
          },
        }),
      ),
      element(
        "div",
        { className: "fit-boxes" },
        box("symmetric", "Off: each side has its own lengths, which needs more frames."),
        box("lengths", "Of limbs"),
        box("radii", "Of limbs"),
      ),
      !going &&
        actions(
          button(
            found ? "Fit again" : "Fit the subject",
            beginFit,
            isReady && !(found && !fit?.file) ? "primary" : "",
            { disabled: !isReady },
          ),
        ),
      progress,
      failure(unfitted),
      fit && found && results(fit),
    );
    if (fit && going) drawGoing(fit);
    else fill(progress);
  }

  async function beginFit() {
    const frames = options.frames
      .split(/[,\s]+/)
      .filter(Boolean)
      .map(Number);
    unfitted = null;
    try {
      if (frames.some((frame) => !Number.isInteger(frame)))
        throw fault("Frames are whole numbers.", "Write them like 10, 40, 80.");
      fit = await post(`${here}/fit-subject`, {
        ...options,
        frames,
        run: options.run || null,
        keep: false,
      });
    } catch (error) {
      fit = null;
      unfitted = error;
    }
    draw();
    await followFit();
  }

  /** Follow the fit that is under way to its end. */
  async function followFit() {
    if (!fit || !isGoing(fit)) return;
    try {
      fit = await followJob(
        `/api/subject-fits/${fit.identifier}`,
        (job) => {
          fit = job;
          drawGoing(job);
        },
        () => gone,
      );
    } catch (error) {
      fit = null;
      unfitted = error;
    }
    if (!gone) draw();
  }

  /**
   * The fit that was begun before this page was loaded, or in another window: how far it is, or
   * what it found.
   */
  async function findFit() {
    const known = await findJob({ session: setup.session, kind: "subject" });
    if (!known || gone || fit) return;
    if (known.state === "failed") unfitted = known;
    // What was saved shows as the session's subject, until that is another one.
    else if (isGoing(known) || (known.state === "done" && (!known.file || subject.fitted)))
      fit = known;
  }

  let looks = -1; // which pictures of the fit under way are drawn

  /** @param {Fit} fit */
  function drawGoing(fit) {
    if (fit.looks !== looks && fit.frames.length) {
      looks = fit.looks;
      fill(
        setup.aside,
        element(
          "div",
          { className: "pictures-bar" },
          hint("So far: the body as it is fitted, over the frames that are looked at."),
        ),
        fitPictures(fit),
      );
    }
    const cancel = () => remove(`/api/subject-fits/${fit.identifier}`).catch(complain);
    drawProgress(progress, progressOf(fit, "beginning", cancel));
  }

  const sizeWords = (name) => name.replaceAll("_", " ").replace(/ (length|radius)$/, "");

  const rounded = (/** @type {number | null} */ size) => (size === null ? "–" : Math.round(size));

  /** @param {Fit} fit */
  function sizeTable(fit, kind) {
    const sizes = fit.sizes.filter((size) => size.kind === kind);
    return (
      sizes.length > 0 &&
      table(
        [kind === "length" ? "Length (mm)" : "Radius (mm)", "before", "after", "±"],
        sizes.map((size) => [
          sizeWords(size.name),
          rounded(size.before),
          element("td", { className: "after" }, rounded(size.after)),
          size.deviation === null ? "–" : Math.max(1, Math.round(size.deviation)),
        ]),
        "sizes",
      )
    );
  }

  async function keep(identifier) {
    try {
      fit = await post(`/api/subject-fits/${String(identifier)}/keep`);
      await loadAgain();
      setup.refresh().catch(complain);
    } catch (error) {
      complain(error);
    }
    draw();
  }

  /** Each size before and after, and how far silhouettes overlap. */
  /** @param {Fit} fit */
  function results(fit) {
    const frames =
      fit.frames.length > 1
        ? `frames ${fit.frames.slice(0, -1).join(", ")} and ${fit.frames.at(-1)}`
        : `frame ${fit.frames[0]}`;
    return element(
      "div",
      { className: "background-quality" },
      element(
        "p",
        {},
        `Body and silhouettes overlap by ${percent(mean(fit.overlap))} (${percent(mean(fit.overlap_before))} before), in ${frames}; first poses ${fit.poses_from.startsWith("run") ? `of ${fit.poses_from}` : fit.poses_from}.`,
      ),
      fit.file
        ? hint("Saved. The old subject is kept beside it as subject-before.")
        : actions(button("Save as the subject", () => keep(fit.identifier), "primary")),
      sizeTable(fit, "length"),
      sizeTable(fit, "radius"),
      hint(
        "± is one standard deviation: two limbs in three, about, lie within it. Wrists and shoulders are the least certain.",
      ),
    );
  }

  /**
   * The pictures of the fit: the new body over each frame, a camera each in turn.
   * @param {Fit} fit
   */
  function fitPictures(fit) {
    const names = setup.detail.cameras.map((camera) => camera.name);
    return element(
      "div",
      { className: "pictures fitted" },
      fit.frames.map((frame, at) => {
        const camera = names[at % names.length];
        return element(
          "figure",
          { className: "picture" },
          element("img", {
            alt: `Frame ${frame}, ${camera}`,
            src: `/api/subject-fits/${fit.identifier}/frames/${frame}/views/${encodeURIComponent(camera)}.jpg?height=${PICTURE_HEIGHT}&look=${fit.looks}`,
          }),
          element(
            "figcaption",
            {},
            element(
              "span",
              {},
              element("b", {}, `frame ${frame}`),
              ` ${camera}${fit.overlap ? `, overlap ${percent(fit.overlap[at])}` : ""}`,
            ),
          ),
        );
      }),
    );
  }

  function draw() {
    drawWho();
    drawFit();
    if (fit && isGoing(fit) && fit.frames.length) return undefined;
    if (fit?.state !== "done") return look();
    drawStature(
      setup.aside,
      fit.limbs,
      subject.limbs,
      fit.file
        ? "Fitted and saved. Dashed: by height alone."
        : "As fitted. Dashed: before the fit.",
    );
    setup.aside.append(fitPictures(fit));
  }

  async function loadAgain() {
    [subject] = await load(setup.session);
    [body, height] = [subject.body, subject.height_mm];
  }

  findFit()
    .catch(complain)
    .then(() => {
      if (gone) return undefined;
      draw();
      return followFit();
    });

  return () => {
    gone = true;
    clearTimeout(preview);
  };
}
