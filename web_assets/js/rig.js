// Where the cameras should stand: what errors to expect of a run's rig and of others, asked for and
// drawn.

import { fetchJson, post, readOnly, remove, runPath } from "./api.js";
import { byId, dotted } from "./elements.js";
import { listen } from "./events.js";
import { findJob, isGoing, progressOf } from "./jobs.js";
import { complain } from "./messages.js";
import { Body, Legend, metres, Plan, PRESENT } from "./rig_drawing.js";
import { studioPath } from "./sessions.js";
import { attempting, html, mount, signal } from "./studio/component.js";
import { Action, Check, Failure, Progress, Select } from "./studio/parts.js";
import { startTheme } from "./theme.js";

/** @import { Schemas } from "./api_types" */
/** @typedef {Schemas["RigErrors"]} Rig */
/** @typedef {[number, number, number]} Place */

const address = new URLSearchParams(location.search);
const here = { session: address.get("session") ?? "", run: address.get("run") ?? "" };
const path = `${runPath(here.session, here.run)}/rig`;
/** Beside the subject, where a camera is put that is then moved. */
const BESIDE_MM = 2500;

const known = signal(/** @type {Schemas["RunRig"] | null} */ (null));
const sessions = signal(/** @type {any[] | null} */ (null));
const job = signal(/** @type {any} */ (null));
const failed = signal(/** @type {any} */ (null));
/** The name of the rig that is shown. */
const shown = signal(PRESENT);
/** Cameras put elsewhere, mm: by name those that stand there now, by number new ones. */
const moved = signal(/** @type {Record<string, Place>} */ ({}));
const added = signal(/** @type {Place[]} */ ([]));
/** The height of the grid that is shown, mm. */
const height = signal(/** @type {number | null} */ (null));
const withTwins = signal(false);
const attempt = attempting(failed);
/** The kind of rig that was asked for last. */
let asked = "present";

async function read() {
  const answer = await fetchJson(path);
  known.value = answer;
  const of = answer.study;
  if (!of) return;
  const newest = of.rigs.filter((rig) => rig.kind === asked).at(-1);
  const isThere = of.rigs.some((rig) => rig.name === shown.value);
  if (newest) shown.value = newest.name;
  else if (!isThere) shown.value = PRESENT;
  if (!of.places.some(({ place }) => place[2] === height.value))
    height.value = (of.places.find(({ order }) => order === 1) ?? of.places[0])?.place[2] ?? null;
}

/** @param {string} kind @param {Record<string, any>} [request] */
const ask = (kind, request = {}) =>
  attempt(async () => {
    asked = kind;
    const twins = kind !== "present" && withTwins.value;
    job.value = await post(path, { ...request, twins });
  });

const askChanged = () =>
  ask("changed", {
    move: Object.entries(moved.value).map(([name, place]) => `${name}=${place.join(",")}`),
    add: added.value.map((place) => place.join(",")),
  });

/** @param {string} name @param {Place} place */
function put(name, place) {
  const rounded = /** @type {Place} */ (place.map((one) => Math.round(one / 10) * 10));
  const number = Number(name);
  if (name !== "" && Number.isInteger(number))
    added.value = added.value.map((one, at) => (at === number ? rounded : one));
  else moved.value = { ...moved.value, [name]: rounded };
}

/** @param {Place} place */
const add = (place) => {
  added.value = [...added.value, /** @type {Place} */ (place.map(Math.round))];
};

/** @param {string} name */
function putBack(name) {
  const number = Number(name);
  if (name !== "" && Number.isInteger(number))
    added.value = added.value.filter((_, at) => at !== number);
  else
    moved.value = Object.fromEntries(Object.entries(moved.value).filter(([one]) => one !== name));
}

const words = (/** @type {number | null} */ value) => (value === null ? "–" : value.toFixed(1));

/** @param {{ rig: Rig, points: string[] }} properties */
function RigLine({ rig, points }) {
  const expected = rig.tracked_mm ?? rig.predicted_mm;
  const worst = expected.indexOf(Math.max(...expected));
  const times = rig.by_seed.length;
  return html`<tr aria-current=${String(rig.name === shown.value)}>
    <td class="wraps">
      <label class="check">
        <input
          type="radio"
          name="rig"
          checked=${rig.name === shown.value}
          onChange=${() => {
            shown.value = rig.name;
          }}
        />
        ${rig.name}
      </label>
    </td>
    <td>${rig.cameras.length}</td>
    <td>${rig.kind === "present" ? "–" : words(rig.predicted)}</td>
    <td>${words(rig.tracked)}${times > 1 && html` <small>${times} times</small>`}</td>
    <td>${points[worst]} <small>${words(expected[worst])}</small></td>
  </tr>`;
}

/** @param {{ of: Schemas["RigStudy"] }} properties */
const Rigs = ({ of }) => html`<section class="card-box">
  <h2>Rigs</h2>
  <div class="scrolls" tabindex="0" role="group" aria-label="Rigs">
    <table class="figures">
      <thead>
        <tr>
          <th>Rig</th>
          <th>Cameras</th>
          <th>Predicted, mm</th>
          <th>Drawn and tracked, mm</th>
          <th>Worst joint, mm</th>
        </tr>
      </thead>
      <tbody>
        ${of.rigs.map((rig) => html`<${RigLine} key=${rig.name} rig=${rig} points=${of.points} />`)}
      </tbody>
    </table>
  </div>
</section>`;

/** @param {{ of: Schemas["RigStudy"], rig: Rig }} properties */
function Joints({ of, rig }) {
  const expected = rig.tracked_mm ?? rig.predicted_mm;
  const present = of.rigs[0].tracked_mm ?? of.rigs[0].predicted_mm;
  const most = Math.max(...expected, ...present);
  const change = (/** @type {number} */ at) => expected[at] - present[at];
  return html`<section class="card-box">
    <h2>Expected error by joint, ${rig.name}</h2>
    <p class="hint">${rig.tracked_mm ? "Drawn and tracked." : "Predicted; not drawn and tracked."}</p>
    <div class="rig-joints">
      <div>
        <${Body} figure=${of.figure} points=${of.points} values=${expected} most=${most} />
        <${Legend} from="0 mm" to=${`${most.toFixed(0)} mm`} />
      </div>
      <div class="scrolls" tabindex="0" role="group" aria-label="By joint">
        <table class="figures">
          <thead>
            <tr>
              <th>Joint</th>
              <th>Error, mm</th>
              <th title="Against the rig as it is">Change, mm</th>
            </tr>
          </thead>
          <tbody>
            ${of.points.map(
              (point, at) => html`<tr>
                <td>${point}</td>
                <td>${words(expected[at])}</td>
                <td>
                  ${rig.kind === "present" ? "–" : `${change(at) < 0 ? "−" : "+"}${words(Math.abs(change(at)))}`}
                </td>
              </tr>`,
            )}
          </tbody>
        </table>
      </div>
    </div>
  </section>`;
}

/** A place in metres, to be typed. @param {{ label: string, place: Place, take: (place: Place) => void }} properties */
const PlaceFields = ({ label, place, take }) =>
  ["x", "y", "height"].map(
    (axis, at) => html`<label>
      ${axis}, m
      <input
        type="number"
        step="0.1"
        aria-label=${`${label}: ${axis}, m`}
        value=${metres(place[at])}
        onChange=${({ target }) => {
          const value = Number(target.value);
          if (target.value !== "" && Number.isFinite(value))
            take(/** @type {Place} */ (place.map((one, k) => (k === at ? 1000 * value : one))));
        }}
      />
    </label>`,
  );

/** @param {{ of: Schemas["RigStudy"] }} properties */
function Changed({ of }) {
  const cameras = of.rigs[0].cameras;
  const places = [
    ...Object.entries(moved.value),
    ...added.value.map((place, at) => /** @type {[string, Place]} */ ([String(at), place])),
  ];
  const nameOf = (/** @type {string} */ name) =>
    cameras.some((one) => one.name === name) ? name : `new ${Number(name) + 1}`;
  const rest = cameras.filter((one) => !moved.value[one.name]);
  return html`<fieldset>
    <legend>Move or add cameras</legend>
    <p class="hint">
      Drag a camera in the plan, or choose it there and press the arrow keys. All look at the subject.
    </p>
    ${places.map(
      ([name, place]) => html`<div class="rig-place" key=${name}>
        <b>${nameOf(name)}</b>
        <${PlaceFields} label=${nameOf(name)} place=${place} take=${(to) => put(name, to)} />
        <button
          type="button"
          class="icon quiet small"
          aria-label=${`Put ${nameOf(name)} back`}
          onClick=${() => putBack(name)}
        >
          ×
        </button>
      </div>`,
    )}
    <div class="step-actions">
      ${
        rest.length > 0 &&
        html`<${Select}
          aria-label="Camera to move"
          options=${[["", "Move a camera …"], ...rest.map((one) => [one.name, one.name])]}
          value=""
          take=${(name) => {
            const one = cameras.find((camera) => camera.name === name);
            if (one) put(name, /** @type {Place} */ (one.place));
          }}
        />`
      }
      <button
        type="button"
        onClick=${() => {
          const [x, y] = of.subject;
          const high = cameras.reduce((sum, one) => sum + one.place[2], 0) / cameras.length;
          add([x + BESIDE_MM, y, high]);
        }}
      >
        Add a camera
      </button>
      <${Action} kind="primary" act=${askChanged} disabled=${!places.length}>Try this rig</${Action}>
    </div>
  </fieldset>`;
}

function askBest(event) {
  event.preventDefault();
  const given = new FormData(event.target);
  const heights = String(given.get("heights"))
    .split(/[\s;]+/)
    .filter(Boolean)
    .map((one) => 1000 * Number(one.replace(",", ".")));
  if (heights.some((one) => !Number.isFinite(one))) {
    failed.value = { message: "A height is no number.", hint: "Write metres, such as 1.0 2.5." };
    return;
  }
  ask("best", {
    best: Number(given.get("best")),
    instead: given.get("instead") === "instead",
    heights,
  });
}

const Best = () => html`<form onSubmit=${askBest}>
  <fieldset>
    <legend>Best places of a grid over the room</legend>
    <div class="rig-best">
      <label>Cameras<input type="number" name="best" min="1" max="12" value="1" /></label>
      <label>
        Where
        <select name="instead">
          <option value="beside">beside the present ones</option>
          <option value="instead">instead of them</option>
        </select>
      </label>
      <label>
        Heights, m
        <input type="text" name="heights" placeholder="as the cameras' now" />
      </label>
      <button type="submit" class="primary">Find them</button>
    </div>
  </fieldset>
</form>`;

/** @param {{ of: Schemas["RigStudy"] | null }} properties */
function Ask({ of }) {
  if (readOnly) return null;
  if (isGoing(job.value)) {
    const cancel = () => remove(`/api/rig/${job.value.identifier}`).then(() => undefined, complain);
    return html`<section class="card-box">
      <${Progress} ...${progressOf(job.value, "beginning", cancel)} />
      <p class="hint">What is done is kept as it comes.</p>
    </section>`;
  }
  const wrong = failed.value ?? (job.value?.state === "failed" ? job.value : null);
  if (!of)
    return html`<section class="card-box">
      <p class="hint">
        The run is drawn again and tracked, in the background: two to four times as long as it took. Then
        other rigs are predicted in seconds. The run does not change.
      </p>
      <${Failure} error=${wrong} />
      <div class="step-actions">
        <${Action} kind="primary" act=${() => ask("present")}>Measure this rig</${Action}>
      </div>
    </section>`;
  return html`<section class="card-box compare-form rig-ask">
    <h2>Other rigs</h2>
    <${Failure} error=${wrong} />
    <${Check}
      checked=${withTwins.value}
      take=${(isOn) => {
        withTwins.value = isOn;
      }}
    >
      Also draw and track them: surer, and for each two to four times as long as the run took
    </${Check}>
    <fieldset>
      <legend>Leave one out</legend>
      <div class="step-actions">
        <${Action} act=${() => ask("without", { leave_out: true })}>Leave each out</${Action}>
      </div>
    </fieldset>
    <${Changed} of=${of} />
    <${Best} />
  </section>`;
}

/** @param {{ of: Schemas["RigStudy"] }} properties */
function Room({ of }) {
  const rig = of.rigs.find((one) => one.name === shown.value) ?? of.rigs[0];
  const heights = [...new Set(of.places.map(({ place }) => place[2]))].sort((a, b) => a - b);
  const places = of.places.filter(({ place }) => place[2] === height.value);
  const gains = of.places.map(({ predicted }) => Math.max(0, of.rigs[0].predicted - predicted));
  return html`<section class="card-box">
    <h2>The room from above, ${rig.name}</h2>
    <${Plan}
      of=${of}
      rig=${rig}
      places=${places}
      most=${Math.max(...gains, 0.01)}
      moved=${moved.value}
      added=${added.value}
      put=${readOnly ? null : put}
      add=${readOnly ? null : add}
    />
    ${
      places.length > 0 &&
      html`<${Legend}
        from="a camera more gains nothing"
        to=${`${Math.max(...gains).toFixed(1)} mm, predicted`}
      />`
    }
    ${
      heights.length > 1 &&
      html`<${Select}
        label="Height of the places"
        options=${heights.map((one) => [String(one), `${metres(one)} m`])}
        value=${String(height.value)}
        take=${(value) => {
          height.value = Number(value);
        }}
      />`
    }
    ${
      places.length > 0 &&
      html`<p class="hint">
        ${dotted("Numbers: chosen places", "a click on a place puts a camera there", "crosses: too little of the body in the picture")}
      </p>`
    }
  </section>`;
}

/** Without a run: which there are. */
const Chooser = () => html`<div class="nothing">
  <h1>Where should the cameras stand?</h1>
  <p>This is asked of a run that has been tracked.</p>
  ${
    sessions.value === null
      ? html`<p role="status">The sessions are being read …</p>`
      : sessions.value.some((one) => one.runs.length)
        ? html`<${Select}
            aria-label="Run"
            options=${[
              ["", "Choose a run …"],
              ...sessions.value.flatMap((one) =>
                one.runs.map((run) => [`${one.name}/${run.name}`, `${one.name} / ${run.name}`]),
              ),
            ]}
            value=""
            take=${(value) => {
              const [session, run] = value.split("/");
              if (run) location.search = String(new URLSearchParams({ session, run }));
            }}
          />`
        : html`<p>There is no run yet: track one in the <a href="/">studio</a>.</p>`
  }
</div>`;

function Page() {
  if (!here.run) return html`<${Chooser} />`;
  const { study = null, stale = "", words: sentences = [] } = known.value ?? {};
  const holds = study && !stale ? study : null;
  const rig = holds && (holds.rigs.find((one) => one.name === shown.value) ?? holds.rigs[0]);
  return html`<div class="column rig-page">
    <div class="head">
      <div>
        <h1>Where should the cameras stand?</h1>
        <p class="lead">
          Run <a href=${studioPath(here.session, here.run)}>${here.session} / ${here.run}</a>, for the
          motion in it.
        </p>
      </div>
    </div>
    ${
      known.value === null
        ? html`<p class="hint" role="status">What is known of the rig is being read …</p>`
        : html`<ul class="words" aria-label="What is known">
            ${sentences.map((one) => html`<li>${one}</li>`)}
          </ul>`
    }
    ${
      holds &&
      rig &&
      html`<div class="pair"><${Room} of=${holds} /><${Joints} of=${holds} rig=${rig} /></div>
        <${Rigs} of=${holds} />`
    }
    ${known.value === null ? html`<${Failure} error=${failed.value} />` : html`<${Ask} of=${holds} />`}
  </div>`;
}

async function start() {
  startTheme();
  mount(byId("content"), html`<${Page} />`);
  if (!here.run) {
    sessions.value = (await fetchJson("/api/sessions")).sessions;
    return;
  }
  listen("rig", (/** @type {any} */ event) => {
    if (event.session !== here.session || event.run !== here.run) return;
    const wasGoing = isGoing(job.value);
    job.value = event;
    if (wasGoing && !isGoing(event)) read().catch(complain);
  });
  await attempt(async () => {
    const line = { session: here.session, kind: "rig" };
    [job.value] = await Promise.all([findJob(line, (one) => one.run === here.run), read()]);
    if (job.value?.state === "failed") job.value = null;
  });
}

start().catch(complain);
