// Step Subject: which body, how tall, what follows from it; the fit to the footage, with lengths
// before and after; and a body from landmarks that are clicked.

import { fault, fetchJson, post, put, remove, sessionPath } from "./api.js";
import { percent } from "./elements.js";
import { findJob, followJob, isGoing, progressOf } from "./jobs.js";
import { complain } from "./messages.js";
import { FilmPanel, LandmarkClicks, landmarksOf } from "./setup_landmarks.js";
import { Stature } from "./setup_stature.js";
import { batch, html, into, signal, useState } from "./studio/component.js";
import { opensLarge } from "./studio/dialogs.js";
import { Action, Failure, Progress, Select, Table } from "./studio/parts.js";

/** @import { Schemas } from "./api_types" */
/** @typedef {Schemas["FitSubjectState"]} Fit */

const PREVIEW_MILLISECONDS = 150;
const USUAL_HEIGHT = 1750;
const LEAST_METRES = 0.3;
const MOST_METRES = 3;
const isHeight = (/** @type {number} */ metres) => metres >= LEAST_METRES && metres <= MOST_METRES;
const PICTURE_HEIGHT = 300;

/** @param {(number | null)[] | null} values */
const mean = (values) =>
  values &&
  values.reduce((/** @type {number} */ sum, value) => sum + (value ?? 0), 0) / values.length;

/** @param {string} session */
export const load = (session) =>
  Promise.all([
    fetchJson(`${sessionPath(session)}/subject`),
    fetchJson(`/api/choices?session=${encodeURIComponent(session)}`),
    // A fit that was begun before this page was loaded, or in another window.
    /** @type {Promise<Fit | null>} */ (findJob({ session, kind: "subject" }).catch(complain)),
  ]);

/**
 * What the step knows, and what can be done.
 * @param {import("./setup.js").Setup} setup
 * @param {Awaited<ReturnType<typeof load>>} loaded
 */
export function modelOf(setup, [stored, choices, known]) {
  const here = sessionPath(setup.session);
  const subject = signal(stored);
  const body = signal(stored.body);
  /** Null while it is unknown. */
  const height = signal(stored.height_mm);
  /** The chosen body, while it is another than the session's. */
  const preview = signal(/** @type {typeof stored | null} */ (null));
  /** What went wrong with the height. */
  const failed = signal(/** @type {any} */ (null));
  const fit = signal(/** @type {Fit | null} */ (null));
  /** What went wrong with the fit. */
  const unfitted = signal(/** @type {any} */ (null));
  /** What the fit's fields hold. @type {Record<string, any>} */
  const options = { symmetric: true, lengths: true, radii: true, count: 5, frames: "", run: "" };
  /** @type {{ name: string, label: string, by_height?: boolean }[]} */
  const bodies = [...choices.bodies];
  if (!bodies.some((one) => one.name === stored.body))
    bodies.push({ name: stored.body, label: stored.body });
  let timer = 0;
  let isLeft = false;

  const isChanged = () =>
    body.value !== subject.value.body || height.value !== subject.value.height_mm;
  /** Whether the body is as large as its file says: an animal, a machine, a body of one's own. */
  const isSized = () => bodies.find((one) => one.name === body.value)?.by_height === false;

  /** Show the body as it would be. */
  function look() {
    clearTimeout(timer);
    timer = window.setTimeout(async () => {
      const query = new URLSearchParams({ body: body.value });
      if (height.value) query.set("height_mm", String(height.value));
      try {
        preview.value = isChanged() ? await fetchJson(`${here}/subject?${query}`) : null;
      } catch (error) {
        complain(error);
      }
    }, PREVIEW_MILLISECONDS);
  }

  async function reload() {
    const again = await fetchJson(`${here}/subject`);
    batch(() => {
      subject.value = again;
      body.value = again.body;
      height.value = again.height_mm;
      preview.value = null;
    });
    setup.refresh().catch(complain);
  }

  /** Follow a fit to its end. @param {() => Promise<Fit>} begin */
  async function follow(begin) {
    unfitted.value = null;
    try {
      const begun = await begin();
      fit.value = begun;
      const path = `/api/subject-fits/${begun.identifier}`;
      const ended = await followJob(path, into(fit), () => isLeft);
      if (ended) fit.value = ended;
    } catch (error) {
      fit.value = null;
      unfitted.value = error;
    }
  }

  const landmarks = landmarksOf(setup, bodies, stored.body);

  if (known?.state === "failed") unfitted.value = known;
  else if (known && isGoing(known)) follow(async () => known);
  // What was saved shows as the session's subject, until that is another one.
  else if (known?.state === "done" && (!known.file || stored.fitted)) fit.value = known;

  return {
    setup,
    subject,
    body,
    height,
    bodies,
    preview,
    failed,
    fit,
    unfitted,
    options,
    landmarks,
    isChanged,
    isSized,
    /** @param {string} name */
    choose: (name) => {
      body.value = name;
      if (isSized()) height.value = null;
      look();
    },
    /** @param {number} millimetres */
    size: (millimetres) => {
      height.value = millimetres;
      look();
    },
    save: async () => {
      failed.value = null;
      try {
        if (!height.value && !isSized() && body.value === subject.value.body)
          throw fault("The height is not known yet.", "Type it, or move the slider.");
        const size = height.value ? { height_mm: height.value } : {};
        await put(`${here}/subject`, { ...size, body: body.value });
        fit.value = null;
        await reload();
      } catch (error) {
        failed.value = error;
      }
    },
    begin: () =>
      follow(() => {
        const frames = String(options.frames)
          .split(/[,\s]+/)
          .filter(Boolean)
          .map(Number);
        if (frames.some((frame) => !Number.isInteger(frame)))
          throw fault("Frames are whole numbers.", "Write them like 10, 40, 80.");
        const { symmetric, lengths, radii } = options;
        return post(`${here}/fit-subject`, {
          symmetric,
          lengths,
          radii,
          count: Number(options.count) || 5,
          frames,
          run: options.run || null,
          keep: false,
        });
      }),
    keep: async () => {
      try {
        fit.value = await post(`/api/subject-fits/${String(fit.value?.identifier)}/keep`);
        await reload();
      } catch (error) {
        complain(error);
      }
    },
    stop: () => {
      isLeft = true;
      clearTimeout(timer);
      landmarks.stop();
    },
  };
}

/** @typedef {ReturnType<typeof modelOf>} Model */

/** A person's height, typed or by a slider. @param {{ model: Model }} properties */
function Height({ model }) {
  const height = model.height.value;
  const [typed, setTyped] = useState(height ? String(height / 10) : "");
  const take = (/** @type {HTMLInputElement} */ input) => {
    setTyped(input.value);
    if (input.value !== "" && input.checkValidity()) model.size(Number(input.value) * 10);
  };
  // "1.80" is metres, "1800" millimetres: no person is that many centimetres tall.
  const settle = ({ target }) => {
    if (target.checkValidity()) return;
    const metres = [1, 0.001].map((unit) => unit * Number(target.value)).find(isHeight);
    if (metres) {
      target.value = String(Math.round(1000 * metres) / 10);
      take(target);
    } else target.reportValidity();
  };
  return html`<label>
    Height (cm)
    <div class="height-row">
      <input
        type="number"
        min="30"
        max="300"
        step="0.1"
        placeholder="unknown"
        aria-label="Height in centimetres"
        value=${typed}
        onInput=${({ target }) => take(target)}
        onChange=${settle}
      />
      <input
        type="range"
        min="100"
        max="220"
        step="0.5"
        aria-label="Height"
        value=${(height ?? USUAL_HEIGHT) / 10}
        onInput=${({ target }) => take(target)}
      />
    </div>
  </label>`;
}

/** Who it is. @param {{ model: Model }} properties */
function Who({ model }) {
  const subject = model.subject.value;
  const [body, height] = [model.body.value, model.height.value];
  const isSized = model.isSized();
  const query = new URLSearchParams({ session: model.setup.session, body });
  return html`<section class="subject-who background-make">
    <${Select}
      label="Body"
      options=${model.bodies.map((one) => [one.name, one.label])}
      value=${body}
      take=${model.choose}
    />
    ${!isSized && html`<${Height} key=${subject.height_mm} model=${model} />`}
    <p class="hint">
      ${
        isSized
          ? html`As large as its file says: the run fits radii and ends to the first frames, a fit
            below finds the lengths too.`
          : html`Every length follows from the height by published proportions.${" "}
            ${
              subject.fitted
                ? "A new height replaces the fitted measures."
                : "A guess within 3 cm will do; the fit finds the rest."
            }`
      }
    </p>
    <div class="step-actions">
      <${Action} kind=${!subject.saved || model.isChanged() ? "primary" : ""} act=${model.save}>
        ${isSized || (!height && body !== subject.body) ? "Take this body" : "Set the height"}
      </${Action}>
      <a href=${`/bodies?${query}`}>Change it, or make one of your own</a>
    </div>
    <${Failure} error=${model.failed.value} />
  </section>`;
}

/** What is fitted, and from where. @param {{ model: Model }} properties */
function FitFields({ model }) {
  const { options } = model;
  const runs = model.setup.detail.runs
    .filter((run) => run.done)
    .map(({ name }) => [name, `of ${name}`]);
  const box = (
    /** @type {string} */ name,
    /** @type {string} */ title,
    /** @type {string} */ words,
  ) => html`<label class="check" title=${title}>
    <input type="checkbox" name=${name} defaultChecked=${options[name]} />${words}
  </label>`;
  return html`<div
    class="background-make"
    onChange=${({ target: { name, type, checked, value } }) => {
      options[name] = type === "checkbox" ? checked : value;
    }}
  >
    <div class="step-row">
      <label>
        How many frames
        <input type="number" name="count" min="1" max="24" step="1" defaultValue=${options.count} />
      </label>
      <label>
        or these frames
        <input type="text" name="frames" placeholder="chosen for variety" pattern="[0-9, ]*" />
      </label>
    </div>
    <${Select}
      label="First poses"
      name="run"
      options=${[["", "the newest run's, else searched for"], ...runs]}
    />
    <div class="fit-boxes">
      ${box("symmetric", "Off: each side has its own lengths, which needs more frames.", "left and right alike")}
      ${box("lengths", "Of limbs", "lengths")} ${box("radii", "Of limbs", "radii")}
    </div>
  </div>`;
}

/** The fit to the footage. @param {{ model: Model }} properties */
function Fitting({ model }) {
  const fit = model.fit.value;
  const isFound = fit?.state === "done";
  const isReady = model.subject.value.saved && !model.isChanged();
  const cancel = () => remove(`/api/subject-fits/${fit?.identifier}`).catch(complain);
  return html`<section class="subject-fit background-quality">
    <h2>Fit the subject to the footage</h2>
    <p class="hint">
      ${
        isReady
          ? html`Lengths and radii are found together with the poses of a few frames, on the
            silhouettes. Frames without a pose are searched first, which takes longest.`
          : model.isSized()
            ? "Take the body first."
            : "Set the height first: it is the one measure that the pictures alone cannot give."
      }
    </p>
    <${FitFields} model=${model} />
    ${
      isGoing(fit)
        ? html`<${Progress} ...${progressOf(fit, "beginning", cancel)} />`
        : html`<div class="step-actions">
            <${Action}
              kind=${isReady && !(isFound && !fit.file) ? "primary" : ""}
              act=${model.begin}
              disabled=${!isReady}
            >
              ${isFound ? "Fit again" : "Fit the subject"}
            </${Action}>
          </div>`
    }
    <${Failure} error=${model.unfitted.value} />
    ${isFound && html`<${Results} model=${model} fit=${fit} />`}
  </section>`;
}

/** Sizes of a kind before and after; nothing without any. */
function Sizes(/** @type {{ fit: Fit, kind: string, head: string }} */ { fit, kind, head }) {
  const sizes = fit.sizes.filter((size) => size.kind === kind);
  const rounded = (/** @type {number | null} */ size) => (size === null ? "–" : Math.round(size));
  return (
    sizes.length > 0 &&
    html`<${Table}
      kind="sizes"
      heads=${[head, "before", "after", "±"]}
      rows=${sizes.map(({ name, before, after, deviation }) => [
        name.replaceAll("_", " ").replace(/ (length|radius)$/, ""),
        rounded(before),
        rounded(after),
        deviation === null ? "–" : Math.max(1, Math.round(deviation)),
      ])}
    />`
  );
}

/** Each size before and after, and how far silhouettes overlap. */
function Results(/** @type {{ model: Model, fit: Fit }} */ { model, fit }) {
  const frames =
    fit.frames.length > 1
      ? `frames ${fit.frames.slice(0, -1).join(", ")} and ${fit.frames.at(-1)}`
      : `frame ${fit.frames[0]}`;
  const from = fit.poses_from.startsWith("run") ? `of ${fit.poses_from}` : fit.poses_from;
  const overlap = `${percent(mean(fit.overlap))} (${percent(mean(fit.overlap_before))} before)`;
  return html`<div class="background-quality">
    <p>Body and silhouettes overlap by ${overlap}, in ${frames}; first poses ${from}.</p>
    ${
      fit.file
        ? html`<p class="hint">Saved. The old subject is kept beside it as subject-before.</p>`
        : html`<div class="step-actions">
            <${Action} kind="primary" act=${model.keep}>Save as the subject</${Action}>
          </div>`
    }
    <${Sizes} fit=${fit} kind="length" head="Length (mm)" />
    <${Sizes} fit=${fit} kind="radius" head="Radius (mm)" />
    <p class="hint">
      ± is one standard deviation: two limbs in three, about, lie within it. Wrists and shoulders
      are the least certain.
    </p>
  </div>`;
}

/** The new body over each frame of the fit, a camera each in turn. */
function FitPictures(/** @type {{ model: Model, fit: Fit }} */ { model, fit }) {
  const names = model.setup.detail.cameras.map((camera) => camera.name);
  return html`<div class="pictures fitted">
    ${fit.frames.map((frame, at) => {
      const camera = names[at % names.length];
      const view = `frames/${frame}/views/${encodeURIComponent(camera)}.jpg`;
      return html`<figure key=${frame} class="picture">
        <img
          alt=${`Frame ${frame}, ${camera}`}
          ...${opensLarge(`Frame ${frame}, ${camera}`)}
          src=${`/api/subject-fits/${fit.identifier}/${view}?height=${PICTURE_HEIGHT}&look=${fit.looks}`}
        />
        <figcaption>
          <span>
            <b>frame ${frame}</b> ${camera}${fit.overlap && `, overlap ${percent(fit.overlap[at])}`}
          </span>
        </figcaption>
      </figure>`;
    })}
  </div>`;
}

/** The body as it stands, or as it is fitted. @param {{ model: Model }} properties */
export function Beside({ model }) {
  if (model.landmarks.isClicking.value) return html`<${LandmarkClicks} model=${model.landmarks} />`;
  const [fit, subject] = [model.fit.value, model.subject.value];
  if (fit && isGoing(fit) && fit.frames.length)
    return html`
      <div class="pictures-bar">
        <p class="hint">So far: the body as it is fitted, over the frames that are looked at.</p>
      </div>
      <${FitPictures} model=${model} fit=${fit} />
    `;
  if (fit?.state === "done")
    return html`
      <${Stature}
        limbs=${fit.limbs}
        before=${subject.limbs}
        words=${fit.file ? "Fitted and saved. Dashed: by height alone." : "As fitted. Dashed: before the fit."}
      />
      <${FitPictures} model=${model} fit=${fit} />
    `;
  const preview = model.preview.value;
  const words = subject.fitted
    ? "Fitted to the footage."
    : model.isSized()
      ? "As its file says."
      : subject.saved
        ? "By published proportions."
        : "Average size: no measures of the person yet.";
  return html`<${Stature}
    limbs=${(preview ?? subject).limbs}
    words=${preview ? "Preview." : words}
  />`;
}

/** @param {{ model: Model }} properties */
export const Panel = ({ model }) => html`
  <${Who} model=${model} />
  <${Fitting} model=${model} />
  <${FilmPanel} model=${model.landmarks} />
`;
