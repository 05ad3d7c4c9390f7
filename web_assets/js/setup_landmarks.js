// A body from its film: its landmarks clicked in several views of a few frames, kept with the
// session as they are clicked, the body that is made of them, and a run.

import { fetchJson, post, put, remove, sessionPath } from "./api.js";
import { ClickViews } from "./calibration_points.js";
import { findJob, followJob, isGoing, progressOf } from "./jobs.js";
import { attempting, batch, html, into, signal } from "./studio/component.js";
import { Action, Failure, Progress, Select, Table, Toggle } from "./studio/parts.js";
import { NAME } from "./elements.js";

/** @import { Schemas } from "./api_types" */
/** @typedef {Schemas["ClickEntry"]} Click */
/** @typedef {Schemas["FilmState"]} Film */
/** @typedef {Schemas["CarriedState"]} Carried */

const PICTURE_HEIGHT = 1080;
const ALL = "";
/** Where the jobs are. */
const FILMS = "/api/bodies-from-film";
const CARRYINGS = "/api/carried-clicks";

/**
 * What is clicked, and what can be done.
 * @param {import("./setup.js").Setup} setup
 * @param {{ name: string, label: string }[]} bodies
 * @param {string} first whose tree is taken at first
 */
export function landmarksOf(setup, bodies, first) {
  const here = sessionPath(setup.session);
  const like = signal(first);
  const known = signal(/** @type {string[]} */ ([]));
  const clicks = signal(/** @type {Click[]} */ ([]));
  const isClicking = signal(false);
  const frame = signal(0);
  /** The landmark that is clicked. */
  const chosen = signal("");
  /** The one camera that is shown, "" for all. */
  const camera = signal(ALL);
  const film = signal(/** @type {Film | null} */ (null));
  const carried = signal(/** @type {Carried | null} */ (null));
  const failed = signal(/** @type {any} */ (null));
  const attempt = attempting(failed);
  let saving = Promise.resolve();
  let isLeft = false;

  const load = () =>
    attempt(async () => {
      const answer = await fetchJson(`${here}/landmarks?like=${encodeURIComponent(like.value)}`);
      batch(() => {
        known.value = answer.known;
        clicks.value = /** @type {Click[]} */ (answer.clicks);
        if (!answer.known.includes(chosen.value)) chosen.value = answer.known[0] ?? "";
      });
    });

  /** Show these clicks, and keep them, one request after the other. @param {Click[]} next */
  function keep(next) {
    clicks.value = next;
    saving = saving.then(() => attempt(() => put(`${here}/landmarks`, { clicks: clicks.value })));
    return saving;
  }

  const isOf = (/** @type {Click} */ one, /** @type {string} */ landmark) =>
    one.frame === frame.value && one.landmark === landmark;

  /**
   * Follow a job to its end.
   * @param {{ value: any }} state
   * @param {string} at its addresses begin so
   * @param {() => Promise<any>} begin
   */
  const follow = (state, at, begin) =>
    attempt(async () => {
      state.value = null;
      const begun = await begin();
      state.value = begun;
      try {
        const path = `${at}/${begun.identifier}`;
        const ended = await followJob(
          path,
          (job) => (state.value = job),
          () => isLeft,
        );
        if (ended) state.value = ended;
      } catch (error) {
        state.value = null;
        throw error;
      }
    });

  for (const [state, at, kind] of /** @type {const} */ ([
    [film, FILMS, "body-from-film"],
    [carried, CARRYINGS, "carry-clicks"],
  ]))
    findJob({ session: setup.session, kind })
      .then((job) => {
        if (isGoing(job)) follow(state, at, async () => job);
        else state.value = job;
      })
      .catch(into(failed));
  load();

  return {
    setup,
    bodies,
    like,
    known,
    clicks,
    isClicking,
    frame,
    chosen,
    camera,
    film,
    carried,
    failed,
    keep,
    isOf,
    /** @param {string} name */
    take: (name) => {
      like.value = name;
      return load();
    },
    /** @param {string} view @param {[number, number]} pixel */
    click: (view, [x, y]) => {
      const [landmark, number] = [chosen.value, frame.value];
      const others = clicks.value.filter((one) => !(isOf(one, landmark) && one.camera === view));
      return keep([...others, { frame: number, camera: view, landmark, x, y }]);
    },
    removeChosen: () => keep(clicks.value.filter((one) => !isOf(one, chosen.value))),
    /** @param {string} name */
    make: (name) =>
      follow(film, FILMS, async () => {
        await saving;
        return post(`${here}/body-from-film`, { like: like.value, save_as: name, replace: true });
      }),
    /** A run by the body that was made of the clicks, else by the one whose tree is taken. @param {boolean} held */
    carry: (held) =>
      follow(carried, CARRYINGS, async () => {
        await saving;
        const body = film.value?.made?.saved || like.value;
        return post(`${here}/carry-clicks`, { body, held });
      }),
    stop: () => {
      isLeft = true;
    },
  };
}

/** @typedef {ReturnType<typeof landmarksOf>} Model */

/** What is made of the clicks. @param {{ model: Model }} properties */
export function FilmPanel({ model }) {
  const [clicks, film, carried] = [model.clicks.value, model.film.value, model.carried.value];
  const frames = new Set(clicks.map((one) => one.frame)).size;
  const isClicking = model.isClicking.value;
  const cancel = () => remove(`${FILMS}/${film?.identifier}`);
  const cancelRun = () => remove(`${CARRYINGS}/${carried?.identifier}`);
  const made = film?.state === "done" ? film.made : null;
  const run = carried?.state === "done" ? carried : null;
  return html`<details class="background-quality" open=${clicks.length > 0 || isClicking}>
    <summary>A body from its film</summary>
    <div class="background-make">
    <p class="hint">
      For what no body fits: click its joints in two views or more of a few frames, in poses as
      different as there are. The tree is another body's; lengths, and where there are masks radii,
      are measured.
    </p>
    <${Select}
      label="Tree of"
      options=${model.bodies.map((one) => [one.name, one.label])}
      value=${model.like.value}
      take=${model.take}
    />
    <div class="step-actions">
      <${Action} act=${() => into(model.isClicking)(!isClicking)}>
        ${isClicking ? "Back from clicking" : "Click landmarks"}
      </${Action}>
      <span class="hint">
        ${clicks.length} ${clicks.length === 1 ? "click" : "clicks"} in ${frames}${" "}
        ${frames === 1 ? "frame" : "frames"}
      </span>
    </div>
    ${
      isGoing(film)
        ? html`<${Progress} ...${progressOf(film, "beginning", cancel)} />`
        : clicks.length > 0 && html`<${Making} model=${model} />`
    }
    <${Failure} error=${model.failed.value} />
    ${made && html`<${Made} session=${model.setup.session} made=${made} />`}
    ${
      isGoing(carried)
        ? html`<${Progress} ...${progressOf(carried, "beginning", cancelRun)} />`
        : clicks.length > 0 && !isGoing(film) && html`<${Carrying} model=${model} />`
    }
    ${run && html`<${RunOfClicks} session=${model.setup.session} run=${run} />`}
    </div>
  </details>`;
}

/** The new body's name. @param {{ model: Model }} properties */
function Making({ model }) {
  const usual = `${model.setup.session}-body`;
  return html`<form
    class="background-make"
    onSubmit=${(event) => {
      event.preventDefault();
      model.make(event.target.elements.film_name.value.trim() || usual);
    }}
  >
    <label>
      Name of the body
      <input type="text" name="film_name" placeholder=${usual} ...${NAME} required=${false} />
    </label>
    <div class="step-actions"><button type="submit">Make the body</button></div>
  </form>`;
}

/** How the clicks become a run. @param {{ model: Model }} properties */
function Carrying({ model }) {
  return html`<form
    class="background-make"
    onSubmit=${(event) => {
      event.preventDefault();
      model.carry(event.target.elements.held.checked);
    }}
  >
    <p class="hint">
      Where no mask shows the limbs, the clicked poses can be carried to the frames between by how
      the limbs look: click every third frame or so, more where a limb swings. It takes some
      seconds a frame.
    </p>
    <label class="check"><input type="checkbox" name="held" /> The body is held in one place</label>
    <div class="step-actions"><button type="submit">Make a run of the clicks</button></div>
  </form>`;
}

/** The run that was made. */
function RunOfClicks(/** @type {{ session: string, run: Carried }} */ { session, run }) {
  const query = new URLSearchParams({ session, run: run.run });
  return html`
    <p>Run <a href=${`/?${query}`}>${run.run}</a> is made: look through it in the studio.</p>
    ${run.notes.map((words) => html`<p class="notice">${words}</p>`)}
  `;
}

/** The body that was made. */
function Made(/** @type {{ session: string, made: any }} */ { session, made }) {
  const decided = made.sizes.filter((one) => one.decided);
  const query = new URLSearchParams({ session, body: made.saved });
  return html`
    <p>
      <a href=${`/bodies?${query}`}>${made.saved}</a> is saved: look at it there, and correct it.
      Half of the clicks lie within ${made.off.toFixed(1)} pixels of its landmarks, nine of ten
      within ${made.off_most.toFixed(1)}.
    </p>
    ${made.notes.map((words) => html`<p class="notice">${words}</p>`)}
    <${Table}
      kind="sizes"
      heads=${["Size (mm)", "before", "after", "±"]}
      rows=${decided.map((one) => [
        one.name.replaceAll("_", " "),
        one.before.toFixed(1),
        one.after.toFixed(1),
        one.deviation.toFixed(1),
      ])}
    />
  `;
}

/** The pictures to click on. @param {{ model: Model }} properties */
export function LandmarkClicks({ model }) {
  const { setup } = model;
  const [frame, chosen, only] = [model.frame.value, model.chosen.value, model.camera.value];
  const cameras = setup.detail.cameras.filter((one) => only === ALL || one.name === only);
  const count = Math.min(...setup.detail.cameras.map((one) => one.frame_count));
  const here = model.clicks.value.filter((one) => one.frame === frame);
  const go = (/** @type {number} */ to) => into(model.frame)(Math.max(0, Math.min(count - 1, to)));
  const views = (/** @type {string} */ name) => here.filter((one) => one.landmark === name).length;
  return html`<div class="calibrated landmarks">
    <div class="pictures-bar">
      <output>frame ${frame}</output>
      <input
        type="range"
        aria-label="Frame to click in"
        min="0"
        max=${count - 1}
        value=${frame}
        onInput=${({ target }) => go(Number(target.value))}
      />
      <${Action} kind="small" act=${() => go(frame - 1)} aria-label="A frame back">‹</${Action}>
      <${Action} kind="small" act=${() => go(frame + 1)} aria-label="A frame on">›</${Action}>
      <${Select}
        title="One view is shown larger"
        options=${[[ALL, "all views"], ...setup.detail.cameras.map((one) => [one.name, one.name])]}
        value=${only}
        take=${into(model.camera)}
        aria-label="View to click in"
      />
      <${Action} kind="quiet small" act=${model.removeChosen} disabled=${!views(chosen)}>
        Remove ${chosen}
      </${Action}>
    </div>
    <p class="hint">
      Choose a landmark, and click it in each view that shows it; a second click in the same view
      moves it. Everything is kept as you click.
    </p>
    <div class="point-list">
      ${model.known.value.map(
        (name, at) => html`<${Toggle}
          key=${name}
          isOn=${name === chosen}
          act=${() => into(model.chosen)(name)}
        >
          ${at + 1} ${name}${views(name) ? ` · ${views(name)}` : ""}
        </${Toggle}>`,
      )}
    </div>
    <${Failure} error=${model.failed.value} />
    <${ClickViews}
      cameras=${cameras}
      picture=${(camera) =>
        `${sessionPath(setup.session)}/frames/${frame}/views/${encodeURIComponent(camera)}.jpg?height=${PICTURE_HEIGHT}`}
      click=${model.click}
      marks=${(camera) =>
        here
          .filter((one) => one.camera === camera)
          .map((one) => ({
            pixel: [one.x, one.y],
            words: 1 + model.known.value.indexOf(one.landmark),
            isChosen: one.landmark === chosen,
          }))}
    />
  </div>`;
}
