// The numbers of a view: from the API, of what is stored or of a trial; those over the frames from
// the page's own summary.

import { fetchJson, frameView, runView } from "../api.js";
import { get } from "../state.js";
import { records } from "../view_sheet.js";
import { ANSWER_VIEWS } from "../views_answer.js";
import { SEARCH_VIEWS } from "../views_search.js";

/** How each view is drawn, by its name: of a frame, of the run. @type {Record<string, any>} */
export const DRAWINGS = { ...SEARCH_VIEWS, ...ANSWER_VIEWS };

/** The page's own view of the run's frames. */
export const OVER_FRAMES = {
  name: "frames",
  title: "Over the frames",
  question: "How did the run go?",
  uses: /** @type {string[]} */ ([]),
  is_job: false,
};
const FRAME_COLUMNS = [
  ["frame", "Frame", ""],
  ["error_mm", "Error of the markers", "mm"],
  ["log_weight", "Log weight", ""],
  ["milliseconds", "Time", "ms"],
  ["evaluations", "Evaluations", ""],
  ["tracking", "The search's own state", ""],
  ["lost", "Limb lost (truth)", ""],
];

/** Whether a view is shown of the whole run. */
export function isOfRun({ name }) {
  const { frame, run } = DRAWINGS[name];
  return !frame || (get("over") === "run" && Boolean(run));
}

/** How many layers a trial has; without its name what is stored. @param {string | null} trial */
function layersIn(trial) {
  if (trial && trial === get("trial") && get("whatIf")) return get("whatIf").length;
  const { trials, stored } = get("trials") ?? {};
  const numbers = trials?.find((one) => one.name === trial) ?? stored;
  return numbers?.layers ?? get("detail")?.layers.length ?? Infinity;
}

/**
 * What a view's numbers depend on, as its address says it; a limb is marked in the drawing, all the
 * others stay in it.
 * @param {{ name: string, uses: string[] }} view @param {string | null} trial whose numbers
 */
export function queryOf(view, trial) {
  const query = new URLSearchParams(trial ? { trial } : {});
  for (const name of view.uses) {
    if (name === "limb" || (view.name === "clouds" && name === "parameter")) continue;
    // A layer that only the other search has: the last one stands beside it.
    const isBeyond = name === "layer" && get("layer") >= layersIn(trial);
    const value = isBeyond || (name === "track" && get(name) === "raw") ? null : get(name);
    if (value !== null && value !== undefined) query.set(name, String(value));
  }
  return String(query);
}

/** The parameter whose cloud became the narrowest beside what it was. */
function mostLearnt(summary) {
  const first = new Map();
  let best = { parameter: summary[0]?.parameter, factor: 0 };
  for (const { parameter, deviation } of summary) {
    if (!first.has(parameter)) first.set(parameter, deviation);
    const factor = deviation > 0 ? first.get(parameter) / deviation : 0;
    if (factor > best.factor) best = { parameter, factor };
  }
  return best.parameter;
}

async function overFrames(signal) {
  const { frames, score } = get("summary");
  const { caption } = await fetchJson(runView(get("session"), get("run"), "schedule"), { signal });
  const columns = FRAME_COLUMNS.map(([key, label, unit]) => ({
    key,
    label,
    unit: key === "log_weight" ? score[1] : unit,
  }));
  const rows = frames.map((line) => columns.map(({ key }) => line[key] ?? null));
  const table = { name: "frames", title: "Weight and error by frame", columns, rows };
  return { caption, notes: [], tables: [table] };
}

/** All layers of one parameter's clouds, beside the first and last of them all. */
async function cloudsOf(session, run, frame, view, trial, { among, signal }) {
  const path = frameView(session, run, frame, view.name, queryOf(view, trial));
  const whole = await fetchJson(path, { signal });
  const named = (answer, name) => answer.tables.filter((table) => table.name === name);
  const parameter = among ?? get("parameter") ?? mostLearnt(records(named(whole, "summary")[0]));
  const rest = new URLSearchParams(queryOf(view, trial));
  const query = new URLSearchParams([["parameter", parameter], ...rest]);
  const own = await fetchJson(frameView(session, run, frame, view.name, String(query)), { signal });
  return {
    ...whole,
    tables: [
      ...whole.tables.filter((table) => table.name !== "ridges"),
      ...named(own, "ridges"),
      ...named(own, "summary").map((table) => ({ ...table, name: "own" })),
    ],
  };
}

/**
 * A view's numbers.
 * @param {any} view
 * @param {string | null} trial whose
 * @param {{ signal?: AbortSignal, among?: string | null }} [how] `among`: the parameter whose
 *   clouds are drawn where none is chosen
 * @returns {Promise<any>}
 */
export async function numbersOf(view, trial, { signal, among = null } = {}) {
  if (view.name === OVER_FRAMES.name) return overFrames(signal);
  const [session, run, frame] = [get("session"), get("run"), get("frame")];
  const query = queryOf(view, trial);
  if (isOfRun(view)) return fetchJson(runView(session, run, view.name, query), { signal });
  if (view.name === "clouds") return cloudsOf(session, run, frame, view, trial, { among, signal });
  return fetchJson(frameView(session, run, frame, view.name, query), { signal });
}
