// Why a frame is as it is, in words made from the stored search, and a button that tries what may
// help.

import { addressOf } from "../address.js";
import { fetchJson, frameView, patch, readOnly, runPath, runView } from "../api.js";
import { figure as figureWords } from "../chart_looks.js";
import { countedIn, onOneAxis } from "../layer_axis.js";
import { onEvent } from "../live.js";
import { complain, say } from "../messages.js";
import { askingAbout, paced } from "../pacing.js";
import { followsSearch, isStored, layersShown, select, shownTrial } from "../selection.js";
import { setupPath } from "../sessions.js";
import { get, set, watch } from "../state.js";
import { records } from "../view_sheet.js";
import { drawLimbs } from "../why_drawing.js";
import { computed, follow, html, signal } from "./component.js";
import { correctFrame } from "./correcting.js";
import { FigurePlace } from "./figure_place.js";
import { keepAsNewRun } from "./keeping.js";
import { Split, startSplit } from "./split.js";
import { hasTrack } from "./tracks.js";
import { liveFigure } from "./views.js";

/**
 * @import { Schemas } from "../api_types"
 * @typedef {Schemas["ViewAnswer"]} Answer
 * @typedef {NonNullable<Answer["findings"]>[number]} Finding
 * @typedef {NonNullable<Answer["remedies"]>[number]} Remedy
 * @typedef {{ frame: Answer, run: Answer }} Answers of the frame, and of the run
 */

const LOAD_MILLISECONDS = 200;
const SIDES = "sides";
const STEPS = { "start pose": "start", calibrate: "calibration", masks: "background" };

/** The newest answers, and what they were asked with. */
const held = signal(
  /** @type {(Answers & { key: string, tried: Answers | null }) | null} */ (null),
);
/** Why there is no answer. */
const wrong = signal("");
const isLoading = signal(false);
let age = 0; // rises when what is stored changed

/**
 * What there is to speak of: a frame that is "stored" or being "searched", "none" yet, or a run
 * that is being "read".
 */
const subject = computed(() => {
  const [run, frame, summary] = [follow("run"), follow("frame"), follow("summary")];
  if (run && !summary) return "read";
  const isFound = summary?.frames.length || follow("detail");
  if (!run || frame === null || !isFound) return "none";
  follow("session");
  follow("follow");
  follow("work");
  return followsSearch() || !isStored() ? "searched" : "stored";
});

/**
 * What the answers depend on.
 * @param {string | null} trial whose they are, null: of what is stored
 */
function queryOf(trial) {
  const query = new URLSearchParams();
  if (get("track") && get("track") !== "raw") query.set("track", get("track"));
  if (trial) query.set("trial", trial);
  return String(query);
}

/** The answers for a trial, or for what is stored. */
async function answersFor(
  session,
  run,
  frame,
  /** @type {string | null} */ trial,
  /** @type {AbortSignal} */ signal,
) {
  const [ofFrame, ofRun] = await Promise.all([
    fetchJson(frameView(session, run, frame, "why", queryOf(trial)), { signal }),
    fetchJson(runView(session, run, "why", queryOf(trial)), { signal }),
  ]);
  return { frame: ofFrame, run: ofRun };
}

/** What the answers of the shown frame are known by; null where there are none to ask for. */
function keyNow() {
  if (get("panel") !== "why" || subject.value !== "stored") return null;
  const of = `${get("session")}/${get("run")} ${get("frame")} ${queryOf(get("against"))}`;
  return `${of} ${get("trial") ?? ""} ${age} ${get("summary").frames.length}`;
}

function load() {
  const key = keyNow();
  if (key !== null && held.value?.key !== key) {
    asking.ask(key, (signal) => loadAnswers(key, signal));
    return;
  }
  // What is still asked for is of another frame.
  asking.stop();
  isLoading.value = false;
  if (key === null && get("panel") === "why") held.value = null;
}

async function loadAnswers(/** @type {string} */ key, /** @type {AbortSignal} */ signal) {
  const [session, run, frame] = [get("session"), get("run"), get("frame")];
  const [trial, against] = [get("trial"), get("against")];
  isLoading.value = true;
  wrong.value = "";
  try {
    const [stored, tried] = await Promise.all([
      answersFor(session, run, frame, against, signal),
      trial ? answersFor(session, run, frame, trial, signal) : null,
    ]);
    if (!signal.aborted) held.value = { key, ...stored, tried };
  } catch (error) {
    const { message, hint = "" } = /** @type {any} */ (error);
    if (signal.aborted) return;
    held.value = null;
    wrong.value = `${message} ${hint}`;
  } finally {
    if (!signal.aborted) isLoading.value = false;
  }
}

const later = paced(load, LOAD_MILLISECONDS);
const asking = askingAbout(later);

/** Go to what a finding speaks of. @param {Finding} finding */
function goTo({ frame, limb, layer, camera }) {
  const named = Object.entries({ frame, limb, layer, camera });
  select(Object.fromEntries(named.filter(([, value]) => value != null && value !== "")));
}

/** Try what may help. @param {Remedy} remedy */
async function attempt({ action, settings, title }) {
  const step = STEPS[action];
  if (action === "correct") await correctFrame();
  else if (action === "correct sides") set({ track: SIDES });
  else if (action === "look") set({ panel: "cameras" });
  else if (step) location.href = `${setupPath({ name: get("session") })}&step=${step}`;
  else {
    const frame = get("frame");
    try {
      set({ follow: false });
      await patch(`${runPath(get("session"), get("run"))}/settings?frame=${frame}`, settings ?? {});
      const after = "What it changes stands under the knobs.";
      say(`Frame ${frame} is annealed again: ${title}. ${after}`);
    } catch (error) {
      complain(error);
    }
  }
}

const valueWords = (value) =>
  typeof value === "number" ? figureWords(value) : value === "" ? "none" : value;
const knobWords = (settings) =>
  Object.entries(settings ?? {})
    .map(([name, value]) => `${name.replaceAll("_", " ")} ${valueWords(value)}`)
    .join(", ");

/**
 * Track again with a remedy from the frame on where the failure began, as a run of its own.
 * @param {Remedy} remedy
 */
async function trackAgain({ frame, settings }) {
  if (frame !== null && frame !== undefined) await keepAsNewRun(frame, settings ?? {});
}

/** What a remedy's button says; "" where there is none. @param {Remedy} remedy */
function buttonOf({ action, settings }) {
  if (STEPS[action] || action === "look") return "Go there";
  if (action === "correct") return readOnly ? "" : "Correct it";
  if (action === "correct sides") return hasTrack(SIDES) ? "Show that track" : "";
  return Object.keys(settings ?? {}).length && !readOnly ? "Try it" : "";
}

/** Whether the trial that is shown is this remedy's. @param {Remedy} remedy */
function isShown({ settings }) {
  const tried = shownTrial();
  const wanted = Object.entries(settings ?? {});
  return (
    Boolean(tried && wanted.length) &&
    wanted.every(([name, value]) =>
      tried?.moved.some((knob) => knob.name === name && knob.tried === value),
    )
  );
}

/** @param {{ remedy: Remedy }} properties */
function RemedyCard({ remedy }) {
  const knobs = knobWords(remedy.settings);
  const label = buttonOf(remedy);
  const isTried = isShown(remedy);
  const isLonger = label === "Try it" && Number.isInteger(remedy.frame);
  return html`<div class="remedy-card">
    <b>${remedy.title}</b>
    <p>${isTried ? "This is the trial that is shown" : remedy.words}${knobs && ` (${knobs})`}</p>
    ${
      label &&
      !isTried &&
      html`<button
        type="button"
        class="small"
        aria-label=${`Try: ${remedy.title}`}
        onClick=${() => attempt(remedy)}
      >
        ${isLonger ? "Try this frame" : label}
      </button>`
    }
    ${
      isLonger &&
      html`<button
        type="button"
        class="small primary again"
        title="The frames before it, then this one and all after it with these knobs, as a run of its own"
        onClick=${() => trackAgain(remedy)}
      >
        Track again from frame ${remedy.frame}
      </button>`
    }
  </div>`;
}

/** @param {{ findings?: Finding[] }} properties */
const Findings = ({ findings = [] }) => html`<ul class="why-findings">
  ${findings.map(
    (finding, at) =>
      html`<li key=${at} class=${finding.kind === "fits" ? "fine" : finding.is_cause ? "chief" : ""}>
        <button type="button" onClick=${() => goTo(finding)}>${finding.words}</button>
      </li>`,
  )}
</ul>`;

/** Why a frame is as it is. @param {Answers & { tried: Answers | null }} properties */
function Reasons({ frame, run, tried }) {
  follow("trial");
  follow("trials");
  const { notes, findings, remedies = [] } = frame;
  // What is compared with what comes first: without it no figure below can be read.
  return html`<h2>Why is frame ${frame.frame} as it is?</h2>
    ${notes.map((note) => html`<p class="hint" key=${note}>${note}</p>`)}
    <${Findings} findings=${findings} />
    ${
      tried &&
      html`<h3 class="tried-words">What was tried</h3>
        <${Findings} findings=${tried.frame.findings} />`
    }
    ${
      remedies.length > 0 &&
      html`<h3>What may help</h3>
        <div class="remedies">
          ${remedies.map((remedy) => html`<${RemedyCard} key=${remedy.title} remedy=${remedy} />`)}
        </div>`
    }
    <${Split} words=${run.notes} />`;
}

/** The frame that is searched: its layers so far, beside what is said of it once it is finished. */
function Searched() {
  follow("whatIf");
  follow("detail");
  const layers = layersShown();
  const done = `${layers} ${layers === 1 ? "layer is" : "layers are"} done`;
  const words = layers
    ? `${done}; beside this, what they left of each parameter's variance.`
    : "Its first layer is being searched.";
  return html`<h2>Frame ${follow("frame")} is searched</h2>
    <p>${words}</p>
    <p class="hint">
      Why a frame is as it is, is said of frames that are finished: choose one, or pause the search.
    </p>`;
}

/** The answers of the run that is open, in a component; null while there are none. */
function followAnswers() {
  const answers = held.value;
  const isOpen =
    answers?.frame.session === follow("session") && answers?.frame.run === follow("run");
  return subject.value === "stored" && isOpen ? answers : null;
}

function Said() {
  const empty = (words) => html`<p class="empty">${words}</p>`;
  if (subject.value === "read") return empty("The run is being read ...");
  if (subject.value === "none") {
    return empty("No frames yet: track a run, then this says why a frame failed.");
  }
  if (subject.value === "searched") return html`<${Searched} />`;
  const answers = followAnswers();
  if (answers) return html`<${Reasons} ...${answers} />`;
  return empty(wrong.value || `Frame ${follow("frame")} is being looked into ...`);
}

const tablesOf = ({ frame, run }) =>
  Object.fromEntries([...frame.tables, ...run.tables].map((table) => [table.name, records(table)]));

const onAxis = (answers) =>
  answers && {
    tables: tablesOf(answers),
    counted: countedIn(answers.frame, Math.max(1, layersShown())),
  };

/** The figure beside the words: limbs over the frames; of a frame that is searched its layers. */
function figureNow() {
  if (subject.value === "searched") {
    for (const name of ["detail", "parameters", "frame", "layer", "limb"]) follow(name);
    return liveFigure();
  }
  const answers = followAnswers();
  if (!answers) return null;
  const { frame, run, tried } = answers;
  const axis = onOneAxis(onAxis(answers), onAxis(tried));
  const at = {
    ...axis.counted,
    frame: follow("frame"),
    limb: follow("limb"),
    layer: axis.there(follow("layer")),
    tried: axis.tried,
  };
  const choose = (changes) =>
    select(
      Number.isInteger(changes.layer) ? { ...changes, layer: axis.back(changes.layer) } : changes,
    );
  return {
    name: [frame.session, frame.run, `frame${frame.frame}`, "why"].join("-"),
    title: "Limbs and frames",
    question: "Which limb, from when on?",
    caption: frame.caption,
    notes: frame.notes,
    tables: [...frame.tables, ...run.tables],
    choose,
    link: () => addressOf(),
    draw: (sheet, room) => drawLimbs(sheet, axis.stored, at, room),
  };
}

const Drawn = () =>
  html`<${FigurePlace} panel="why" label="Limbs and frames" shown=${figureNow()} />`;

/** The panel. */
export const Why = () => html`
  <section class="why-words" aria-label="Why" aria-busy=${String(isLoading.value)}>
    <${Said} />
  </section>
  <${Drawn} />
`;

/** Load what the panel says. */
export function startWhy() {
  const names = ["session", "run", "frame", "track", "trial", "against", "summary", "panel"];
  watch([...names, "follow", "work", "detail"], later);
  onEvent("frame", (event, here) => {
    if (here && !event.reannealed) age += 1;
  });
  startSplit(() => {
    age += 1;
    later();
  });
}
