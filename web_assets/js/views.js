// The views of a run's search: a list of them, and the one that is shown, as a figure. Their numbers come from the API; what is
// clicked in one of them is chosen everywhere.

import { addressOf } from "./address.js";
import { fetchJson, frameView, post, runView } from "./api.js";
import { button, byId, element, fill, select as choice } from "./elements.js";
import { Figure } from "./figure.js";
import { onEvent } from "./live.js";
import { countedIn, onOneAxis } from "./layer_axis.js";
import { liveView, triedView } from "./live_views.js";
import { complain } from "./messages.js";
import { paced } from "./pacing.js";
import { followsSearch, isStored, layersShown, select } from "./selection.js";
import { seedTools, startSeeds } from "./seeds.js";
import { get, set, watch } from "./state.js";
import { records } from "./view_sheet.js";
import { ANSWER_VIEWS } from "./views_answer.js";
import { SEARCH_VIEWS } from "./views_search.js";

/** @import { Schemas } from "./api_types" */

const LOAD_MILLISECONDS = 120;
const DRAWINGS = { ...SEARCH_VIEWS, ...ANSWER_VIEWS };
const OVER_FRAMES = {
  name: "frames", title: "Over the frames", question: "How did the run go?", uses: [], evaluates: false, is_job: false,
  columns: [["frame", "Frame", ""], ["error_mm", "Error of the markers", "mm"], ["log_weight", "Log weight", ""], ["milliseconds", "Time", "ms"], ["evaluations", "Evaluations", ""], ["tracking", "The search's own state", ""], ["lost", "Limb lost (truth)", ""]],
};
const SELECTED = { layer: "layer", parameter: "parameter", limb: "limb", particle: "particle", camera: "camera", track: "track", second: "second", towards: "towards" };
const TOWARDS = [["truth", "from estimate to truth"], ["mode", "from estimate to the best particle"], ["mean", "from estimate to the mean"], ["searched", "from refined to searched"], ["particle", "from estimate to the chosen particle"]];

const panel = byId("panel-views");
const list = element("nav", { className: "view-list", ariaLabel: "Views" });
const place = element("section", { className: "figure", ariaLabel: "View" });
/** @type {any[]} */
let views = [];
/** @type {Figure} */
let figure = null;
/** The newest answer, and what it was requested with. @type {{ key: string, answer: any } | null} */
let held = null;
/** The newest answer of what was tried, and what it was requested with. @type {{ key: string, answer: any } | null} */
let heldTried = null;
let age = 0;   // rises when what is stored changed

/** All views, for the command palette. */
export const allViews = () => views;
/** Show a view. */
export const showView = (name) => set({ panel: "views", view: name });

const current = () => views.find((one) => one.name === get("view")) ?? views[0];
const isOfRun = (view) => { const drawing = DRAWINGS[view.name]; return !drawing.frame || (get("over") === "run" && Boolean(drawing.run)); };

/** Label of a parameter; its name where the run is not known yet. */
export const labelOf = (name) => get("parameters")?.find((one) => one.name === name)?.label ?? name;

/** What a view's numbers depend on, as its address says it; a limb is marked in the drawing, all the others stay in it. `trial`: whose numbers. */
function queryOf(view, /** @type {string | null} */ trial = get("against")) {
  const query = new URLSearchParams(trial ? { trial } : {});
  for (const name of view.uses.filter((one) => one !== "limb" && !(view.name === "clouds" && one === "parameter"))) {
    // A layer that only the other search has: the last one stands beside it.
    const value = name === "layer" && get("layer") >= layersIn(trial) ? null : get(SELECTED[name]);
    if (value !== null && value !== undefined && !(name === "track" && value === "raw")) query.set(name, String(value));
  }
  return String(query);
}

/** How many layers a trial has; without its name what is stored. @param {string | null} trial */
function layersIn(trial) {
  if (trial && trial === get("trial") && get("whatIf")) return get("whatIf").length;
  const numbers = get("trials")?.trials.find((one) => one.name === trial) ?? get("trials")?.stored;
  return numbers?.layers ?? get("detail")?.layers.length ?? Infinity;
}

/** A view's numbers. `parameter`: the one whose clouds are drawn where none is chosen. @returns {Promise<any>} */
async function numbersOf(view, trial = get("against"), among = null) {
  if (view.name === "frames") return overFrames();
  const [session, run, frame] = [get("session"), get("run"), get("frame")];
  if (isOfRun(view)) return fetchJson(runView(session, run, view.name, queryOf(view, trial)));
  const whole = await fetchJson(frameView(session, run, frame, view.name, queryOf(view, trial)));
  if (view.name !== "clouds") return whole;
  // All layers of one parameter stand beside the first and last set of them all.
  const parameter = among ?? get("parameter") ?? mostLearnt(records(whole.tables.find((table) => table.name === "summary")));
  const query = new URLSearchParams([["parameter", parameter], ...new URLSearchParams(queryOf(view, trial))]);
  const own = await fetchJson(frameView(session, run, frame, view.name, String(query)));
  return { ...whole, tables: [...whole.tables.filter((table) => table.name !== "ridges"), ...own.tables.filter((table) => table.name === "ridges"), ...own.tables.filter((table) => table.name === "summary").map((table) => ({ ...table, name: "own" }))] };
}

/** The parameter whose cloud became the narrowest beside what it was. */
function mostLearnt(summary) {
  const first = new Map();
  let best = { parameter: summary[0]?.parameter, factor: 0 };
  for (const row of summary) {
    if (!first.has(row.parameter)) first.set(row.parameter, row.deviation);
    else if (row.deviation > 0 && first.get(row.parameter) / row.deviation > best.factor) best = { parameter: row.parameter, factor: first.get(row.parameter) / row.deviation };
  }
  return best.parameter;
}

/** The page's own view of the run's frames. */
async function overFrames() {
  const summary = get("summary");
  const { caption } = await fetchJson(runView(get("session"), get("run"), "schedule"));
  const columns = OVER_FRAMES.columns.map(([key, label, unit]) => ({ key, label, unit: key === "log_weight" ? summary.score[1] : unit }));
  return { caption, notes: [], tables: [{ name: "frames", title: "Weight and error by frame", columns, rows: summary.frames.map((line) => columns.map(({ key }) => line[key] ?? null)) }] };
}

async function load() {
  if (panel.hidden || !views.length) return;
  const view = current();
  if (!get("run") || get("frame") === null || (!get("summary")?.frames.length && !get("detail"))) { held = null; return figure.show(null, "No frames yet: track a run to look into its search."); }
  if (!isOfRun(view) && (followsSearch() || !isStored())) {
    held = null;
    const live = liveFigure(view.name);
    if (live) return figure.show(live);
    if (followsSearch() || !get("detail")) return figure.show(null, "The first layer is being searched.");
  }
  const key = [get("session"), get("run"), view.name, queryOf(view), view.name === "clouds" ? get("parameter") : "", age, isOfRun(view) ? get("summary")?.frames.length : get("frame")].join(" ");
  if (held?.key === key) return showBoth(view, key);
  place.ariaBusy = "true";
  try {
    const answer = await numbersOf(view);
    if (current() !== view) return;
    held = { key, answer };
    await showBoth(view, key);
  } catch (error) {
    if (current() !== view || error.name === "AbortError") return;
    held = null;
    figure.show(null, `${error.message} ${error.hint ?? ""}`);
  } finally { place.ariaBusy = "false"; }
}

/** What was tried, in the tables of a view: from the events where they tell all of it, else from the studio; null for nothing tried. */
async function triedIn(view) {
  if (!get("whatIf")) return null;
  const live = !isOfRun(view) && triedView(view.name);
  if (live) return live;
  if (!get("trial") || view.name === "frames") return null;
  const key = [held?.key, get("trial"), queryOf(view, get("trial"))].join(" ");
  if (heldTried?.key !== key) {
    const ridges = held?.answer.tables.find((table) => table.name === "ridges");
    heldTried = { key, answer: await numbersOf(view, get("trial"), ridges ? records(ridges)[0]?.parameter : null) };
  }
  return heldTried.answer;
}

/** Show what is held, and beside it what was tried, once both are there. */
async function showBoth(view, key) {
  const tried = await triedIn(view);
  if (held?.key === key && current() === view) show(view, held.answer, tried);
}

const loadLater = paced(load, LOAD_MILLISECONDS);

/** What a drawing knows beside its tables. @param {ReturnType<typeof onOneAxis>} axis */
const at = (room, axis) => ({
  ...axis.counted, layer: axis.there(get("layer")), limb: get("limb"), parameter: get("parameter"), particle: get("particle"), camera: get("camera"), frame: get("frame"), over: get("over") === "run",
  layers: axis.counted.searchLayers * axis.counted.searches, label: labelOf, room, tried: axis.tried, score: get("summary")?.score ?? ["log weight", ""],
});

const byName = (answer) => Object.fromEntries(answer.tables.map((table) => [table.name, records(table)]));
const onAxis = (answer) => answer && { tables: byName(answer), counted: countedIn(answer, Math.max(1, layersShown() || get("layerCount") || 1)) };

function show(view, stored, /** @type {any} */ beside = null) {
  const axis = onOneAxis(onAxis(stored), onAxis(beside?.tables.some((table) => table.rows.length) ? beside : null));
  const answer = axis.tried ? { ...stored, caption: `${stored.caption} Beside it: ${beside.caption}`, tables: [...stored.tables, ...beside.tables.map((table) => ({ ...table, title: `${table.title}, tried` }))] } : stored;
  const main = stored.tables.some((table) => table.rows.length);
  if (!main) return figure.show({ ...shownOf(view, answer), draw: null }, answer.notes.join(" ") || (view.is_job ? "Nothing computed yet: start it with the button above." : "There are no numbers of this frame."));
  const drawing = DRAWINGS[view.name];
  const draw = isOfRun(view) ? drawing.run : drawing.frame;
  figure.show({ ...shownOf(view, answer, axis.back), draw: (sheet, room) => draw(sheet, axis.stored, at(room, axis)) });
}

/**
 * The layers that there are of the frame that is searched, as a figure: in that view, or as their variance where the view needs
 * the frame's stored result; null without a layer.
 */
export function liveFigure(name = "variance") {
  const own = liveView(name);
  const answer = own ?? liveView("variance");
  const view = views.find((one) => one.name === (own ? name : "variance"));
  if (!answer || !view) return null;
  const wanted = views.find((one) => one.name === name);
  const notes = own ? [] : [`${wanted?.title ?? "This view"} is drawn of a frame that is finished: choose one, or pause the search.`];
  const axis = onOneAxis(onAxis(answer), null);
  return { ...shownOf(view, { ...answer, notes }), draw: (sheet, room) => DRAWINGS[view.name].frame(sheet, axis.stored, at(room, axis)) };
}

const shownOf = (view, answer, /** @type {(layer: number) => number} */ back = (layer) => layer) => ({
  name: [get("session"), get("run"), ...(isOfRun(view) ? [] : [`frame${get("frame")}`]), view.name].join("-"), title: view.title, question: view.question, caption: answer.caption,
  notes: answer.notes, tables: answer.tables, draw: null, choose: (changes) => choose(Number.isInteger(changes.layer) ? { ...changes, layer: back(changes.layer) } : changes), link: () => addressOf({ frame: get("frame") }),
});

/** A click in a drawing: what it chooses, or which body it draws beside the answer. */
function choose(/** @type {Record<string, any>} */ { ghosts, mode, seed, place: _place, ...changes }) {
  if (ghosts) drawBeside(ghosts);
  else if (mode !== undefined || seed !== undefined) {
    const [key, value] = mode === undefined ? ["seed", seed] : ["mode", mode];
    const row = records(held?.answer.tables.find((table) => table.name === "poses")).find((one) => one[key] === value);
    if (row && get("parameters")) drawBeside([{ colour: "accent", pose: get("parameters").map(({ name }) => row[name]) }]);
  } else select(changes);
}

/** Draw bodies beside the answer in the scene. @param {{ colour: string, pose: number[] }[]} ghosts */
export const drawBeside = (ghosts) => post("/api/scene/show", { ghosts }).catch(complain);

/** What can be chosen of the view that is shown. */
function tools() {
  const view = current();
  if (!view || !get("run")) return [];
  const drawing = DRAWINGS[view.name];
  const made = [];
  if (drawing.frame && drawing.run) {
    const scope = (label, over) => button(label, () => set({ over }), "small toggle", { ariaPressed: String((get("over") === "run") === (over === "run")) });
    made.push(element("div", { className: "group", role: "group", ariaLabel: "Of what" }, scope("This frame", null), scope("Whole run", "run")));
  }
  const parameters = get("parameters") ?? [];
  const offered = parameters.map(({ name, label }) => /** @type {[string, string]} */ ([name, label]));
  if (view.uses.includes("parameter")) made.push(choice([["", view.name === "landscape" ? "parameter…" : "parameter: chosen for you"], ...offered], get("parameter") ?? "", { ariaLabel: "Parameter", onchange: ({ target }) => select({ parameter: target.value || null }) }));
  if (view.uses.includes("second")) made.push(choice([["", "one parameter"], ...offered.filter(([name]) => name !== get("parameter"))], get("second") ?? "", { ariaLabel: "Second parameter", onchange: ({ target }) => set({ second: target.value || null }) }));
  if (view.uses.includes("towards")) made.push(choice([["", get("parameter") ? "along the parameter" : "line: chosen for you"], .../** @type {[string, string][]} */ (TOWARDS)], get("towards") ?? "", { ariaLabel: "Line", onchange: ({ target }) => set({ towards: target.value || null }) }));
  if (view.name === "seeds") made.push(...seedTools());
  return made;
}

function drawList() {
  const shown = current();
  fill(list, views.map((view, index) => element("button", {
    type: "button", className: "view-entry", ariaCurrent: view === shown ? "true" : "false", tabIndex: view === shown ? 0 : -1, title: view.question, dataset: { key: view.name }, onclick: () => set({ view: view.name }),
  }, element("b", {}, index + 1), view.title)));
}

/** Up and down go from view to view. */
function takeArrow(event) {
  const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  if (!by) return;
  event.preventDefault();
  stepView(by);
  /** @type {HTMLElement} */ (list.querySelector("[aria-current=true]"))?.focus();
}

/** Show the next view, or (by < 0) the one before. */
export function stepView(by) {
  if (!views.length) return;
  showView(views[(views.indexOf(current()) + by + views.length) % views.length].name);
}

/** Choose the next parameter, or (by < 0) the one before. */
export function stepParameter(by) {
  const names = (get("parameters") ?? []).map((one) => one.name);
  if (!names.length) return;
  const next = names.indexOf(get("parameter")) + by;
  select({ parameter: names[(next + names.length) % names.length] });
}

/** Show the numbers of the view as a table, or its drawing again. */
export const toggleTable = () => { if (!panel.hidden) { figure.isTable = !figure.isTable; figure.refresh(); } };
/** Write the view as something. @param {"svg" | "pdf" | "csv" | "link"} kind */
export const saveView = (kind) => figure.save(kind);

/** Wire the panel to the state. */
export function startViews() {
  fill(panel, list, place);
  figure = new Figure(place, tools);
  list.addEventListener("keydown", takeArrow);
  fetchJson("/api/views").then((answer) => {
    views = [...answer.views.filter((view) => DRAWINGS[view.name]), OVER_FRAMES];
    drawList();
    // Whoever shows one of them can do so now.
    document.dispatchEvent(new Event("panel"));
  }).catch(complain);
  watch(["view"], () => { drawList(); figure.isTable = false; });
  watch(["session", "run", "frame", "layer", "limb", "parameter", "particle", "camera", "track", "over", "second", "towards", "view", "panel", "summary", "whatIf", "trial", "against", "trials", "parameters", "detail", "follow", "work"], loadLater);
  onEvent("frame", (event, here) => { if (here && !event.reannealed) age += 1; });
  startSeeds((ended) => { if (ended) age += 1; figure.refresh(); loadLater(); });
  document.addEventListener("panel", () => loadLater());
}
