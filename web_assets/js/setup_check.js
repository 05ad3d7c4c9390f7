// Step Check: whether the motion fits the pictures, frame by frame; refining and smoothing; which
// track is exported.

import { fetchJson, post, remove, runPath } from "./api.js";
import { partWords, percent } from "./elements.js";
import { followJob, progressOf } from "./jobs.js";
import { complain } from "./messages.js";
import { ViewWall } from "./setup_views.js";
import { batch, html, into, signal } from "./studio/component.js";
import { Action, Failure, Progress, Table } from "./studio/parts.js";

/** @import { Schemas } from "./api_types" */
/** @typedef {Schemas["CheckAnswer"]} Answer */
/** @typedef {NonNullable<Answer["check"]>} Check */

const MOST_CHIPS = 24;
const GOOD = 0.85;
const GOING = {
  refine: "refining",
  smooth: "smoothing",
  check: "comparing",
  landmarks: "looking for joints",
};
const millimetres = (/** @type {number | null} */ value) =>
  value === null ? "–" : `${value.toFixed(1)} mm`;
const meanOf = (/** @type {(number | null)[]} */ shares) => {
  const known = shares.filter((share) => share !== null);
  return known.length ? known.reduce((sum, share) => sum + share, 0) / known.length : null;
};

/**
 * What the step knows, and what can be done.
 * @param {import("./setup.js").Setup} setup
 */
export function modelOf(setup) {
  const run = setup.detail.runs.find((one) => one.name === setup.step?.run) ?? setup.detail.runs[0];
  const here = runPath(setup.session, run.name);
  const answer = signal(/** @type {Answer | null} */ (null));
  const tracks = signal(/** @type {Schemas["TrackList"]["tracks"]} */ ([]));
  /** Why no track can be measured though there is a truth. */
  const truthProblem = signal("");
  const track = signal("");
  /** What is being done. */
  const job = signal(/** @type {any} */ (null));
  const failed = signal(/** @type {any} */ (null));
  /** The frame that is looked at. */
  const frame = signal(run.first);
  /** How far the track lies from a network's joints. */
  const seen = signal(/** @type {Schemas["LandmarksLine"] | null} */ (null));
  let isLeft = false;

  const checkOf = (/** @type {string} */ name) =>
    fetchJson(name ? `${here}/check?track=${encodeURIComponent(name)}` : `${here}/check`);
  const last = Math.max(run.tracked_to - 1, run.first);

  async function load(wanted = "") {
    const [checked, listed] = await Promise.all([checkOf(wanted), fetchJson(`${here}/tracks`)]);
    batch(() => {
      answer.value = checked;
      tracks.value = listed.tracks;
      truthProblem.value = listed.truth_problem;
      track.value = checked.track;
    });
    if (listed.running[0] && !job.value) carry(listed.running[0]);
  }

  /** Wait for the job's end; resolves with the name of the track that it made, "" for none. */
  async function follow() {
    let ended = null;
    try {
      ended = await followJob(`/api/track-jobs/${job.value.identifier}`, into(job), () => isLeft);
    } catch (error) {
      failed.value = error;
    }
    if (isLeft) return "";
    const made =
      ended?.state === "done" && !["check", "landmarks"].includes(ended.verb) ? ended.track : "";
    if (made) seen.value = null;
    if (ended?.landmarks) seen.value = ended.landmarks;
    await load(made || track.value);
    await setup.refresh();
    return made;
  }

  /**
   * Follow a job, and what follows from it: of a track that was made it is the next question
   * whether it is better.
   * @param {any} begun
   */
  async function carry(begun) {
    try {
      job.value = await begun;
      const made = await follow();
      if (made) {
        job.value = await post(`${here}/check`, { track: made });
        await follow();
      }
    } catch (error) {
      failed.value = error;
    }
    job.value = null;
  }

  load().catch(into(failed));
  return {
    setup,
    run,
    here,
    answer,
    tracks,
    truthProblem,
    track,
    job,
    failed,
    frame,
    seen,
    last,
    /** Look at another track. @param {string} name */
    choose: async (name) => {
      const checked = await checkOf(name);
      batch(() => {
        track.value = name;
        seen.value = null;
        answer.value = checked;
      });
    },
    /**
     * Refine, smooth or measure, and follow it to its end; nothing else can be begun meanwhile.
     * @param {"refine" | "smooth" | "check" | "landmarks"} verb
     * @param {any} request
     */
    begin: (verb, request) => {
      failed.value = null;
      job.value = { verb, state: "running" };
      return carry(post(`${here}/${verb}`, request));
    },
    stop: () => {
      isLeft = true;
    },
  };
}

/** @typedef {ReturnType<typeof modelOf>} Model */

/** A button that begins something, unless something is being done. */
const Begin = (/** @type {any} */ { model, verb, request, kind, children }) => html`<${Action}
  kind=${kind}
  act=${() => model.begin(verb, request)}
  disabled=${Boolean(model.job.value)}
>
  ${children}
</${Action}>`;

/**
 * Frames to be looked at by a click; nothing where there are none.
 * @param {{ model: Model, words: string, entries: ({ frame: number, limb?: string, title?: string }
 *   | number)[] }} properties
 */
function Chips({ model, words, entries }) {
  if (!entries.length) return null;
  const more = entries.length > MOST_CHIPS ? ` (the first ${MOST_CHIPS} of ${entries.length})` : "";
  return html`<div>
    <p class="hint">${words}${more}:</p>
    <div class="chips">
      ${entries.slice(0, MOST_CHIPS).map((entry) => {
        const {
          frame,
          limb = "",
          title = "",
        } = typeof entry === "number" ? { frame: entry } : entry;
        return html`<${FrameButton} model=${model} frame=${frame} kind="small quiet" title=${title}>
          ${limb ? html`<b>${frame}</b> ${limb}` : frame}
        </${FrameButton}>`;
      })}
    </div>
  </div>`;
}

/** Shows a frame; the one that is shown is marked. */
const FrameButton = (/** @type {any} */ { model, frame, kind, children, ...more }) => html`<button
  type="button"
  class=${kind}
  data-frame=${frame}
  aria-current=${model.frame.value === frame ? "true" : null}
  onClick=${() => into(model.frame)(frame)}
  ...${more}
>
  ${children}
</button>`;

/** A bar a looked-at frame: how much of the model lies in the masks, over all cameras. */
const Strip = (/** @type {{ model: Model, check: Check }} */ { model, check }) => html`<div
  class="share-strip"
  role="group"
  aria-label="Share of the model in the masks, by frame"
>
  ${check.frames.map((frame, row) => {
    const mean = meanOf(check.inside[row]) ?? 0;
    const words = `frame ${frame}: ${percent(mean)}`;
    return html`<${FrameButton}
      model=${model}
      frame=${frame}
      kind=${mean < GOOD ? "poor" : ""}
      title=${words}
      aria-label=${`${words} of the model in the masks`}
    >
      <i style=${{ height: `${Math.round(100 * mean)}%` }}></i>
    </${FrameButton}>`;
  })}
</div>`;

/** @param {Check} check */
function verdictOf(check) {
  const covered = meanOf(check.covered.flat());
  const under =
    covered === null
      ? ""
      : `, and ${percent(covered)} of the masks under the model (the rest: a limb elsewhere, or not the subject)`;
  const [turns, jumps] = [check.turned.length, check.jumps.length];
  const parts = [
    check.good ? "The motion fits the pictures." : "Look at the frames below.",
    `${percent(check.inside_mean)} of the model lies in the masks${under}.`,
    turns
      ? `The body turns round suddenly ${turns === 1 ? "once" : `${turns} times`}: left and right may be exchanged.`
      : "No sudden turn: left and right were not exchanged.",
    jumps &&
      `A limb jumps ${jumps === 1 ? "once" : `${jumps} times`}: it was lost or taken for another.`,
    check.jitter_mm !== null && `The markers jitter by ${check.jitter_mm.toFixed(1)} mm.`,
  ];
  return parts.filter(Boolean).join(" ");
}

/** What was measured. @param {{ model: Model, check: Check }} properties */
function Measured({ model, check }) {
  const jumps = check.jumps.map(({ frame, limb, mm, usual_mm: usual }) => ({
    frame,
    limb,
    title:
      `The ${limb} jumps into frame ${frame}: its markers bend by ${millimetres(mm)} from a ` +
      `straight course, usually by ${millimetres(usual)}.`,
  }));
  const chips = (/** @type {string} */ words, /** @type {any[]} */ entries) =>
    html`<${Chips} model=${model} words=${words} entries=${entries} />`;
  return html`
    <p class=${check.good ? "" : "notice"}>${verdictOf(check)}</p>
    <${Strip} model=${model} check=${check} />
    ${chips("Too little of the model in the masks", check.poor)} ${chips("Lost", check.lost)}
    ${Object.entries(check.lost_limbs).map(([limb, frames]) =>
      chips(`The ${limb} is not where masks or pictures show it`, frames),
    )}
    ${chips("Doubtful", check.doubtful)} ${chips("Sudden turns", check.turned)}
    ${chips("Jumps", jumps)}
  `;
}

/** @param {{ model: Model }} properties */
function Found({ model }) {
  const check = model.answer.value?.check;
  const track = model.track.value;
  return html`<section class="footage-step">
    ${
      check
        ? html`<${Measured} model=${model} check=${check} />`
        : html`<p class="hint">
            Track "${track}" of ${model.run.name}: every tenth frame is compared with the masks, in
            every view.
          </p>`
    }
    <div class="step-actions">
      <${Begin} model=${model} verb="check" request=${{ track }} kind=${check ? "quiet small" : "primary"}>
        ${check ? "Measure again" : "Check the motion"}
      </${Begin}>
    </div>
  </section>`;
}

/** Another witness than the masks, of people: joints that a network sees, triangulated. */
function Witness(/** @type {{ model: Model }} */ { model }) {
  const seen = model.seen.value;
  const track = model.track.value;
  return html`<section class="footage-step">
    <h2>Another witness</h2>
    ${
      seen
        ? html`<p>
            Track "${track}" lies ${millimetres(seen.mean_mm)} from a network's joints,
            ${" "}${millimetres(seen.without_offsets_mm)} without each joint's constant offset; all
            of them are seen in ${percent(seen.seen)} of the frames.${" "}
            <a href=${`${model.here}/exports/${encodeURIComponent(seen.file)}`} download=${seen.file}>
              ${seen.file}
            </a>
          </p>`
        : html`<p class="hint">
            A network that knows people, and nothing of this body or its search, sees shoulders,
            elbows, wrists, hips, knees and ankles in every view; coarse by some centimetres.
          </p>`
    }
    <div class="step-actions">
      <${Begin} model=${model} verb="landmarks" request=${{ track }} kind="small">
        ${seen ? "Look again" : "Compare with a network's joints"}
      </${Begin}>
    </div>
  </section>`;
}

/**
 * What was corrected of a track, folded: it may be a line for every few frames.
 * @param {{ lines: string[] }} properties
 */
const Corrections = ({ lines }) => html`<details class="corrections">
  <summary>corrected in ${lines.length} ${lines.length === 1 ? "place" : "places"}</summary>
  <ul>
    ${lines.map((line) => html`<li>${line}</li>`)}
  </ul>
</details>`;

/** A track's name, by which it is looked at. */
const TrackChoice = (/** @type {any} */ { model, line: { name, made_by: made } }) => html`
  <label class="check">
    <input
      type="radio"
      name="setup-track"
      value=${name}
      checked=${name === model.track.value}
      aria-label=${`Show ${name}`}
      onChange=${() => model.choose(name).catch(complain)}
    />
    ${name === "raw" ? "raw (as searched)" : name}
  </label>
  ${
    name === model.answer.value?.usual &&
    html`<span class="badge good" title="Step Export takes this one, unless you choose another.">
      for export
    </span>`
  }
  ${Array.isArray(made.exchanged) && html`<${Corrections} lines=${made.exchanged} />`}
`;

/** The tracks, and what makes better ones. @param {{ model: Model }} properties */
function Better({ model }) {
  const tracks = model.tracks.value;
  const problem = model.truthProblem.value;
  const hasTruth = model.setup.detail.has_truth && !problem;
  const measured = tracks.find((line) => line.measured_frames);
  const part = measured && partWords(measured.measured_frames, measured.frames);
  const begin = (
    /** @type {string} */ verb,
    /** @type {string} */ made,
    /** @type {string} */ words,
    /** @type {string} */ again,
  ) => {
    const replace = tracks.some((line) => line.name === made);
    return html`<${Begin} model=${model} verb=${verb} request=${{ replace }} kind="small">
      ${replace ? again : words}
    </${Begin}>`;
  };
  return html`<section class="footage-step">
    <h2>Improve the track</h2>
    <${Table}
      heads=${["track", "jitter", ...(hasTruth ? [html`from truth<br />${part}`] : [])]}
      rows=${tracks.map((line) => [
        html`<${TrackChoice} model=${model} line=${line} />`,
        millimetres(line.jitter_mm),
        ...(hasTruth ? [millimetres(line.mean_mm)] : []),
      ])}
    />
    ${problem && html`<p class="notice">How far the tracks are from the truth is not known. ${problem}</p>`}
    <div class="step-actions">
      ${begin("refine", "refined", "Refine on the silhouettes", "Refine again")}
      ${begin("smooth", "smoothed", "Smooth in time", "Smooth again")}
    </div>
    <p class="hint">
      Each is stored beside the tracked one. The smoothed one is exported if there is one, else the
      refined one, else the one with corrected sides.
    </p>
    <${Failure} error=${model.failed.value} />
  </section>`;
}

/** @param {{ model: Model }} properties */
export function Panel({ model }) {
  if (!model.answer.value) return html`<${Failure} error=${model.failed.value} />`;
  const job = model.job.value;
  const { detail } = model.setup;
  const cancel = () => remove(`/api/track-jobs/${job.identifier}`).catch(complain);
  return html`
    <${Found} model=${model} />
    ${job && html`<${Progress} ...${progressOf(job, GOING[job.verb] || "working", cancel)} />`}
    ${detail.body.by_height && detail.cameras.length > 1 && html`<${Witness} model=${model} />`}
    <${Better} model=${model} />
  `;
}

/** The pictures of the frame that is looked at. @param {{ model: Model }} properties */
export function Beside({ model }) {
  if (!model.answer.value) return null;
  const frame = model.frame.value;
  const check = model.answer.value.check;
  const row = check?.frames.indexOf(frame) ?? -1;
  const noteOf = (/** @type {string} */ camera) => {
    const view = row < 0 ? -1 : (check?.cameras.indexOf(camera) ?? -1);
    if (!check || view < 0) return null;
    const [inside, covered] = [check.inside[row][view], check.covered[row][view]];
    return {
      words: `${percent(inside)} of the model in the mask, ${percent(covered)} of the mask under the model`,
      kind: inside !== null && inside < GOOD ? "bad" : "",
    };
  };
  return html`<${ViewWall}
    setup=${model.setup}
    shown=${{ run: model.run.name, frame, track: model.track.value }}
    noteOf=${noteOf}
  >
    <input
      type="range"
      min=${model.run.first}
      max=${model.last}
      value=${frame}
      aria-label="Checked frame"
      onInput=${({ target }) => into(model.frame)(Number(target.value))}
    />
  </${ViewWall}>`;
}
