// The guided set-up: the stepper, the step's panel, pictures or the scene beside it.
//
// A step's module `setup_<step>.js` (start-pose: setup_start_pose.js) exports `modelOf(setup,
// loaded)`, what the step knows and what can be done, and what shows it, two components of
// `{ model }`: `Panel`, and `Beside` for the pictures at the right. `loaded` is what its
// `load(session)` resolves with, where it exports one; the model's `stop` ends what must not go on
// when another step is shown. One `button.primary` a step: Enter presses the first that is shown.

import { fetchJson, post, sessionPath } from "./api.js";
import { byId, NAME, offer } from "./elements.js";
import { listen, listenToAll, startEvents } from "./events.js";
import { isGoing } from "./jobs.js";
import { acceptDrops } from "./dropping.js";
import { complain } from "./messages.js";
import { sessionWords } from "./sessions.js";
import { batch, effect, html, mount, signal } from "./studio/component.js";
import { closeDialog, openForm } from "./studio/dialogs.js";
import { Action, Failure } from "./studio/parts.js";
import { startWorkList } from "./studio/work_list.js";
import { startTheme } from "./theme.js";

/**
 * @import { MessageOf, MessageType, Schemas } from "./api_types"
 * @typedef {{ begin?: boolean, dropped?: File[] }} Asked what a step does at once: track; take
 *   files that were dropped
 * @typedef Setup what a step is given
 * @property {string} session
 * @property {Schemas["SessionDetail"]} detail the session as it was when the step was shown (no
 *   cameras before the calibration)
 * @property {Schemas["Workflow"]["steps"][number] | undefined} step this step as the server sees it
 *   now
 * @property {() => Promise<any>} refresh load the steps again, after something was made
 * @property {(step: string, asked?: Asked) => Promise<void>} go show another step; `asked`: to do
 *   at once
 * @property {Asked} asked what the step is asked to do at once
 * @property {<T extends MessageType>(type: T, handler: (event: MessageOf<T>) => void) => void} on
 *   hear events of this session while the step is shown
 */
/** What changes how far a session is. @type {MessageType[]} */
const CHANGING = ["sessions", "track", "subject", "initialise", "export", "state", "import"];
/** @typedef {Schemas["Workflow"]["steps"][number]} StepStatus */
/** @type {Record<StepStatus["step"], { name: string, lead: string }>} */
const STEPS = {
  footage: {
    name: "Footage",
    lead: "One video, or one folder of pictures, per camera, all of the same recording.",
  },
  calibration: {
    name: "Calibration",
    lead: "Positions and lenses of the cameras, and whether they are right.",
  },
  background: {
    name: "Background",
    lead: "The subject's mask in each picture, and how far the views agree.",
  },
  subject: { name: "Subject", lead: "The tracked body and its measures." },
  "start-pose": {
    name: "Start pose",
    lead: "The subject's pose in the frame where tracking begins.",
  },
  track: { name: "Track", lead: "The motion, frame by frame." },
  check: { name: "Check", lead: "Whether the motion fits the pictures, and how to improve it." },
  export: { name: "Export", lead: "The motion as a file for other programs." },
};
/** @type {Record<StepStatus["state"], string>} */
const STATES = {
  done: "done",
  ready: "to be done",
  blocked: "not yet possible",
  stale: "to be done again",
  running: "running",
};

/** @type {HTMLElement} */
const stepper = byId("stepper");
/** @type {HTMLElement} */
const panel = byId("step");
const which = byId("which");

let session = "";
/** How far the session is. */
const steps = signal(/** @type {StepStatus[]} */ ([]));
/** The step that is shown. */
const shown = signal("");
/** What is shown instead of a step: markup. */
const instead = signal(/** @type {any} */ (null));
/** The step's module and model once they are there, or why they are not. */
const opened = signal(/** @type {{ module?: any, model?: any, error?: any }} */ ({}));
let opening = 0; // rises with every step, so that a slow one knows that it is too late
let releases = []; // what the step hears, and what stops it
let isRestoring = true; // whether the step that is shown next follows from the address

const statusOf = (name) => steps.value.find((one) => one.step === name);
const beside = (by) =>
  steps.value[steps.value.findIndex((one) => one.step === shown.value) + by]?.step;
const moduleOf = (name) => import(`./setup_${name.replaceAll("-", "_")}.js`);

/** @param {{ status: StepStatus }} properties */
function StepEntry({ status: { step, state, optional, words, why } }) {
  const title = `${STEPS[step].name}: ${STATES[state]}${optional ? " (optional)" : ""}`;
  return html`<button
    type="button"
    title=${title}
    aria-label=${[title, words, why].filter(Boolean).join(". ")}
    aria-current=${step === shown.value ? "step" : null}
    data-step=${step}
    data-state=${state}
    data-doubt=${state === "done" && why ? "" : null}
    onClick=${() => go(step)}
  >
    <i class="step-dot"></i><span class="name">${STEPS[step].name}</span>
    ${words && html`<span class="words">${words}</span>`}
    ${why && html`<span class="why">${why}</span>`}
  </button>`;
}

const Stepper = () =>
  steps.value.length > 0 &&
  html`<ol>
    ${steps.value.map(
      (status) => html`<li key=${status.step}><${StepEntry} status=${status} /></li>`,
    )}
  </ol>`;

/** The step, between its heading and the ways to those before and after. */
function Step() {
  if (instead.value) return instead.value;
  const status = statusOf(shown.value);
  if (!status) return null;
  const [before, next] = [beside(-1), beside(1)];
  const { module, model, error } = opened.value;
  return html`
    <header class="step-head">
      <h1>${STEPS[status.step].name}</h1>
      <p class="lead">${STEPS[status.step].lead}</p>
      ${status.why && html`<p class="notice">${status.why}</p>`}
    </header>
    <div class="step-place">
      ${module && html`<${module.Panel} model=${model} />`}
      ${error && html`<p>This step cannot be shown.</p><${Failure} error=${error} />`}
    </div>
    <div class="step-foot">
      ${before && html`<${Action} kind="quiet" act=${() => go(before)}>‹ ${STEPS[before].name}</${Action}>`}
      <span class="spring"></span>
      ${
        next &&
        html`<${Action} kind="quiet next-step" act=${() => go(next)}>${STEPS[next].name} ›</${Action}>`
      }
    </div>
  `;
}

function Beside() {
  const { module, model } = opened.value;
  return module && html`<${module.Beside} model=${model} />`;
}

effect(() => {
  panel.dataset.state = statusOf(shown.value)?.state ?? "";
});

/** Load how far the session is. */
async function refresh() {
  const wanted = session;
  const answer = await fetchJson(`${sessionPath(wanted)}/way`);
  if (wanted === session) steps.value = answer.steps;
}

function release() {
  for (const each of releases) each();
  releases = [];
  opened.value = {};
}

/** Show a step; "back" leads to the one before. @param {Asked} [asked] */
async function go(name, asked = {}) {
  if (!statusOf(name)) return;
  const turn = ++opening;
  batch(() => {
    release();
    instead.value = null;
    shown.value = name;
  });
  const address = `?session=${encodeURIComponent(session)}&step=${name}`;
  if (location.search !== address) {
    if (isRestoring) history.replaceState(null, "", address);
    else history.pushState(null, "", address);
  }
  isRestoring = false;
  document.title = `${STEPS[name].name} · ${session} · Capture studio`;
  panel.scrollTop = 0;
  if (statusOf(name)?.state === "blocked") return;
  try {
    const [[module, loaded], detail] = await Promise.all([
      moduleOf(name).then(async (one) => [one, await one.load?.(session)]),
      fetchJson(sessionPath(session)),
    ]);
    if (turn !== opening) return;
    const model = module.modelOf(setupOf(detail, asked), loaded);
    if (model.stop) releases.push(model.stop);
    opened.value = { module, model };
  } catch (error) {
    opened.value = { error };
  }
}

/** What a step's module is given. @returns {Setup} */
const setupOf = (detail, asked) => ({
  session,
  detail,
  refresh,
  go,
  asked,
  get step() {
    return statusOf(shown.value);
  },
  on: (type, handler) => {
    releases.push(
      listen(type, (event) => {
        if (event.session === session) handler(event);
      }),
    );
  },
});

/** Open a session at its next step, or the one that is wanted. */
async function open(name, wanted = "") {
  session = name;
  which.value = name;
  try {
    const answer = await fetchJson(`${sessionPath(name)}/way`);
    batch(() => {
      shown.value = "";
      steps.value = answer.steps;
    });
    await go(statusOf(wanted) ? wanted : answer.next || "footage");
  } catch (error) {
    batch(() => {
      release();
      steps.value = [];
      instead.value = html`<${Failure} error=${error} />`;
    });
  }
}

/** The sessions of the workspace in the bar's list; which there are. */
async function drawSessions() {
  const { sessions } = await fetchJson("/api/sessions");
  offer(
    which,
    sessions.map((one) => [one.name, sessionWords(one)]),
    session,
  );
  which.hidden = !sessions.length;
  return sessions.map((one) => one.name);
}

/**
 * The form of a session that begins empty. The body is asked for first of all: its size is that of
 * the space in which it is sought.
 */
async function beginForm(dropped = /** @type {File[] | null} */ (null)) {
  const { bodies, default_body: usual } = await fetchJson("/api/choices").catch(() => ({
    bodies: [],
    default_body: "",
  }));
  const choices = bodies.map((one) => ({ value: one.name, label: one.label }));
  openForm({
    heading: "New session",
    action: "Create",
    intro:
      "It starts empty; footage and calibration come next. A name has letters, digits, - and _.",
    rows: [
      [
        {
          name: "name",
          label: "Name",
          ...NAME,
          oninput: ({ target }) => {
            target.value = target.value.replace(/\s/g, "-");
          },
        },
      ],
      ...(choices.length
        ? [
            [
              {
                name: "body",
                label: "Who or what is tracked",
                choices,
                value: usual,
                hint: "The nearest one will do; it can be changed in step Subject.",
              },
            ],
          ]
        : []),
    ],
    send: async (values) => {
      const made = await post("/api/sessions", {
        name: values.name,
        ...(values.body ? { body: values.body } : {}),
      });
      closeDialog();
      session = made.name ?? values.name;
      await drawSessions();
      await open(session);
      if (dropped) await go("footage", { dropped });
    },
  });
}

/** Up and down (or k and j) between the steps, Enter for the step's own button. */
function takeKey(event) {
  if (
    event.ctrlKey ||
    event.metaKey ||
    event.altKey ||
    event.target.closest?.(
      "input, select, textarea, dialog, [role=slider], [role=menu], [role=radiogroup], canvas",
    )
  )
    return;
  const by = { j: 1, ArrowDown: 1, k: -1, ArrowUp: -1 }[event.key];
  const next = by && beside(by);
  if (next) {
    event.preventDefault();
    go(next);
    /** @type {HTMLElement | null} */ (stepper.querySelector(`[data-step="${next}"]`))?.focus();
  } else if (
    event.key === "Enter" &&
    !(event.target.closest?.("button, a, summary") && !event.target.closest("#stepper"))
  ) {
    const buttons = (/** @type {string} */ kind) =>
      /** @type {HTMLButtonElement[]} */ ([...panel.querySelectorAll(`button.${kind}`)]);
    const own = buttons("primary").find((one) => one.offsetParent && !one.disabled);
    const primary = own ?? (panel.dataset.state === "done" ? buttons("next-step")[0] : null);
    if (!primary) return;
    event.preventDefault();
    primary.click();
  }
}

/** Back and forward go from step to step, and to the session before. */
async function restore() {
  const query = new URLSearchParams(location.search);
  const [wanted, step] = [query.get("session") ?? "", query.get("step") ?? ""];
  isRestoring = true;
  if (wanted === session && statusOf(step)) return go(step);
  return open(wanted || which.options[0]?.value, step);
}

/** What a link names that is not in this workspace. */
function sayMissing(name, names) {
  instead.value = html`<div class="nothing">
    <h1>Session “${name}” is not here</h1>
    <p class="lead">It was renamed or deleted, or the link comes from another studio.</p>
    ${
      names.length > 0 &&
      html`<div class="step-actions">
        <${Action} kind="primary" act=${() => open(names[0])}>Open ${names[0]}</${Action}>
      </div>`
    }
    <div class="step-actions">
      <${Action} kind=${names.length ? "" : "primary"} act=${() => beginForm()}>New session</${Action}>
    </div>
  </div>`;
}

async function start() {
  mount(stepper, html`<${Stepper} />`);
  mount(panel, html`<${Step} />`);
  mount(byId("aside"), html`<${Beside} />`);
  startTheme();
  startEvents();
  startWorkList();
  addEventListener("popstate", () => {
    restore().catch(complain);
  });
  document.addEventListener("keydown", takeKey);
  byId("begin").onclick = () => beginForm();
  acceptDrops("Drop your cameras' videos, or a folder", (files) => {
    if (shown.value === "footage")
      return document.dispatchEvent(new CustomEvent("footage", { detail: files }));
    return session && statusOf("footage") ? go("footage", { dropped: files }) : beginForm(files);
  });
  which.onchange = () => open(which.value);
  listenToAll((event) => {
    if (CHANGING.includes(event.type) && session && event.session === session && !isGoing(event))
      refresh().catch(() => {});
  });
  const query = new URLSearchParams(location.search);
  try {
    const names = await drawSessions();
    const wanted = query.get("session") ?? names[0];
    if (wanted && !names.includes(wanted)) return sayMissing(wanted, names);
    if (wanted && !query.has("new")) return await open(wanted, query.get("step") ?? "");
    instead.value = html`<div class="nothing">
      <h1>From your own cameras</h1>
      <p class="lead">
        From the raw footage of your cameras to a motion file, step by step. Start with an empty
        session.
      </p>
      <div class="step-actions">
        <${Action} kind="primary" act=${() => beginForm()}>New session</${Action}>
      </div>
    </div>`;
    if (query.has("new")) beginForm();
  } catch (error) {
    complain(error);
  }
}

start();
