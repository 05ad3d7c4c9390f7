// The guided set-up: the stepper, the step's panel, pictures or the scene beside it.
//
// A step's module `setup_<step>.js` (start-pose: setup_start_pose.js) exports `mount(place, setup,
// loaded) -> () => void`. `place` is empty and the panel's; `loaded` is what its `load(session)`
// resolves with, where it exports one; what `mount` returns releases everything when another step
// is shown. One `button.primary` a step: Enter presses the first that is shown.

import { fetchJson, post, sessionPath } from "./api.js";
import { closeDialog, openForm } from "./studio/dialogs.js";
import {
  actions,
  button,
  byId,
  element,
  failure,
  fill,
  lead,
  NAME,
  nothing,
  notice,
  offer,
  spring,
} from "./elements.js";
import { listen, listenToAll, startEvents } from "./events.js";
import { isGoing } from "./jobs.js";
import { acceptDrops } from "./dropping.js";
import { complain } from "./messages.js";
import { loadScene } from "./scene_window.js";
import { sessionWords } from "./sessions.js";
import { startWorkList } from "./studio/work_list.js";
import { startTheme } from "./theme.js";

/**
 * @import { MessageOf, MessageType, Schemas } from "./api_types"
 * @typedef {{ begin?: boolean, dropped?: File[] }} Asked what a step does at once: track; take
 *   files that were dropped
 * @typedef Setup what a step is given
 * @property {string} session
 * @property {Schemas["SessionDetail"]} detail the session as it was when the step was mounted (no
 *   cameras before the calibration)
 * @property {HTMLElement} aside the empty element at the right, for pictures (class "pictures" with
 *   `picture`s in it, if it fits)
 * @property {Schemas["Workflow"]["steps"][number] | undefined} step this step as the server sees it
 *   now
 * @property {() => Promise<any>} refresh load the steps again, after something was made
 * @property {(step: string, asked?: Asked) => Promise<void>} go show another step; `asked`: to do
 *   at once
 * @property {Asked} asked what the step is asked to do at once
 * @property {(shown?: object) => Promise<void>} scene show the 3-D scene in `aside` instead, moved
 *   to what is to be shown
 * @property {<T extends MessageType>(type: T, handler: (event: MessageOf<T>) => void) => void} on
 *   hear events of this session while the step is shown
 */
/**
 * What mounts a step of which something is loaded first, by its `load(session)`.
 * @template {(session: string) => Promise<any>} L
 * @typedef {(place: HTMLElement, setup: Setup, loaded: Awaited<ReturnType<L>>) => () => void} Mount
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

const stepper = byId("stepper");
const panel = byId("step");
const aside = byId("aside");
const which = byId("which");

let session = "";
/** @type {StepStatus[]} */
let steps = [];
let shown = ""; // the step whose panel is mounted
let mounting = 0; // rises with every mount, so that a slow one knows that it is too late
let releases = []; // what the mounted step has to release
let isRestoring = true; // whether the step that is shown next follows from the address

const statusOf = (name) => steps.find((one) => one.step === name);
const beside = (by) => steps[steps.findIndex((one) => one.step === shown) + by]?.step;
const moduleOf = (name) => import(`./setup_${name.replaceAll("-", "_")}.js`);

function drawStepper() {
  fill(
    stepper,
    element(
      "ol",
      {},
      steps.map((one) => {
        const title = `${STEPS[one.step].name}: ${STATES[one.state]}${one.optional ? " (optional)" : ""}`;
        const row = element(
          "button",
          {
            type: "button",
            title,
            ariaLabel: [title, one.words, one.why].filter(Boolean).join(". "),
            dataset: {
              key: one.step,
              step: one.step,
              state: one.state,
              ...(one.state === "done" && one.why ? { doubt: "" } : {}),
            },
            onclick: () => go(one.step),
          },
          element("i", { className: "step-dot" }),
          element("span", { className: "name" }, STEPS[one.step].name),
          one.words && element("span", { className: "words" }, one.words),
          one.why && element("span", { className: "why" }, one.why),
        );
        if (one.step === shown) row.ariaCurrent = "step";
        return element("li", {}, row);
      }),
    ),
  );
}

/** Load how far the session is. */
async function refresh() {
  const wanted = session;
  const answer = await fetchJson(`${sessionPath(wanted)}/way`);
  if (wanted !== session) return;
  steps = answer.steps;
  drawStepper();
  drawHead();
}

function release() {
  for (const each of releases) each();
  releases = [];
  fill(aside);
}

/** The scene beside the panel, moved to what is to be shown. */
async function scene(wanted = {}) {
  if (!aside.querySelector("iframe"))
    fill(aside, loadScene(element("iframe", { title: "3-D scene" })));
  await post("/api/scene/show", { session, ...wanted });
}

function drawHead() {
  const head = panel.querySelector(".step-head");
  const status = statusOf(shown);
  if (!head || !status) return;
  panel.dataset.state = status.state;
  fill(
    head,
    element("h1", {}, STEPS[shown].name),
    lead(STEPS[shown].lead),
    status.why && notice(status.why),
  );
}

/** Show a step; "back" leads to the one before. @param {Asked} [asked] */
async function go(name, asked = {}) {
  if (!statusOf(name)) return;
  const turn = ++mounting;
  release();
  shown = name;
  drawStepper();
  const address = `?session=${encodeURIComponent(session)}&step=${name}`;
  if (location.search !== address) {
    if (isRestoring) history.replaceState(null, "", address);
    else history.pushState(null, "", address);
  }
  isRestoring = false;
  document.title = `${STEPS[name].name} · ${session} · Capture studio`;
  const place = element("div", { className: "step-place" });
  const [before, next] = [beside(-1), beside(1)];
  fill(
    panel,
    element("header", { className: "step-head" }),
    place,
    element(
      "div",
      { className: "step-foot" },
      before && button(`‹ ${STEPS[before].name}`, () => go(before), "quiet"),
      spring(),
      next && button(`${STEPS[next].name} ›`, () => go(next), "quiet next-step"),
    ),
  );
  panel.scrollTop = 0;
  drawHead();
  if (statusOf(name)?.state === "blocked") return;
  try {
    const [[module, loaded], detail] = await Promise.all([
      moduleOf(name).then(async (one) => [one, await one.load?.(session)]),
      fetchJson(sessionPath(session)),
    ]);
    if (turn !== mounting) return;
    releases.push(module.mount(place, setupOf(detail, asked), loaded));
  } catch (error) {
    fill(place, element("p", {}, "This step cannot be shown."), failure(error));
  }
}

/** What a step's module is given. @returns {Setup} */
const setupOf = (detail, asked) => ({
  session,
  detail,
  aside,
  refresh,
  go,
  scene,
  asked,
  get step() {
    return statusOf(shown);
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
  shown = "";
  which.value = name;
  try {
    const answer = await fetchJson(`${sessionPath(name)}/way`);
    steps = answer.steps;
    await go(statusOf(wanted) ? wanted : answer.next || "footage");
  } catch (error) {
    release();
    fill(stepper);
    fill(panel, failure(error));
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
    stepper.querySelector(`[data-step="${next}"]`)?.focus();
  } else if (
    event.key === "Enter" &&
    !(event.target.closest?.("button, a, summary") && !event.target.closest("#stepper"))
  ) {
    const own = [...panel.querySelectorAll("button.primary")].find(
      (one) => one.offsetParent && !one.disabled,
    );
    const primary =
      own ?? (panel.dataset.state === "done" ? panel.querySelector(".next-step") : null);
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
  fill(
    panel,
    nothing(
      `Session “${name}” is not here`,
      lead("It was renamed or deleted, or the link comes from another studio."),
      names.length > 0 && actions(button(`Open ${names[0]}`, () => open(names[0]), "primary")),
      actions(button("New session", () => beginForm(), names.length ? "" : "primary")),
    ),
  );
}

async function start() {
  startTheme();
  startEvents();
  startWorkList();
  addEventListener("popstate", () => {
    restore().catch(complain);
  });
  document.addEventListener("keydown", takeKey);
  byId("begin").onclick = () => beginForm();
  acceptDrops("Drop your cameras' videos, or a folder", (files) => {
    if (shown === "footage")
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
    fill(
      panel,
      nothing(
        "From your own cameras",
        lead(
          "From the raw footage of your cameras to a motion file, step by step. Start with an empty session.",
        ),
        actions(button("New session", () => beginForm(), "primary")),
      ),
    );
    if (query.has("new")) beginForm();
  } catch (error) {
    complain(error);
  }
}

start();
