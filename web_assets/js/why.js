// Why a frame is as it is, in words made from the stored search, and a button that tries what may help.

import { addressOf } from "./address.js";
import { fetchJson, frameView, patch, readOnly, runPath, runView } from "./api.js";
import { figure as figureWords } from "./chart_looks.js";
import { button, byId, element, fill, hint } from "./elements.js";
import { Figure } from "./figure.js";
import { countedIn, onOneAxis } from "./layer_axis.js";
import { onEvent } from "./live.js";
import { complain, say } from "./messages.js";
import { paced } from "./pacing.js";
import { followsSearch, isStored, layersShown, select } from "./selection.js";
import { setupPath } from "./sessions.js";
import { get, set, watch } from "./state.js";
import { records } from "./view_sheet.js";
import { liveFigure } from "./views.js";
import { drawLimbs } from "./why_drawing.js";

/** @import { Schemas } from "./api_types" */

const LOAD_MILLISECONDS = 200;
const SIDES = "sides";
const STEPS = { "start pose": "start", calibrate: "calibration", masks: "background" };

const panel = byId("panel-why");
const words = element("section", { className: "why-words", ariaLabel: "Why" });
const place = element("section", { className: "figure", ariaLabel: "Limbs and frames" });
/** @type {Figure} */
let figure = null;
/** What is drawn, and what was chosen when it was. @type {{ key: string, frame: Schemas["ViewAnswer"], run: Schemas["ViewAnswer"], tried: { frame: Schemas["ViewAnswer"], run: Schemas["ViewAnswer"] } | null, chosen: string } | null} */
let held = null;
let age = 0;

/** What the answers depend on. `trial`: whose they are, none: of what is stored. */
function query(trial = get("against")) {
  const track = get("track") && get("track") !== "raw" ? { track: get("track") } : {};
  return String(new URLSearchParams({ ...track, ...(trial ? { trial } : {}) }));
}

/** The answers for a trial, or for what is stored: of the frame, and of the run. */
async function answersFor(session, run, frame, /** @type {string | null} */ trial) {
  const [ofFrame, ofRun] = await Promise.all([fetchJson(frameView(session, run, frame, "why", query(trial))), fetchJson(runView(session, run, "why", query(trial)))]);
  return { frame: ofFrame, run: ofRun };
}

const chosenNow = () => JSON.stringify([get("frame"), get("limb"), get("layer")]);

async function load() {
  if (panel.hidden) return;
  if (get("run") && !get("summary")) { held = null; return drawNothing("The run is being read ..."); }
  if (!get("run") || get("frame") === null || (!get("summary")?.frames.length && !get("detail"))) { held = null; return drawNothing("No frames yet: track a run, then this says why a frame failed."); }
  if (followsSearch() || !isStored()) { held = null; return drawSearch(); }
  const [session, run, frame] = [get("session"), get("run"), get("frame")];
  const trial = get("trial");
  const key = `${session}/${run} ${frame} ${query()} ${trial ?? ""} ${age} ${get("summary").frames.length}`;
  if (held?.key === key) return held.chosen === chosenNow() ? undefined : draw();
  if (held?.frame.session !== session || held?.frame.run !== run) drawNothing(`Frame ${frame} is being looked into ...`);
  words.ariaBusy = "true";
  try {
    const [stored, tried] = await Promise.all([answersFor(session, run, frame, get("against")), trial ? answersFor(session, run, frame, trial) : null]);
    if (frame !== get("frame") || run !== get("run") || session !== get("session")) return;
    held = { key, ...stored, tried, chosen: "" };
    draw();
  } catch (error) {
    if (frame === get("frame")) { held = null; drawNothing(`${error.message} ${error.hint ?? ""}`); }
  } finally { words.ariaBusy = "false"; }
}

function drawNothing(text) {
  fill(words, element("p", { className: "empty" }, text));
  figure.show(null, "");
}

/** The frame that is searched: its layers so far, beside what is said of it once it is finished. */
function drawSearch() {
  const layers = layersShown();
  fill(words, element("h2", {}, `Frame ${get("frame")} is searched`), element("p", {}, layers ? `${layers} ${layers === 1 ? "layer is" : "layers are"} done; beside this, what they left of each parameter's variance.` : "Its first layer is being searched."),
    hint("Why a frame is as it is, is said of frames that are finished: choose one, or pause the search."));
  figure.show(liveFigure(), "");
}

/** Go to what a finding speaks of. @param {Schemas["ViewAnswer"]["findings"][number]} finding */
function follow(finding) {
  const named = { frame: finding.frame ?? undefined, limb: finding.limb || undefined, layer: finding.layer ?? undefined, camera: finding.camera || undefined };
  select(Object.fromEntries(Object.entries(named).filter(([, value]) => value !== undefined)));
}

/** Try what may help. @param {Schemas["ViewAnswer"]["remedies"][number]} remedy */
async function attempt(remedy) {
  const step = STEPS[remedy.action];
  if (remedy.action === "correct") { byId("correct").click(); return; }
  if (remedy.action === "correct sides") { set({ track: SIDES }); return; }
  if (remedy.action === "look") { set({ panel: "cameras" }); return; }
  if (step) { location.href = `${setupPath({ name: get("session") })}&step=${step}`; return; }
  if (!Object.keys(remedy.settings ?? {}).length) return;
  try {
    set({ follow: false });
    await patch(`${runPath(get("session"), get("run"))}/settings?frame=${get("frame")}`, remedy.settings);
    say(`Frame ${get("frame")} is annealed again: ${remedy.title}. What it changes stands under the knobs.`);
  } catch (error) { complain(error); }
}

const knobWords = (settings) => Object.entries(settings ?? {}).map(([name, value]) => `${name.replaceAll("_", " ")} ${typeof value === "number" ? figureWords(value) : value === "" ? "none" : value}`).join(", ");

const hasSides = () => [...document.querySelectorAll("#track-choice option")].some((one) => /** @type {HTMLOptionElement} */ (one).value === SIDES);

/** What a remedy's button says; "" where there is none. */
function buttonOf(remedy) {
  if (STEPS[remedy.action] || remedy.action === "look") return "Go there";
  if (remedy.action === "correct") return readOnly ? "" : "Correct it";
  if (remedy.action === "correct sides") return hasSides() ? "Show that track" : "";
  return Object.keys(remedy.settings ?? {}).length && !readOnly ? "Try it" : "";
}

/** @param {Schemas["ViewAnswer"]["remedies"][number]} remedy */
const remedyCard = (remedy) => element("div", { className: "remedy-card" },
  element("b", {}, remedy.title),
  element("p", {}, remedy.words, knobWords(remedy.settings) && ` (${knobWords(remedy.settings)})`),
  buttonOf(remedy) && button(buttonOf(remedy), () => attempt(remedy), "small", { ariaLabel: `Try: ${remedy.title}` }));

function draw() {
  const { frame, run, tried } = held;
  held.chosen = chosenNow();
  const findings = frame.findings ?? [];
  const kept = words.scrollTop;
  const classOf = (finding) => (finding.kind === "fits" ? "fine" : finding.is_cause ? "chief" : "");
  // What is compared with what comes first: without it no figure below can be read.
  fill(words, element("h2", {}, `Why is frame ${frame.frame} as it is?`),
    frame.notes.map((note) => hint(note)),
    element("ul", { className: "why-findings" }, findings.map((finding, at) => element("li", { className: classOf(finding) },
      button(finding.words, () => follow(finding), "", { dataset: { key: `finding-${at}` } })))),
    tried && [element("h3", { className: "tried-words" }, "What was tried"), element("ul", { className: "why-findings" }, (tried.frame.findings ?? []).map((finding, at) => element("li", { className: classOf(finding) }, button(finding.words, () => follow(finding), "", { dataset: { key: `tried-${at}` } }))))],
    frame.remedies?.length > 0 && [element("h3", {}, "What may help"), element("div", { className: "remedies" }, frame.remedies.map(remedyCard))]);
  words.scrollTop = kept;
  const tablesOf = (answers) => Object.fromEntries([...answers.frame.tables, ...answers.run.tables].map((table) => [table.name, records(table)]));
  const onAxis = (answers) => answers && { tables: tablesOf(answers), counted: countedIn(answers.frame, Math.max(1, layersShown())) };
  const axis = onOneAxis(onAxis({ frame, run }), onAxis(tried));
  figure.show({
    name: [get("session"), get("run"), `frame${frame.frame}`, "why"].join("-"), title: "Limbs and frames", question: "Which limb, from when on?", caption: frame.caption, notes: frame.notes,
    tables: [...frame.tables, ...run.tables], choose: (changes) => select(Number.isInteger(changes.layer) ? { ...changes, layer: axis.back(changes.layer) } : changes),
    link: () => addressOf(), draw: (sheet, room) => drawLimbs(sheet, axis.stored, { ...axis.counted, frame: get("frame"), limb: get("limb"), layer: axis.there(get("layer")), tried: axis.tried }, room),
  });
}

/** Wire the panel to the state. */
export function startWhy() {
  fill(panel, words, place);
  figure = new Figure(place);
  const later = paced(load, LOAD_MILLISECONDS);
  watch(["session", "run", "frame", "track", "trial", "against", "summary", "panel", "limb", "layer", "follow", "work", "detail", "parameters"], later);
  onEvent("frame", (event, here) => { if (here && !event.reannealed) age += 1; });
  document.addEventListener("panel", () => later());
}

