// Step Background: what backgrounds are made of, how masks are cut, what does not count, how far
// the views agree.

import { fetchJson, post, put, remove, sessionPath } from "./api.js";
import {
  actions,
  button,
  check,
  drawProgress,
  element,
  failure,
  field,
  files,
  fill,
  hint,
  notice,
  optional,
  select,
} from "./elements.js";
import { isGoing, progressOf } from "./jobs.js";
import { complain } from "./messages.js";
import { uploadFiles } from "./uploading.js";
import { alignmentBox } from "./setup_alignment.js";
import { brush } from "./setup_brush.js";
import { maskPictures } from "./setup_masks.js";
import { qualityList, sourceTable } from "./setup_quality.js";
import { paintStrokes } from "./setup_strokes.js";

/** @import { Schemas } from "./api_types" */

const POLL_MILLISECONDS = 500;
const PREVIEW_MILLISECONDS = 180;
const HIGHEST_SLIDER = 5000;
const SOURCES = {
  combined: [
    "Combined",
    "Pictures of the empty room where there are any, the footage elsewhere; cleaned with the other views. The best choice with three cameras or more.",
  ],
  plate: ["Picture", "A picture of the empty room from each camera, unchanged."],
  clip: ["Clip", "A short video of the empty room from each camera, unchanged."],
  median: ["Median", "The median of the footage. Good if the subject moves about."],
  person: [
    "Person",
    "A network finds the person and cuts him out, frame by frame: no picture of the empty room, and he may stay in place. People only; the one whom most cameras see.",
  ],
  strokes: [
    "Strokes",
    "Anything: you paint a few lines inside and outside the subject in one picture of each camera; they are carried through all frames, and corrected by more strokes in any frame.",
  ],
  threshold: [
    "Brightness and colour",
    "For a subject that is lit so that these alone tell it from all else: a white mouse on dark litter, a glove of one colour.",
  ],
  masks: ["Given masks", "The masks that came with the footage, unchanged."],
  subject: [
    "One of several",
    "Of those in view you choose one; the others are cut out of the masks in use. For several at once: studio subjects, studio together.",
  ],
  best: [
    "Best of all",
    "Each of these that is possible is tried, which takes as long as all of them together; then each camera gets the one under which the views agree and the masks' borders lie on edges of the picture.",
  ],
};
const MISSING = {
  plate: "Give a picture for every camera below.",
  clip: "Give a clip for every camera below.",
  person: "Calibrate the cameras first: they must agree on who is seen.",
  masks: "No masks came with the footage.",
  best: "Calibrate the cameras first: by their agreement the sources are compared.",
  subject: "Calibrate the cameras first: where somebody stands is seen by two of them.",
};
/** Sources that have no knobs to tune. */
const AS_THEY_ARE = ["person", "strokes", "masks", "subject"];
const THRESHOLDS = [
  "mask_darkest",
  "mask_brightest",
  "mask_hue",
  "mask_hue_reach",
  "mask_saturation",
];
const FIRST = [
  "mask_threshold",
  "mask_gain_fit",
  "mask_shadow_test",
  "mask_shadow_darkest",
  "mask_shadow_colour",
  "mask_shadow_window",
  "mask_opening",
  "mask_closing",
  "mask_keep_components",
];

/** @param {HTMLElement} place @param {import("./setup.js").Setup} setup */
export function mount(place, setup) {
  const here = sessionPath(setup.session);
  /** @type {Schemas["BackgroundAnswer"]} */
  let background = null;
  /** @type {Schemas["BackgroundRequest"]["source"]} */
  let source = null;
  let tune = true;
  let unused = false; // whether what the subject never comes near is excluded
  /** @type {Record<string, string | number | boolean>} */
  let changed = {}; // knobs that are tried
  let quality = null;
  /** @type {Schemas["CameraStrokes"][]} */
  let strokes = [];
  /** @type {Schemas["SubjectsAnswer"] | null} */
  let seen = null; // who is in view in the first frame
  /** @type {[number, number] | null} */
  let subjectAt = null; // where the one stands who was chosen
  let failed = null;
  let gone = false;
  let timer = 0;
  let preview = 0;

  const make = element("div", { className: "background-make" });
  const going = optional();
  const agreement = element("section", { className: "background-quality" });
  const cameras = element("section", { className: "background-quality", hidden: true });
  const knobs = element("details", { className: "background-knobs" });
  place.append(make, agreement, cameras, knobs);
  // Turned cameras see the same masks otherwise: whether they agree now is measured at once, else
  // the step waits for it.
  const alignment = alignmentBox(setup, cameras, async () => {
    quality = null;
    drawQuality();
    pictures.show();
    await measureQuality();
  });
  const pictures = maskPictures(setup, paint, paintLines);

  async function load() {
    background = await fetchJson(`${here}/background`);
    strokes = (await fetchJson(`${here}/strokes`)).cameras;
    if (!source)
      source =
        Object.keys(background.own).length || background.source === "masks"
          ? background.source
          : recommended();
  }

  /**
   * Where nothing was set yet: without any picture of the empty room, somebody who stays in place
   * has no background.
   */
  function recommended() {
    // What somebody began to paint is what is wanted, also after the page was left; the network
    // knows people only.
    const hasNone = !background.cameras.some((camera) => camera.given);
    if (
      strokes.some((camera) => camera.strokes.length) ||
      (hasNone && !setup.detail.body.by_height)
    )
      return "strokes";
    if (hasNone && background.possible.includes("person")) return "person";
    return background.cameras.length >= 3 ? "combined" : background.source;
  }

  // What backgrounds are made of.

  function sourceChoices() {
    const rows = Object.entries(SOURCES).map(([key, [label, words]]) => {
      const name = /** @type {Schemas["BackgroundRequest"]["source"]} */ (key);
      // Strokes are painted once they are chosen.
      const possible = name === "strokes" || background.possible.includes(name);
      const used =
        background.source === name && (name === "masks" || Object.keys(background.own).length > 0);
      return element(
        "label",
        { className: "choice" },
        element("input", {
          type: "radio",
          name: "background-source",
          value: name,
          checked: name === source,
          disabled: !possible,
          onchange: () => choose(name),
        }),
        element(
          "span",
          {},
          element("b", {}, label),
          used && element("span", { className: "badge good" }, "in use"),
          element("span", { className: "hint" }, possible ? words : MISSING[name]),
        ),
      );
    });
    return element(
      "fieldset",
      { className: "choices" },
      element("legend", {}, "Source of the masks"),
      rows,
    );
  }

  function choose(name) {
    source = name;
    // Thresholds are cheap to show: the pictures follow their knobs at once.
    if (name === "threshold" && background.settings.background_model !== "threshold")
      changed = { ...changed, background_model: "threshold" };
    else if (name !== "threshold" && changed.background_model === "threshold")
      delete changed.background_model;
    pictures.preview(changed);
    drawKnobs();
    drawMake();
    if (name === "subject") lookForSubjects();
  }

  async function lookForSubjects() {
    seen = subjectAt = null;
    try {
      seen = await fetchJson(`${here}/subjects`);
    } catch (error) {
      failed = error;
    }
    if (!gone) drawMake();
  }

  /**
   * Who is in view in the first frame, to be clicked on the picture in which most of them are seen,
   * or in the list.
   */
  function subjectList() {
    if (!seen) return hint("Looking who is in view in the first frame…");
    if (!seen.subjects.length)
      return notice("Nobody is seen in the first frame: look at the masks of all cameras.");
    const marks = (camera) => seen.subjects.filter((one) => one.points[camera]).length;
    const { name } = background.cameras.reduce((best, one) =>
      marks(one.name) > marks(best.name) ? one : best,
    );
    const words = (one) => `at ${one.at.map((value) => value.toFixed(2)).join(", ")} m`;
    const pick = (one) => {
      subjectAt = one.at;
      drawMake();
    };
    const chosen = (one) =>
      subjectAt !== null && one.at[0] === subjectAt[0] && one.at[1] === subjectAt[1];
    const dots = seen.subjects.map(
      (one, at) =>
        one.points[name] &&
        element(
          "button",
          {
            type: "button",
            className: "subject-dot",
            ariaPressed: String(chosen(one)),
            ariaLabel: `Follow subject ${at + 1}, ${words(one)}`,
            style: `left: ${100 * one.points[name][0]}%; top: ${100 * one.points[name][1]}%`,
            onclick: () => pick(one),
          },
          String(at + 1),
        ),
    );
    const rows = seen.subjects.map((one, at) =>
      element(
        "li",
        {},
        element("span", {}, `${at + 1}`),
        element("span", { className: "hint" }, `${words(one)}, ${one.height.toFixed(2)} m high`),
        button(chosen(one) ? "Followed" : "Follow", () => pick(one), "quiet small", {
          ariaLabel: `Follow ${at + 1}`,
        }),
      ),
    );
    return element(
      "section",
      { className: "plates" },
      hint("Click whom the masks shall be of."),
      element(
        "div",
        { className: "subject-picture" },
        element("img", {
          src: `${here}/footage/${encodeURIComponent(name)}/0.jpg?height=420`,
          alt: `First frame of ${name}`,
        }),
        dots,
      ),
      element("ul", { className: "plate-list" }, rows),
    );
  }

  function strokeList() {
    const rows = strokes.map(({ camera, strokes: painted, ready, made }) => {
      const frames = new Set(painted.map((one) => one.frame)).size;
      const words = !painted.length
        ? "nothing painted yet"
        : !ready
          ? "nothing inside yet"
          : `${painted.length} ${painted.length > 1 ? "strokes" : "stroke"} in ${frames} ${frames > 1 ? "frames" : "frame"}${made ? ", masks made" : ""}`;
      return element(
        "li",
        {},
        element("span", {}, camera),
        element("span", { className: "hint" }, words),
        button("Paint…", () => paintLines(camera), "quiet small", {
          ariaLabel: `Paint on ${camera}`,
        }),
      );
    });
    return element(
      "section",
      { className: "plates" },
      hint(
        "Paint in a frame in which the camera sees the subject well: a line or two through each of its parts and colours, one around it. More strokes in a later frame correct what follows.",
      ),
      element("ul", { className: "plate-list" }, rows),
    );
  }

  /** Paint strokes on a camera's picture. */
  function paintLines(camera) {
    const lens = setup.detail.cameras.find((one) => one.name === camera);
    paintStrokes(setup, lens, pictures.frame, background.frame_count, async (saved, frame) => {
      pictures.go(frame);
      if (saved) {
        source = "strokes";
        await load().catch(complain);
        drawMake();
      }
      pictures.show();
    }).catch(complain);
  }

  function plates() {
    const accept = "image/*,video/*";
    const many = files({
      multiple: true,
      accept,
      ariaLabel: "Pictures or clips of the empty room",
      onchange: ({ target }) => give([...target.files], {}),
    });
    const rows = background.cameras.map(({ name, given, file }) => {
      const input = files({
        accept,
        hidden: true,
        onchange: ({ target }) => give([...target.files], { [name]: target.files[0]?.name }),
      });
      return element(
        "li",
        {},
        element("span", {}, name),
        element(
          "span",
          { className: "hint" },
          given ? `${given === "clip" ? "clip" : "picture"} ${file}` : "none",
        ),
        button("Choose…", () => input.click(), "quiet small", {
          ariaLabel: `Choose the empty room of ${name}`,
        }),
        input,
      );
    });
    const given = background.cameras.filter((camera) => camera.given).length;
    return element(
      "details",
      {
        className: "plates",
        open: make.querySelector("details")?.open ?? (!given && background.cameras.length < 3),
      },
      element(
        "summary",
        {},
        `Pictures of the empty room: ${given} of ${background.cameras.length} cameras`,
      ),
      field("One picture or clip per camera, matched by name", many),
      element("ul", { className: "plate-list" }, rows),
      element("p", { className: "hint upload-words", role: "status" }),
    );
  }

  async function give(chosen, named) {
    if (!chosen.length) return;
    const words = make.querySelector(".upload-words");
    try {
      const upload = await uploadFiles(chosen, (text) => {
        words.textContent = text;
      });
      words.textContent = "Reading them…";
      background = await post(`${here}/backgrounds`, { upload, files: named });
      if (source === "person") source = recommended();
      failed = null;
      pictures.preview(changed);
    } catch (error) {
      failed = error;
    }
    drawMake();
    make.querySelector("details")?.setAttribute("open", "");
  }

  function drawMake() {
    const running = isGoing(background.job);
    fill(
      make,
      background.source === "masks" &&
        notice(
          "Masks came with the footage and are used unchanged. Set up a background only if they are not good.",
        ),
      sourceChoices(),
      source === "strokes" ? strokeList() : source === "subject" ? subjectList() : plates(),
      !AS_THEY_ARE.includes(source) &&
        check(
          "tune the knobs for the best agreement of the views",
          {
            checked: tune,
            onchange: ({ target }) => {
              tune = target.checked;
            },
          },
          "Knobs that you set below stay fixed.",
        ),
      source === "combined" &&
        check(
          "exclude regions that the subject never comes near",
          {
            checked: unused,
            onchange: ({ target }) => {
              unused = target.checked;
            },
          },
          "A bystander, a monitor, a window: motion there is not the subject.",
        ),
      !running &&
        actions(
          button("Set up the background", setUp, "primary", {
            disabled:
              !source ||
              !background.possible.includes(source) ||
              (source === "subject" && !subjectAt),
          }),
        ),
      going,
      failure(failed),
      background.job?.choice && sourceTable(background.job.choice),
      (background.job?.notes ?? []).map((note) => hint(note)),
    );
    pictures.cut(running);
    if (running) drawGoing();
    else fill(going);
  }

  function drawGoing() {
    drawProgress(
      going,
      progressOf(background.job, "Reading the footage", () =>
        remove(`${here}/background`).catch(complain),
      ),
    );
  }

  async function setUp() {
    failed = null;
    try {
      background.job = await post(`${here}/background`, {
        source,
        knobs: changed,
        tune,
        exclude_unused: unused && source === "combined",
        subject_at: source === "subject" ? subjectAt : null,
      });
    } catch (error) {
      failed = error;
    }
    drawMake();
    follow();
  }

  /** Ask how the set-up stands until it ends. */
  async function follow() {
    clearTimeout(timer);
    if (gone || !isGoing(background.job)) return;
    timer = setTimeout(async () => {
      await load().catch(complain);
      if (gone) return;
      const { job } = background;
      if (isGoing(job)) {
        drawGoing();
        return follow();
      }
      if (job?.state === "failed") failed = job;
      if (job?.state === "done") {
        quality = job.quality;
        changed = {};
        pictures.preview(changed);
        drawKnobs();
        setup.refresh().catch(complain);
        if (background.cameras.length > 1) alignment.measure();
      }
      drawQuality();
      drawMake();
    }, POLL_MILLISECONDS);
  }

  // How far the views agree.

  async function measureQuality() {
    if (background.cameras.length < 2) return;
    const words = agreement.querySelector(".hint");
    if (words) words.textContent = "Comparing the masks of five frames…";
    try {
      quality = await post(`${here}/masks/quality`);
    } catch (error) {
      complain(error);
    }
    if (gone) return;
    drawQuality();
    setup.refresh().catch(complain);
  }

  function drawQuality() {
    const measure = button("Measure", measureQuality, "small", {
      hidden: background.cameras.length < 2,
    });
    fill(
      agreement,
      element(
        "div",
        { className: "head-line" },
        element("h2", {}, "Agreement of the views"),
        measure,
      ),
      qualityList(setup, quality, paint, background.measured, background.source),
    );
    pictures.rate(quality);
  }

  // Knobs with a live preview.

  const valueWords = (knob, value) =>
    `${typeof value === "number" ? Number(value.toPrecision(3)) : ""} ${knob.unit}`;

  function knobRow(knob) {
    const value = changed[knob.name] ?? background.settings[knob.name];
    const shown = element("output", {}, valueWords(knob, value));
    const take = (wanted) => {
      if (wanted === background.settings[knob.name]) delete changed[knob.name];
      else changed[knob.name] = wanted;
      shown.textContent = valueWords(knob, wanted);
      row.classList.toggle("changed", knob.name in changed);
      offerKeeping();
      clearTimeout(preview);
      preview = setTimeout(() => pictures.preview(changed), PREVIEW_MILLISECONDS);
    };
    const ariaLabel = knob.label;
    const isNumber = knob.kind !== "bool" && !knob.choices.length;
    const made = isNumber
      ? element("input", {
          type: "range",
          ariaLabel,
          min: knob.low,
          max: Math.min(knob.high, HIGHEST_SLIDER),
          step: knob.step || (knob.kind === "int" ? 1 : "any"),
          value,
          oninput: ({ target }) => take(Number(target.value)),
        })
      : knob.choices.length
        ? select(knob.choices, String(value), {
            ariaLabel,
            onchange: ({ target }) => take(target.value),
          })
        : element("input", {
            type: "checkbox",
            ariaLabel,
            checked: value,
            onchange: ({ target }) => take(target.checked),
          });
    const row = element(
      "label",
      { className: knob.name in changed ? "knob changed" : "knob", title: knob.help },
      element("span", {}, knob.label),
      made,
      isNumber && shown,
    );
    return row;
  }

  const keep = button(
    "Keep",
    async () => {
      try {
        await put(`${here}/evidence`, { ...background.own, ...changed });
        changed = {};
        await load();
        drawKnobs();
        drawMake();
        pictures.preview(changed);
        setup.refresh().catch(complain);
      } catch (error) {
        complain(error);
      }
    },
    "small",
  );
  const reset = button(
    "Reset",
    () => {
      changed = {};
      drawKnobs();
      pictures.preview(changed);
    },
    "quiet small",
  );
  const offerKeeping = () => {
    keep.hidden = reset.hidden = !Object.keys(changed).length;
  };

  function drawKnobs() {
    const named = (name) => background.knobs.find((knob) => knob.name === name);
    const first = source === "threshold" ? [...THRESHOLDS, ...FIRST.slice(-3)] : FIRST;
    const rest = background.knobs.filter(
      (knob) => knob.name.startsWith("mask_") && !first.includes(knob.name),
    );
    offerKeeping();
    fill(
      knobs,
      element("summary", {}, "Fine adjustment"),
      hint("The pictures follow; nothing is stored before you press Keep."),
      first.map((name) => knobRow(named(name))),
      element("details", {}, element("summary", {}, "More"), rest.map(knobRow)),
      actions(keep, reset),
    );
  }

  /** Paint what does not count of a camera, over its picture. */
  function paint(camera) {
    const lens = setup.detail.cameras.find((one) => one.name === camera);
    const { excluded } = background.cameras.find((one) => one.name === camera);
    brush(setup, { ...lens, frame: pictures.frame, excluded }, async (saved) => {
      if (!saved) return pictures.show();
      quality = null;
      await load().catch(complain);
      pictures.mark(background.cameras);
      pictures.show();
      drawQuality();
      setup.refresh().catch(complain);
    });
  }

  load()
    .then(() => {
      if (gone) return;
      quality = background.job?.quality ?? null;
      if (background.job?.state === "failed") failed = background.job;
      pictures.begin(background);
      drawMake();
      drawQuality();
      drawKnobs();
      follow();
      alignment.load().catch(complain);
    })
    .catch((error) => place.append(failure(error)));

  return () => {
    gone = true;
    clearTimeout(timer);
    clearTimeout(preview);
    pictures.close();
    alignment.stop();
  };
}
