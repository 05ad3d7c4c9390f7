// The guided way: the stepper, the step's panel, pictures or the scene beside it.
//
// A step's module `way_<step>.js` (start-pose: way_start_pose.js) exports `mount(place, way) -> () => void`. `place` is
// empty and the panel's; what it returns lets go of everything when another step is shown. `way` holds
//   session        the session's name
//   detail         `GET S` as it was when the step was mounted (cameras are [] before the calibration)
//   steps          the steps as `GET S/way` has them; `way.step` is this one
//   refresh()      ask for the steps again (after something was made); resolves with them
//   go(step)       show another step
//   api            the functions of api.js
//   aside          the empty element at the right, for pictures (class "pictures" with figure.picture in it, if it fits)
//   scene(wish)    show the 3-D scene in `aside` instead, moved by `POST /api/scene/show {session, ...wish}`
//   on(type, fn)   hear events of this session of `WS /api/events` while the step is shown
//   progress(place, {words, share, cancel})  draw a bar with words and a Cancel button in `place`; null takes it away
// One `button.primary` a step: Enter presses the first that is shown. Classes to use: step-row, step-actions, hint, wrong,
// notice (way.css). Errors go through `complain` (messages.js) or a p.wrong in place.

import * as api from "./api.js";
import { closeDialog, openForm } from "./dialogs.js";
import { button, element } from "./elements.js";
import { complain } from "./messages.js";
import { loadScene } from "./scene_window.js";
import { startTheme } from "./theme.js";
import { WORDS } from "./way_words.js";
import { drawProgress } from "./way_progress.js";
import { listen, startWayEvents } from "./way_events.js";
import { isGoing } from "./jobs.js";

const byId = (id) => document.getElementById(id);
const stepper = byId("stepper");
const panel = byId("step");
const aside = byId("aside");

let session = "";
let steps = [];
let shown = "";        // the step whose panel is mounted
let unmount = null;
let mounting = 0;      // rises with every mount, so that a slow one knows that it is too late
let heard = [];

const statusOf = (name) => steps.find((one) => one.step === name);
const moduleOf = (name) => import(`./way_${name.replaceAll("-", "_")}.js`);

function drawStepper() {
  const rows = steps.map((one) => {
    const row = element("button", { type: "button" }, element("i", { className: "step-dot" }),
      element("span", { className: "name", textContent: WORDS[one.step].name }),
      one.words && element("span", { className: "words", textContent: one.words }),
      one.why && element("span", { className: "why", textContent: one.why }));
    row.dataset.step = one.step;
    row.dataset.state = one.state;
    row.title = `${WORDS[one.step].name}: ${WORDS.states[one.state]}${one.optional ? " (optional)" : ""}`;
    row.setAttribute("aria-label", [row.title, one.words, one.why].filter(Boolean).join(". "));
    if (one.step === shown) row.setAttribute("aria-current", "step");
    row.onclick = () => go(one.step);
    return element("li", {}, row);
  });
  const focused = document.activeElement?.dataset?.step;
  stepper.replaceChildren(element("ol", {}, ...rows));
  if (focused) stepper.querySelector(`[data-step="${focused}"]`)?.focus();
}

/** Ask how far the session is. */
async function refresh() {
  const asked = session;
  const told = await api.fetchJson(`${api.sessionPath(asked)}/way`);
  if (asked !== session) return steps;
  steps = told.steps;
  drawStepper();
  drawHead();
  return told.steps;
}

function letGo() {
  unmount?.();
  unmount = null;
  for (const stop of heard) stop();
  heard = [];
  aside.replaceChildren();
}

/** The scene beside the panel, moved to what is wished. */
async function scene(wish = {}) {
  if (!aside.querySelector("iframe")) aside.replaceChildren(loadScene(element("iframe", { title: "3-D scene" })));
  await api.post("/api/scene/show", { session, ...wish });
}

function drawHead() {
  const head = panel.querySelector(".step-head");
  const status = statusOf(shown);
  if (!head || !status) return;
  panel.dataset.state = status.state;
  head.replaceChildren(element("h1", { textContent: WORDS[shown].name }), element("p", { className: "lead", textContent: WORDS[shown].lead }),
    status.why && element("p", { className: "notice", textContent: status.why }));
}

/** Show a step. */
async function go(name) {
  if (!statusOf(name)) return;
  const turn = ++mounting;
  letGo();
  shown = name;
  drawStepper();
  history.replaceState(null, "", `?session=${encodeURIComponent(session)}&step=${name}`);
  document.title = `${WORDS[name].name} · ${session} · Capture studio`;
  const place = element("div", { className: "step-place" });
  const at = steps.findIndex((one) => one.step === name);
  const foot = element("div", { className: "step-foot" },
    at > 0 && button(`‹ ${WORDS[steps[at - 1].step].name}`, () => go(steps[at - 1].step), "quiet"), element("span", { className: "spring" }),
    at < steps.length - 1 && button(`${WORDS[steps[at + 1].step].name} ›`, () => go(steps[at + 1].step), "quiet next-step"));
  panel.replaceChildren(element("header", { className: "step-head" }), place, foot);
  panel.scrollTop = 0;
  drawHead();
  if (statusOf(name).state === "blocked") return;
  try {
    const [module, detail] = await Promise.all([moduleOf(name), api.fetchJson(api.sessionPath(session))]);
    if (turn !== mounting) return;
    unmount = module.mount(place, wayOf(detail));
  } catch (error) {
    place.replaceChildren(element("p", { className: "wrong", textContent: "This step cannot be shown." }), element("p", { className: "hint", textContent: `${error.message} ${error.hint ?? ""}` }));
  }
}

/** What a step's module is given. */
function wayOf(detail) {
  return {
    session, detail, aside, api, refresh, go, scene, progress: drawProgress,
    get steps() { return steps; },
    get step() { return statusOf(shown); },
    on: (type, handler) => { heard.push(listen(type, (event) => { if (event.session === session) handler(event); })); },
  };
}

/** Open a session at its next step, or the one that is asked for. */
async function open(name, wanted = "") {
  session = name;
  shown = "";
  byId("which").value = name;
  try {
    const told = await api.fetchJson(`${api.sessionPath(name)}/way`);
    steps = told.steps;
    await go(steps.some((one) => one.step === wanted) ? wanted : told.next || "footage");
  } catch (error) {
    letGo();
    stepper.replaceChildren();
    panel.replaceChildren(element("p", { className: "wrong", textContent: error.message }), element("p", { className: "hint", textContent: error.hint ?? "" }));
  }
}

/** The sessions of the workspace in the bar's list; which there are. */
async function drawSessions() {
  const { sessions } = await api.fetchJson("/api/sessions");
  byId("which").replaceChildren(...sessions.map((one) => new Option(one.title && one.title !== one.name ? `${one.name} · ${one.title}` : one.name, one.name, false, one.name === session)));
  byId("which").hidden = !sessions.length;
  return sessions.map((one) => one.name);
}

/** The form of a session that begins empty. */
function beginForm() {
  openForm({
    heading: "New session", action: "Begin", intro: "It begins empty; footage and calibration come next. A name has letters, digits, - and _.",
    rows: [[{ name: "name", label: "Name", required: true, pattern: "[A-Za-z0-9_\\-]{1,64}", title: "Letters, digits, - and _, up to 64" }]],
    send: async (values) => {
      const made = await api.post("/api/sessions", { name: values.name });
      closeDialog();
      session = made.name;
      await drawSessions();
      await open(made.name);
    },
  });
  const name = document.querySelector("dialog input[name=name]");
  name.oninput = () => { name.value = name.value.replace(/\s/g, "-"); };
}

function nothing() {
  panel.replaceChildren(element("header", { className: "step-head" }, element("h1", { textContent: "From your own cameras" }),
    element("p", { className: "lead", textContent: "From the raw footage of your cameras to a motion file, step by step. Begin with an empty session." })),
  element("div", { className: "step-actions" }, button("New session", beginForm, "primary")));
}

/** Up and down (or k and j) between the steps, Enter for the step's own button. */
function takeKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest?.("input, select, textarea, dialog, [role=slider], [role=menu], [role=radiogroup], canvas")) return;
  const by = { j: 1, ArrowDown: 1, k: -1, ArrowUp: -1 }[event.key];
  if (by) {
    const at = steps.findIndex((one) => one.step === shown) + by;
    if (!steps[at]) return;
    event.preventDefault();
    go(steps[at].step);
    stepper.querySelector(`[data-step="${steps[at].step}"]`)?.focus();
  } else if (event.key === "Enter" && !(event.target.closest?.("button, a, summary") && !event.target.closest("#stepper"))) {
    const own = [...panel.querySelectorAll("button.primary")].find((one) => one.offsetParent && !one.disabled);
    const primary = own ?? (panel.dataset.state === "done" ? panel.querySelector(".next-step") : null);
    if (!primary) return;
    event.preventDefault();
    primary.click();
  }
}

async function start() {
  startTheme();
  startWayEvents();
  document.addEventListener("keydown", takeKey);
  byId("begin").onclick = beginForm;
  byId("which").onchange = () => open(byId("which").value);
  for (const type of ["sessions", "track", "subject", "initialise", "export", "state", "import"]) {
    listen(type, (event) => { if (session && event.session === session && !isGoing(event)) refresh().catch(() => {}); });
  }
  const wish = new URLSearchParams(location.search);
  try {
    const names = await drawSessions();
    const wanted = wish.get("session") ?? names[0];
    if (wish.has("new") || !wanted) nothing();
    if (wish.has("new")) beginForm();
    else if (wanted) await open(wanted, wish.get("step") ?? "");
  } catch (error) { complain(error); }
}

start();
