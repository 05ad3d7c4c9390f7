// The first two minutes, in four steps beside the scene: what is seen, what the survival rate
// changes, how it fails, and what comes next. They are there while a session has the two runs that
// travel with the walk, until they are closed: the studio remembers that.

import { fetchJson, patch, readOnly } from "../api.js";
import { complain } from "../messages.js";
import { get, set } from "../state.js";
import { openCourse } from "./course_column.js";
import { follow, html, mount, signal } from "./component.js";
import { useKnob } from "./knob.js";
import { putBack } from "./trials.js";
import { playWhenShown, visit } from "./visiting.js";

const TEN = "ten-layers";
const ONE = "one-layer";
const FRAME = 10;
const LOST = 13;
const PREFERENCE = "first-steps";

const isClosed = signal(true);

/**
 * @param {number} step counted from 0
 * @param {string} run
 * @param {number} frame
 * @param {Record<string, string>} shown
 */
function look(step, run, frame, shown) {
  visit({ session: get("session"), run, frame, ...shown, step: step + 1 });
  playWhenShown().catch(complain);
}

function Seen() {
  return html`<p>
    Each dot is the hand, foot or head of one <b>particle</b>: a guess of the whole pose.${" "}
    <b>Annealing</b>: each of ten layers scores fifty guesses, keeps the best and draws new ones around
    them, ever more sharply (β), from <span class="first-layer">the first</span> to${" "}
    <span class="last-layer">the last</span>. The chart shows which parameter each layer settled.
  </p>`;
}

function Survival() {
  const knob = useKnob("survival");
  const move = (/** @type {any} */ event) => knob?.turn(Number(event.target.value));
  return html`<p>
      The <b>survival rate</b> is the share of particles that live on into the next layer. Low: the
      cloud closes at once, on a lucky guess. High: ten layers do not close it. Move it; the frame is
      searched again as you do.
    </p>
    <label class="first-knob">
      survival rate
      <input
        type="range"
        min="0.05"
        max="0.95"
        step="0.05"
        value=${knob?.value ?? 0.5}
        disabled=${readOnly || !knob}
        onInput=${move}
      />
      <output>${knob?.value.toFixed(2) ?? "–"}</output>
    </label>`;
}

function Failing() {
  const run = follow("run");
  const show = (/** @type {string} */ name) => {
    const other = name === TEN ? ONE : TEN;
    look(2, name, LOST, { panel: "compare", compared: `${get("session")}/${other}` });
  };
  return html`<p>
      The same pictures, the same start, 500 evaluations a frame each: <b>one layer</b> has lost the
      walker by frame ${LOST}, <b>ten layers</b> of fifty hold him; with each of ten seeds it is so. The
      chart has both errors over the frames.
    </p>
    <div class="group" role="group" aria-label="Which run is shown">
      ${[ONE, TEN].map(
        (name) => html`<button
          key=${name}
          class="toggle"
          aria-pressed=${String(run === name)}
          onClick=${() => show(name)}
        >
          ${name === ONE ? "one layer" : "ten layers"}
        </button>`,
      )}
    </div>`;
}

function Yours() {
  return html`<p>
      Videos, a printed board and eight guided steps make a motion file of your own take. Or go on
      with the search first.
    </p>
    <div class="group">
      <a class="button primary" href="/way?new">Your own cameras</a>
      <button onClick=${openCourse}>The course, beside the scene</button>
      <a class="button" href="/gallery">More sessions</a>
    </div>`;
}

/** The steps; `runs`: those that a step's words are about, any for none. */
const STEPS = [
  {
    name: "What you see",
    part: Seen,
    runs: [TEN],
    open: () => look(0, TEN, FRAME, { panel: "views", view: "variance" }),
  },
  {
    name: "Change survival",
    part: Survival,
    runs: [TEN],
    open: async () => {
      // What an earlier try moved is not what the layers on the screen were searched with.
      if (get("run") === TEN && get("moved")?.length) await putBack();
      look(1, TEN, FRAME, { panel: "views", view: "schedule" });
    },
  },
  {
    name: "Make it fail",
    part: Failing,
    runs: [TEN, ONE],
    open: () => look(2, ONE, LOST, { panel: "compare", compared: `${get("session")}/${TEN}` }),
  },
  {
    name: "Now your cameras",
    part: Yours,
    runs: /** @type {string[]} */ ([]),
    open: () => set({ step: 4 }),
  },
];

/**
 * What stands in a step's place while another run is open than those it is about.
 * @param {{ runs: string[], again: () => void }} properties
 */
const Elsewhere = ({ runs, again }) => html`<p>
    You are looking at <b>${follow("run")}</b>; this step is about <b>${runs.join(" and ")}</b>.
  </p>
  <div class="group"><button onClick=${again}>Back to this step</button></div>`;

async function close() {
  isClosed.value = true;
  set({ step: null });
  if (!readOnly) await patch("/api/preferences", { [PREFERENCE]: "closed" }).catch(complain);
}

function FirstSteps() {
  const session = follow("session");
  const sessions = follow("sessions") ?? [];
  const entry = sessions.find((/** @type {any} */ one) => one.name === session);
  const names = (entry?.runs ?? []).map((/** @type {any} */ one) => one.name);
  const run = follow("run");
  const isThere = [TEN, ONE].every((name) => names.includes(name)) && run;
  const at = Math.min(STEPS.length, Math.max(1, follow("step") ?? 1)) - 1;
  const step = STEPS[at];
  if (isClosed.value || !isThere || !step) return null;
  const go = (/** @type {number} */ to) => STEPS[to]?.open();
  const isAbout = !step.runs.length || step.runs.includes(run);
  const Part = step.part;
  return html`<section class="first-steps" aria-label="The first two minutes">
    <ol>
      ${STEPS.map(
        ({ name }, index) => html`<li key=${name}>
          <button
            class="quiet"
            aria-current=${index === at ? "step" : null}
            onClick=${() => go(index)}
          >
            <i>${index + 1}</i> ${name}
          </button>
        </li>`,
      )}
    </ol>
    <div class="first-words">
      ${isAbout ? html`<${Part} />` : html`<${Elsewhere} runs=${step.runs} again=${() => go(at)} />`}
    </div>
    <div class="first-end">
      ${
        at < STEPS.length - 1 &&
        html`<button class="primary" onClick=${() => go(at + 1)}>Next</button>`
      }
      <button
        class="icon"
        aria-label="Close the first steps for good"
        title="Close for good"
        onClick=${close}
      >
        ×
      </button>
    </div>
  </section>`;
}

/**
 * Show the steps in their place, unless they were closed, at the one that the address names
 * (`step`).
 */
export async function startFirstSteps() {
  const place = /** @type {HTMLElement} */ (document.getElementById("first-steps"));
  mount(place, html`<${FirstSteps} />`);
  try {
    const kept = await fetchJson("/api/preferences");
    isClosed.value = kept[PREFERENCE] === "closed";
  } catch (error) {
    complain(error);
  }
}
