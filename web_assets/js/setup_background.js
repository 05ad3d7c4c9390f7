// Step Background: what backgrounds are made of, how masks are cut, what does not count, how far
// the views agree.

import { fetchJson, post, put, remove, sessionPath } from "./api.js";
import { isGoing, progressOf } from "./jobs.js";
import { complain } from "./messages.js";
import { AlignmentBox, alignmentOf } from "./setup_alignment.js";
import { Brush, loadRegion } from "./setup_brush.js";
import { MaskPictures, shownMasks } from "./setup_masks.js";
import { QualityList, SourceTable } from "./setup_quality.js";
import { Strokes } from "./setup_strokes.js";
import { attempting, batch, html, into, signal, useRef, useState } from "./studio/component.js";
import { Action, Check, Failure, Progress, Select } from "./studio/parts.js";
import { uploadFiles } from "./uploading.js";

/** @import { Schemas } from "./api_types" */
/** @typedef {Schemas["BackgroundAnswer"]} Background */
/** @typedef {Schemas["SubjectsInView"]["subjects"][number]} Subject */
/** @typedef {ReturnType<typeof modelOf>} Model */

const PREVIEW_MILLISECONDS = 180;
const HIGHEST_SLIDER = 5000;
const ANY_FOOTAGE = "image/*,video/*";
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
  "mask_shadow_floor",
  "mask_shadow_alike",
  "mask_shadow_doubt",
  "mask_opening",
  "mask_closing",
  "mask_keep_components",
];

/** @param {string} session */
export async function load(session) {
  const here = sessionPath(session);
  const [background, { cameras: strokes }] = await Promise.all([
    fetchJson(`${here}/background`),
    fetchJson(`${here}/strokes`),
  ]);
  return { background, strokes };
}

/**
 * What is to be chosen where nothing was set yet: without any picture of the empty room, somebody
 * who stays in place has no background.
 * @param {Awaited<ReturnType<typeof load>>} loaded
 * @param {boolean} isPerson the network knows people only
 */
function recommended({ background, strokes }, isPerson) {
  const hasNone = !background.cameras.some((camera) => camera.given);
  // What somebody began to paint is what is wanted, also after the page was left.
  if (strokes.some((camera) => camera.strokes.length) || (hasNone && !isPerson)) return "strokes";
  if (hasNone && background.possible.includes("person")) return "person";
  return background.cameras.length >= 3 ? "combined" : background.source;
}

/**
 * What the step knows, and what can be done.
 * @param {import("./setup.js").Setup} setup
 * @param {Awaited<ReturnType<typeof load>>} loaded
 */
export function modelOf(setup, loaded) {
  const here = sessionPath(setup.session);
  const isPerson = setup.detail.body.by_height;
  const isSet = Object.keys(loaded.background.own).length || loaded.background.source === "masks";
  const background = signal(loaded.background);
  const strokes = signal(loaded.strokes);
  /** The chosen source. @type {import("@preact/signals").Signal<Background["source"]>} */
  const source = signal(isSet ? loaded.background.source : recommended(loaded, isPerson));
  /** Whether the knobs are tuned, what the subject never comes near is excluded, and things in front of it found. */
  const isTuned = signal(true);
  const isUnusedExcluded = signal(false);
  const isFindingInFront = signal(true);
  /** Knobs that are tried. @type {import("@preact/signals").Signal<Record<string, any>>} */
  const changed = signal({});
  const quality = signal(loaded.background.job?.quality ?? null);
  /** Who is in view in the first frame. @type {import("@preact/signals").Signal<Subject[] | null>} */
  const seen = signal(null);
  /** Who was chosen of them. @type {import("@preact/signals").Signal<Subject | null>} */
  const subject = signal(null);
  const failed = signal(
    /** @type {any} */ (loaded.background.job?.state === "failed" ? loaded.background.job : null),
  );
  const attempt = attempting(failed);
  /** The editor over a camera's picture, with its properties. */
  const painted = signal(/** @type {any} */ (null));
  const shown = shownMasks(setup, loaded.background.frame_count);
  // Turned cameras see the same masks otherwise: whether they agree now is measured at once, else
  // the step waits for it.
  const alignment = alignmentOf(setup, () => {
    quality.value = null;
    shown.refresh();
    return measure();
  });
  let timer = 0;
  let isLeft = false;

  const isUnderWay = () => isGoing(background.value.job);

  async function reload() {
    const again = await load(setup.session);
    batch(() => {
      background.value = again.background;
      strokes.value = again.strokes;
    });
  }

  /** Try other knobs; the pictures follow soon. @param {Record<string, any>} knobs */
  function tryKnobs(knobs, milliseconds = 0) {
    changed.value = knobs;
    clearTimeout(timer);
    timer = window.setTimeout(() => shown.preview(knobs), milliseconds);
  }

  /** @param {Background["source"]} name */
  function choose(name) {
    source.value = name;
    const { background_model: tried, ...knobs } = changed.value;
    // Thresholds are cheap to show: the pictures follow their knobs at once.
    const isOther = name === "threshold" && background.value.settings.background_model !== name;
    const kept = tried && tried !== "threshold" ? { background_model: tried } : {};
    tryKnobs({ ...knobs, ...(isOther ? { background_model: name } : kept) });
    if (name !== "subject") return;
    seen.value = subject.value = null;
    attempt(async () => {
      seen.value = (await fetchJson(`${here}/subjects`)).subjects;
    });
  }

  const measure = async () => {
    if (background.value.cameras.length < 2) return;
    try {
      quality.value = await post(`${here}/masks/quality`);
      setup.refresh().catch(complain);
    } catch (error) {
      complain(error);
    }
  };

  /** How the set-up stands now; newest, since an event may come before the answer to its request. */
  let newest = background.value.job;
  /** @param {Background["job"]} job */
  function take(job) {
    newest = job;
    background.value = { ...background.value, job };
    shown.cut(isGoing(job));
  }

  setup.on("background", async (job) => {
    take(job);
    if (isGoing(job)) return;
    await reload().catch(complain);
    if (isLeft) return;
    if (job.state === "failed") failed.value = job;
    if (job.state !== "done") return;
    quality.value = job.quality;
    tryKnobs({});
    setup.refresh().catch(complain);
    if (background.value.cameras.length > 1) alignment.measure();
  });

  const setUp = () =>
    attempt(async () => {
      newest = null;
      const begun = await post(`${here}/background`, {
        source: source.value,
        knobs: changed.value,
        tune: isTuned.value,
        exclude_unused: isUnusedExcluded.value && source.value === "combined",
        find_in_front: isFindingInFront.value,
        subject_at: source.value === "subject" ? (subject.value?.at ?? null) : null,
      });
      if (!newest) take(begun);
    });

  /**
   * Take pictures or clips of the empty room; `named`: which camera's a file is.
   * @param {File[]} files
   * @param {Record<string, string>} named
   * @param {(words: string) => void} report
   */
  const give = (files, named, report) =>
    attempt(async () => {
      const upload = await uploadFiles(files, report);
      report("Reading them…");
      background.value = await post(`${here}/backgrounds`, { upload, files: named });
      if (source.value === "person")
        source.value = recommended(
          { background: background.value, strokes: strokes.value },
          isPerson,
        );
      shown.preview(changed.value);
    });

  async function keep() {
    try {
      await put(`${here}/evidence`, { ...background.value.own, ...changed.value });
      await reload();
      tryKnobs({});
      setup.refresh().catch(complain);
    } catch (error) {
      complain(error);
    }
  }

  /** @param {string} camera */
  const lensOf = (camera) => setup.detail.cameras.find((one) => one.name === camera);

  /** The editor is left: what it kept is seen in the pictures. */
  function leave() {
    painted.value = null;
    shown.refresh();
  }

  /**
   * Paint a region of a camera, over its picture: what does not count, or what hides the subject.
   * @param {import("./setup_brush.js").Region} kind
   * @param {string} camera
   */
  async function paintRegion(kind, camera) {
    const known = background.value.cameras.find((one) => one.name === camera);
    const isPainted = kind === "exclusions" ? known?.excluded : known?.in_front;
    const before = isPainted ? await loadRegion(setup.session, kind, camera) : null;
    const done = async (/** @type {boolean} */ isSaved) => {
      if (isSaved) {
        quality.value = null;
        await reload().catch(complain);
        setup.refresh().catch(complain);
      }
      leave();
    };
    const frame = shown.frame.value;
    painted.value = { Editor: Brush, setup, kind, lens: lensOf(camera), frame, before, done };
  }

  /** Paint strokes on a camera's picture. @param {string} camera */
  async function paint(camera) {
    const { cameras } = await fetchJson(`${here}/strokes`);
    const before = cameras.find((one) => one.camera === camera)?.strokes ?? [];
    const done = async (/** @type {boolean} */ isSaved, /** @type {number} */ frame) => {
      shown.frame.value = frame;
      if (isSaved) {
        source.value = "strokes";
        await reload().catch(complain);
      }
      leave();
    };
    const [frame, count] = [shown.frame.value, background.value.frame_count];
    painted.value = { Editor: Strokes, setup, lens: lensOf(camera), frame, count, before, done };
  }

  shown.cut(isUnderWay());
  alignment.load().catch(complain);

  return {
    here,
    setup,
    background,
    strokes,
    source,
    isTuned,
    isUnusedExcluded,
    isFindingInFront,
    changed,
    quality,
    seen,
    subject,
    failed,
    alignment,
    shown,
    painted,
    isUnderWay,
    tryKnobs,
    choose,
    measure,
    setUp,
    give,
    keep,
    exclude: (/** @type {string} */ camera) => paintRegion("exclusions", camera).catch(complain),
    hide: (/** @type {string} */ camera) => paintRegion("in_front", camera).catch(complain),
    paint: (/** @type {string} */ camera) => paint(camera).catch(complain),
    cancel: () => remove(`${here}/background`).catch(complain),
    stop: () => {
      isLeft = true;
      clearTimeout(timer);
    },
  };
}

/** What backgrounds are made of. @param {{ model: Model }} properties */
function SourceChoices({ model }) {
  const background = model.background.value;
  return html`<fieldset class="choices">
    <legend>Source of the masks</legend>
    ${background.sources.map(({ name, label, help, lacking }) => {
      // Strokes are painted once they are chosen.
      const isPossible = !lacking || name === "strokes";
      const isUsed =
        background.source === name && (name === "masks" || Object.keys(background.own).length > 0);
      return html`<label key=${name} class="choice">
        <input
          type="radio"
          name="background-source"
          value=${name}
          checked=${model.source.value === name}
          disabled=${!isPossible}
          onChange=${() => model.choose(name)}
        />
        <span>
          <b>${label}</b>${isUsed && html`<span class="badge good">in use</span>`}
          <span class="hint">${isPossible ? help : lacking}</span>
        </span>
      </label>`;
    })}
  </fieldset>`;
}

/**
 * Who is in view in the first frame, to be clicked on the picture in which most of them are seen, or
 * in the list.
 * @param {{ model: Model }} properties
 */
function SubjectList({ model }) {
  const seen = model.seen.value;
  if (!seen) return html`<p class="hint">Looking who is in view in the first frame…</p>`;
  if (!seen.length)
    return html`<p class="notice">
      Nobody is seen in the first frame: look at the masks of all cameras.
    </p>`;
  const marks = (/** @type {string} */ camera) => seen.filter((one) => one.points[camera]).length;
  const { name } = model.background.value.cameras.reduce((best, one) =>
    marks(one.name) > marks(best.name) ? one : best,
  );
  const words = (/** @type {Subject} */ one) =>
    `at ${one.at.map((value) => value.toFixed(2)).join(", ")} m`;
  const pick = into(model.subject);
  const chosen = model.subject.value;
  return html`<section class="plates">
    <p class="hint">Click whom the masks shall be of.</p>
    <div class="subject-picture">
      <img
        src=${`${model.here}/footage/${encodeURIComponent(name)}/0.jpg?height=420`}
        alt=${`First frame of ${name}`}
      />
      ${seen.map((one, at) => {
        const point = one.points[name];
        return (
          point &&
          html`<button
            type="button"
            class="subject-dot"
            aria-pressed=${String(one === chosen)}
            aria-label=${`Follow subject ${at + 1}, ${words(one)}`}
            style=${{ left: `${100 * point[0]}%`, top: `${100 * point[1]}%` }}
            onClick=${() => pick(one)}
          >
            ${at + 1}
          </button>`
        );
      })}
    </div>
    <ul class="plate-list">
      ${seen.map(
        (one, at) => html`<li key=${at}>
          <span>${at + 1}</span>
          <span class="hint">
            ${words(one)}${one.height !== null && `, ${one.height.toFixed(2)} m high`}
          </span>
          <${Action} kind="quiet small" act=${() => pick(one)} aria-label=${`Follow ${at + 1}`}>
            ${one === chosen ? "Followed" : "Follow"}
          </${Action}>
        </li>`,
      )}
    </ul>
  </section>`;
}

/** @param {Schemas["CameraStrokes"]} line */
function strokeWords({ strokes, ready, made }) {
  if (!strokes.length) return "nothing painted yet";
  if (!ready) return "nothing inside yet";
  const frames = new Set(strokes.map((one) => one.frame)).size;
  const painted = `${strokes.length} ${strokes.length > 1 ? "strokes" : "stroke"}`;
  return `${painted} in ${frames} ${frames > 1 ? "frames" : "frame"}${made ? ", masks made" : ""}`;
}

/** @param {{ model: Model }} properties */
const StrokeList = ({ model }) => html`<section class="plates">
  <p class="hint">
    Paint in a frame in which the camera sees the subject well: a line or two through each of its
    parts and colours, one around it. More strokes in a later frame correct what follows.
  </p>
  <ul class="plate-list">
    ${model.strokes.value.map(
      (line) => html`<li key=${line.camera}>
        <span>${line.camera}</span><span class="hint">${strokeWords(line)}</span>
        <${Action}
          kind="quiet small"
          act=${() => model.paint(line.camera)}
          aria-label=${`Paint on ${line.camera}`}
        >
          Paint…
        </${Action}>
      </li>`,
    )}
  </ul>
</section>`;

/**
 * A camera's picture or clip of the empty room.
 * @param {{ camera: Background["cameras"][number], where: string,
 *   give: (files: File[]) => Promise<void> }} properties
 */
function Plate({ camera: { name, given, file }, where, give }) {
  const input = useRef(/** @type {HTMLInputElement | null} */ (null));
  return html`<li>
    <span>${name}</span>
    <span class="hint">${given ? `${given === "clip" ? "clip" : "picture"} ${file}` : "none"}</span>
    <${Action}
      kind="quiet small"
      act=${() => input.current?.click()}
      aria-label=${`Choose the empty ${where} of ${name}`}
    >
      Choose…
    </${Action}>
    <input
      ref=${input}
      type="file"
      accept=${ANY_FOOTAGE}
      hidden
      onChange=${({ target }) => give([...target.files])}
    />
  </li>`;
}

/** Pictures and clips of the empty room. @param {{ model: Model }} properties */
function Plates({ model }) {
  const { cameras } = model.background.value;
  const given = cameras.filter((camera) => camera.given).length;
  // An animal's place is a cage or a glass.
  const where = model.setup.detail.body.by_height ? "room" : "place";
  const [isOpen, setOpen] = useState(!given && cameras.length < 3);
  const [words, setWords] = useState("");
  const give = async (
    /** @type {File[]} */ files,
    /** @type {Record<string, string>} */ named = {},
  ) => {
    if (!files.length) return;
    await model.give(files, named, setWords);
    setWords("");
  };
  return html`<details
    class="plates"
    open=${isOpen}
    onToggle=${({ currentTarget }) => setOpen(currentTarget.open)}
  >
    <summary>Pictures of the empty ${where}: ${given} of ${cameras.length} cameras</summary>
    <label>
      One picture or clip per camera, matched by name
      <input
        type="file"
        multiple
        accept=${ANY_FOOTAGE}
        aria-label=${`Pictures or clips of the empty ${where}`}
        onChange=${({ target }) => give([...target.files])}
      />
    </label>
    <ul class="plate-list">
      ${cameras.map(
        (camera) =>
          html`<${Plate}
            key=${camera.name}
            camera=${camera}
            where=${where}
            give=${(/** @type {File[]} */ files) =>
              give(files, Object.fromEntries(files.map((file) => [camera.name, file.name])))}
          />`,
      )}
    </ul>
    <p class="hint upload-words" role="status">${words}</p>
  </details>`;
}

/** The sources, what the chosen one needs, and what sets it up. @param {{ model: Model }} properties */
function Make({ model }) {
  const { cameras, job, possible, sources, source: used } = model.background.value;
  const source = model.source.value;
  const isUnderWay = model.isUnderWay();
  const isReady = possible.includes(source) && (source !== "subject" || model.subject.value);
  const Needs = source === "strokes" ? StrokeList : source === "subject" ? SubjectList : Plates;
  return html`<div class="background-make">
    ${
      used === "masks" &&
      html`<p class="notice">
        Masks came with the footage and are used unchanged. Set up a background only if they are not
        good.
      </p>`
    }
    <${SourceChoices} model=${model} />
    <${Needs} model=${model} />
    ${
      sources.find((one) => one.name === source)?.has_knobs &&
      html`<${Check}
        checked=${model.isTuned.value}
        take=${into(model.isTuned)}
        title="Knobs that you set below stay fixed."
      >
        tune the knobs for the best agreement of the views
      </${Check}>`
    }
    ${
      source === "combined" &&
      html`<${Check}
        checked=${model.isUnusedExcluded.value}
        take=${into(model.isUnusedExcluded)}
        title="A bystander, a monitor, a window: motion there is not the subject."
      >
        exclude regions that the subject never comes near
      </${Check}>`
    }
    ${
      cameras.length >= 3 &&
      html`<${Check}
        checked=${model.isFindingInFront.value}
        take=${into(model.isFindingInFront)}
        title="A table, a pole: what it hides of the subject is unknown, not empty. What you painted stays."
      >
        look for things that stand in front of the subject
      </${Check}>`
    }
    ${
      !isUnderWay &&
      html`<div class="step-actions">
        <${Action} kind="primary" act=${model.setUp} disabled=${!isReady}>
          Set up the background
        </${Action}>
      </div>`
    }
    ${
      isUnderWay && html`<${Progress} ...${progressOf(job, "Reading the footage", model.cancel)} />`
    }
    <${Failure} error=${model.failed.value} />
    ${job?.choice && html`<${SourceTable} choice=${job.choice} />`}
    ${job?.notes.map((note) => html`<p class="hint">${note}</p>`)}
  </div>`;
}

/** How far the views agree. @param {{ model: Model }} properties */
function Agreement({ model }) {
  const { cameras, measured, source } = model.background.value;
  const [isMeasuring, setMeasuring] = useState(false);
  const measure = async () => {
    setMeasuring(true);
    await model.measure();
    setMeasuring(false);
  };
  return html`<section class="background-quality">
    <div class="head-line">
      <h2>Agreement of the views</h2>
      ${cameras.length > 1 && html`<${Action} kind="small" act=${measure}>Measure</${Action}>`}
    </div>
    ${isMeasuring && html`<p class="hint">Comparing the masks of five frames…</p>`}
    ${
      !(isMeasuring && !model.quality.value) &&
      html`<${QualityList}
        setup=${model.setup}
        quality=${model.quality.value}
        measured=${measured}
        source=${source}
        paint=${model.exclude}
      />`
    }
  </section>`;
}

/** A knob of the masks. @param {{ model: Model, knob: Background["knobs"][number] }} properties */
function KnobRow({ model, knob }) {
  const stored = model.background.value.settings[knob.name];
  const changed = model.changed.value;
  const value = changed[knob.name] ?? stored;
  const isChanged = knob.name in changed;
  const take = (/** @type {any} */ wanted) => {
    const { [knob.name]: _, ...others } = changed;
    const knobs = wanted === stored ? others : { ...others, [knob.name]: wanted };
    model.tryKnobs(knobs, PREVIEW_MILLISECONDS);
  };
  const isNumber = knob.kind !== "bool" && !knob.choices.length;
  const made = isNumber
    ? html`<input
        type="range"
        aria-label=${knob.label}
        min=${knob.low}
        max=${Math.min(knob.high ?? HIGHEST_SLIDER, HIGHEST_SLIDER)}
        step=${knob.step || (knob.kind === "int" ? 1 : "any")}
        value=${value}
        onInput=${({ target }) => take(Number(target.value))}
      />`
    : knob.choices.length
      ? html`<${Select}
          aria-label=${knob.label}
          options=${knob.choices}
          value=${value}
          take=${take}
        />`
      : html`<input
          type="checkbox"
          aria-label=${knob.label}
          checked=${value}
          onChange=${({ target }) => take(target.checked)}
        />`;
  return html`<label class=${isChanged ? "knob changed" : "knob"} title=${knob.help}>
    <span>${knob.label}</span>${made}
    ${
      isNumber &&
      html`<output>
        ${typeof value === "number" ? Number(value.toPrecision(3)) : ""} ${knob.unit}
      </output>`
    }
  </label>`;
}

/** Knobs, whose preview the pictures show. @param {{ model: Model }} properties */
function Knobs({ model }) {
  const { knobs } = model.background.value;
  const names = model.source.value === "threshold" ? [...THRESHOLDS, ...FIRST.slice(-3)] : FIRST;
  const first = names.flatMap((name) => knobs.find((knob) => knob.name === name) ?? []);
  const rest = knobs.filter((knob) => knob.name.startsWith("mask_") && !names.includes(knob.name));
  const rows = (/** @type {Background["knobs"]} */ those) =>
    those.map((knob) => html`<${KnobRow} key=${knob.name} model=${model} knob=${knob} />`);
  return html`<details class="background-knobs">
    <summary>Fine adjustment</summary>
    <p class="hint">The pictures follow; nothing is stored before you press Keep.</p>
    ${rows(first)}
    <details>
      <summary>More</summary>
      ${rows(rest)}
    </details>
    ${
      Object.keys(model.changed.value).length > 0 &&
      html`<div class="step-actions">
        <${Action} kind="small" act=${model.keep}>Keep</${Action}>
        <${Action} kind="quiet small" act=${() => model.tryKnobs({})}>Reset</${Action}>
      </div>`
    }
  </details>`;
}

/** @param {{ model: Model }} properties */
export const Panel = ({ model }) => html`
  <${Make} model=${model} />
  <${Agreement} model=${model} />
  <${AlignmentBox} model=${model.alignment} />
  <${Knobs} model=${model} />
`;

/**
 * Whose masks the pictures show, where another source is chosen and not set up yet; "" else. Only
 * thresholds show at once.
 * @param {Model} model
 */
function inUseWords({ background, source, isUnderWay }) {
  const { source: used, sources } = background.value;
  const chosen = source.value;
  if (chosen === used || chosen === "threshold" || isUnderWay()) return "";
  const labelOf = (/** @type {string} */ name) =>
    sources.find((one) => one.name === name)?.label ?? name;
  return `Masks in use: ${labelOf(used)}. ${labelOf(chosen)} follows when you press “Set up the background”.`;
}

/** The masks, or the editor of one. @param {{ model: Model }} properties */
export function Beside({ model }) {
  const { Editor, ...properties } = model.painted.value ?? {};
  if (Editor) return html`<${Editor} key=${properties.lens.name} ...${properties} />`;
  return html`<${MaskPictures}
    shown=${model.shown}
    cameras=${model.background.value.cameras}
    quality=${model.quality.value}
    exclude=${model.exclude}
    hide=${model.hide}
    paint=${model.paint}
    otherwise=${inUseWords(model)}
  />`;
}
