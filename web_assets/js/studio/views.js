// The views of a run's search: a list of them, and the one that is shown, as a figure. Their
// numbers come from the API; what is clicked in one of them is chosen everywhere.

import { addressOf } from "../address.js";
import { fetchJson, post } from "../api.js";
import { countedIn, onOneAxis } from "../layer_axis.js";
import { onEvent } from "../live.js";
import { complain } from "../messages.js";
import { askingAbout, paced } from "../pacing.js";
import { followsSearch, isStored, layersShown, select } from "../selection.js";
import { get, set, watch } from "../state.js";
import { records } from "../view_sheet.js";
import { follow, html, signal, useEffect, useRef } from "./component.js";
import { Select } from "./parts.js";
import { FigurePlace } from "./figure_place.js";
import { liveView, triedView } from "./live_views.js";
import { SeedTools, startSeeds } from "./seeds.js";
import { startUncertainty, UncertaintyTools } from "./uncertainty.js";
import { DRAWINGS, isOfRun, numbersOf, OVER_FRAMES, queryOf } from "./view_numbers.js";

/** @import { Figure, Shown } from "../figure.js" */

const LOAD_MILLISECONDS = 120;
const LATE_MILLISECONDS = 300;
const FADE_PIXELS = 40;
const TOWARDS = [
  ["truth", "from estimate to truth"],
  ["mode", "from estimate to the best particle"],
  ["mean", "from estimate to the mean"],
  ["searched", "from refined to searched"],
  ["particle", "from estimate to the chosen particle"],
];

const views = signal(/** @type {any[]} */ ([]));
/** What the panel draws, or why there is nothing to draw. */
const drawn = signal({ shown: /** @type {Shown | null} */ (null), words: "" });
const isLoading = signal(false);
/** The newest answer, and what it was requested with. */
let held = /** @type {{ key: string, answer: any } | null} */ (null);
/** The same of what was tried. */
let heldTried = /** @type {{ key: string, answer: any } | null} */ (null);
let figure = /** @type {Figure | null} */ (null);
let age = 0; // rises when what is stored changed
let drawnView = ""; // whose figure it is

/** All views, for the command palette. */
export const allViews = () => views.value;
/** Show a view. */
export const showView = (name) => set({ panel: "views", view: name });

const named = (name) => views.value.find((one) => one.name === name);
const current = () => named(get("view")) ?? views.value[0];
/** The view that is shown, in a component. */
const followCurrent = () => named(follow("view")) ?? views.value[0];

/** Label of a parameter; its name where the run is not known yet. */
const labelOf = (name) => get("parameters")?.find((one) => one.name === name)?.label ?? name;

const draw = (/** @type {Shown | null} */ shown, words = "") => {
  drawn.value = { shown, words };
};

function load() {
  const view = get("panel") === "views" && views.value.length ? current() : null;
  const early = view && withoutAsking(view);
  if (!view || early) {
    asking.stop();
    isLoading.value = false;
    if (early) {
      held = null;
      draw(early.shown, early.words);
    }
    return;
  }
  const against = get("against");
  const key = [
    get("session"),
    get("run"),
    view.name,
    queryOf(view, against),
    view.name === "clouds" ? get("parameter") : "",
    age,
    isOfRun(view) ? get("summary")?.frames.length : get("frame"),
  ].join(" ");
  const subject = [get("session"), get("run"), view.name, get("over")].join(" ");
  asking.ask(subject, (signal) => loadView(view, key, signal));
}

/** What a view shows while there is nothing to ask for; null where there is. */
function withoutAsking(view) {
  const isFound = get("summary")?.frames.length || get("detail");
  const say = (/** @type {string} */ words) => ({ shown: null, words });
  if (get("run") && !get("summary") && !isFound) return say("The run is being read.");
  if (!get("run") || get("frame") === null || !isFound) {
    return say("No frames yet: track a run to look into its search.");
  }
  if (isOfRun(view) || (!followsSearch() && isStored())) return null;
  const live = liveFigure(view.name);
  if (live) return { shown: live, words: "" };
  return followsSearch() || !get("detail") ? say("The first layer is being searched.") : null;
}

/** Ask for a view's numbers and show them. */
async function loadView(view, /** @type {string} */ key, /** @type {AbortSignal} */ signal) {
  if (held?.key === key) return showBoth(view, held, signal);
  const against = get("against");
  isLoading.value = true;
  // Another view's figure does not stand under this one's name for long.
  const late = setTimeout(() => {
    const isOther = drawn.value.shown && drawnView !== view.name;
    if (isOther && current() === view) draw(null, `${view.title} is being computed.`);
  }, LATE_MILLISECONDS);
  try {
    const answer = await numbersOf(view, against, { signal });
    if (signal.aborted || current() !== view) return;
    held = { key, answer };
    await showBoth(view, held, signal);
  } catch (error) {
    const { message, hint = "" } = /** @type {any} */ (error);
    if (signal.aborted || current() !== view) return;
    held = null;
    draw(null, `${message} ${hint}`);
  } finally {
    clearTimeout(late);
    if (!signal.aborted) isLoading.value = false;
  }
}

/**
 * What was tried, in a view's tables: from the events where they tell all of it, else from the
 * studio; null: nothing.
 */
async function triedIn(view, stored, /** @type {AbortSignal} */ signal) {
  if (!get("whatIf")) return null;
  const live = !isOfRun(view) && triedView(view.name);
  if (live) return live;
  const trial = get("trial");
  if (!trial || view.name === OVER_FRAMES.name) return null;
  const key = [stored.key, trial, queryOf(view, trial)].join(" ");
  if (heldTried?.key !== key) {
    const ridges = stored.answer.tables.find((table) => table.name === "ridges");
    const among = ridges ? records(ridges)[0]?.parameter : null;
    heldTried = { key, answer: await numbersOf(view, trial, { signal, among }) };
  }
  return heldTried.answer;
}

/** Show what is held, and beside it what was tried, once both are there. */
async function showBoth(view, stored, /** @type {AbortSignal} */ signal) {
  const tried = await triedIn(view, stored, signal).catch((error) => {
    if (!signal.aborted) throw error;
    return null;
  });
  if (!signal.aborted && held?.key === stored.key && current() === view)
    show(view, stored.answer, tried);
}

/**
 * What a drawing knows beside its tables.
 * @param {number} room
 * @param {ReturnType<typeof onOneAxis>} axis
 */
const at = (room, axis) => ({
  ...axis.counted,
  layer: axis.there(get("layer")),
  limb: get("limb"),
  parameter: get("parameter"),
  particle: get("particle"),
  camera: get("camera"),
  frame: get("frame"),
  over: get("over") === "run",
  layers: axis.counted.searchLayers * axis.counted.searches,
  label: labelOf,
  room,
  tried: axis.tried,
  score: get("summary")?.score ?? ["log weight", ""],
});

const byName = (answer) =>
  Object.fromEntries(answer.tables.map((table) => [table.name, records(table)]));
const onAxis = (answer) =>
  answer && {
    tables: byName(answer),
    counted: countedIn(answer, Math.max(1, layersShown() || get("layerCount") || 1)),
  };
const hasRows = (answer) => answer?.tables.some((table) => table.rows.length);

/** The numbers of both searches in one answer. */
const beside = (stored, tried) => ({
  ...stored,
  caption: `${stored.caption} Beside it: ${tried.caption}`,
  tables: [
    ...stored.tables,
    ...tried.tables.map((table) => ({ ...table, title: `${table.title}, tried` })),
  ],
});

function show(view, stored, /** @type {any} */ tried) {
  drawnView = view.name;
  const axis = onOneAxis(onAxis(stored), hasRows(tried) ? onAxis(tried) : null);
  const answer = axis.tried ? beside(stored, tried) : stored;
  if (!hasRows(stored)) {
    const none = view.is_job
      ? "Nothing computed yet: start it with the button above."
      : "There are no numbers of this frame.";
    return draw(shownOf(view, answer, axis, null), answer.notes.join(" ") || none);
  }
  const drawing = DRAWINGS[view.name][isOfRun(view) ? "run" : "frame"];
  return draw(
    shownOf(view, answer, axis, (sheet, room) => drawing(sheet, axis.stored, at(room, axis))),
  );
}

/**
 * The layers that there are of the frame that is searched, as a figure: in that view, or as their
 * variance where the view needs the frame's stored result; null without a layer.
 * @returns {Shown | null}
 */
export function liveFigure(name = "variance") {
  const own = liveView(name);
  const answer = own ?? liveView("variance");
  const view = named(own ? name : "variance");
  if (!answer || !view) return null;
  const title = named(name)?.title ?? "This view";
  const note = `${title} is drawn of a frame that is finished: choose one, or pause the search.`;
  const axis = onOneAxis(onAxis(answer), null);
  return shownOf(view, { ...answer, notes: own ? [] : [note] }, axis, (sheet, room) =>
    DRAWINGS[view.name].frame(sheet, axis.stored, at(room, axis)),
  );
}

/** A view as a figure; a layer that is clicked on the axis is chosen as its search counts it. */
function shownOf(view, answer, axis, drawing) {
  const take = (/** @type {Record<string, any>} */ changes) => {
    const { layer } = changes;
    choose(Number.isInteger(layer) ? { ...changes, layer: axis.back(layer) } : changes);
  };
  const frame = isOfRun(view) ? [] : [`frame${get("frame")}`];
  return {
    name: [get("session"), get("run"), ...frame, view.name].join("-"),
    title: view.title,
    question: view.question,
    caption: answer.caption,
    notes: answer.notes,
    tables: answer.tables,
    draw: drawing,
    choose: take,
    link: () => addressOf({ frame: get("frame") }),
  };
}

/** A click in a drawing: what it chooses, or which body it draws beside the answer. */
function choose(
  /** @type {Record<string, any>} */ { ghosts, mode, seed, place: _place, ...changes },
) {
  if (ghosts) return drawBeside(ghosts);
  if (mode === undefined && seed === undefined) return select(changes);
  const [key, value] = mode === undefined ? ["seed", seed] : ["mode", mode];
  const poses = held?.answer.tables.find((table) => table.name === "poses");
  const row = records(poses).find((one) => one[key] === value);
  const parameters = get("parameters");
  if (!row || !parameters) return undefined;
  return drawBeside([{ colour: "accent", pose: parameters.map(({ name }) => row[name]) }]);
}

/**
 * Draw bodies beside the answer in the scene.
 * @param {{ colour: string, pose: number[] }[]} ghosts
 */
export const drawBeside = (ghosts) => post("/api/scene/show", { ghosts }).catch(complain);

/** A choice among a view's own values. */
function Choice({ label, value, offered, choose: take }) {
  return html`<${Select}
    aria-label=${label}
    options=${offered}
    value=${value ?? ""}
    take=${(chosen) => take(chosen || null)}
  />`;
}

/** Whether the view is of the frame or of the run, where it has both. */
function Scope() {
  const ofRun = follow("over") === "run";
  const toggle = (label, over) => html`<button
    type="button"
    class="small toggle"
    aria-pressed=${String(ofRun === (over === "run"))}
    onClick=${() => set({ over })}
  >
    ${label}
  </button>`;
  return html`<div class="group" role="group" aria-label="Of what">
    ${toggle("This frame", null)}${toggle("Whole run", "run")}
  </div>`;
}

/** What can be chosen of the view that is shown. */
function Tools() {
  const view = followCurrent();
  const [parameter, second, towards] = [follow("parameter"), follow("second"), follow("towards")];
  const parameters = follow("parameters") ?? [];
  if (!view || !follow("run")) return null;
  const drawing = DRAWINGS[view.name];
  const offered = parameters.map(({ name, label }) => [name, label]);
  const line = parameter ? "along the parameter" : "line: chosen for you";
  const none = view.name === "landscape" ? "parameter…" : "parameter: chosen for you";
  const others = offered.filter(([name]) => name !== parameter);
  return html`
    ${drawing.frame && drawing.run && html`<${Scope} />`}
    ${
      view.uses.includes("parameter") &&
      html`<${Choice}
        label="Parameter"
        value=${parameter}
        offered=${[["", none], ...offered]}
        choose=${(name) => select({ parameter: name })}
      />`
    }
    ${
      view.uses.includes("second") &&
      html`<${Choice}
        label="Second parameter"
        value=${second}
        offered=${[["", "one parameter"], ...others]}
        choose=${(name) => set({ second: name })}
      />`
    }
    ${
      view.uses.includes("towards") &&
      html`<${Choice}
        label="Line"
        value=${towards}
        offered=${[["", line], ...TOWARDS]}
        choose=${(name) => set({ towards: name })}
      />`
    }
    ${view.name === "seeds" && html`<${SeedTools} />`}
    ${view.name === "uncertainty" && html`<${UncertaintyTools} />`}
  `;
}

/** The list of the views; up and down go from one to the next. */
function ViewList() {
  const list = useRef(/** @type {HTMLElement | null} */ (null));
  const shown = followCurrent();
  useEffect(() => {
    // Where the list stands in one line, the chosen view is seen in it.
    const [line, entry] = [list.current, list.current?.querySelector('[aria-current="true"]')];
    if (!line || !entry) return;
    const [outer, inner] = [line.getBoundingClientRect(), entry.getBoundingClientRect()];
    const right = inner.right + FADE_PIXELS - outer.right;
    if (inner.left < outer.left) line.scrollLeft += inner.left - outer.left;
    else if (right > 0) line.scrollLeft += right;
  }, [shown]);
  const takeArrow = (event) => {
    const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!by) return;
    event.preventDefault();
    stepView(by);
    /** @type {HTMLElement | undefined} */ (
      list.current?.children[views.value.indexOf(current())]
    )?.focus();
  };
  return html`<nav ref=${list} class="view-list" aria-label="Views" onKeyDown=${takeArrow}>
    ${views.value.map(
      (view, index) =>
        html`<button
          key=${view.name}
          type="button"
          class="view-entry"
          aria-current=${String(view === shown)}
          tabindex=${view === shown ? 0 : -1}
          title=${view.question}
          data-key=${view.name}
          onClick=${() => set({ view: view.name })}
        >
          <b>${index + 1}</b>${view.title}
        </button>`,
    )}
  </nav>`;
}

const Drawn = () => html`<${FigurePlace}
  panel="views"
  label="View"
  shown=${drawn.value.shown}
  words=${drawn.value.words}
  busy=${isLoading.value}
  tools=${html`<${Tools} />`}
  take=${(made) => {
    figure = made;
  }}
/>`;

/** The panel. */
export const Views = () => html`<${ViewList} /><${Drawn} />`;

/** Show the next view, or (by < 0) the one before. */
export function stepView(by) {
  const all = views.value;
  if (all.length) showView(all[(all.indexOf(current()) + by + all.length) % all.length].name);
}

/** Choose the next parameter, or (by < 0) the one before. */
export function stepParameter(by) {
  const names = (get("parameters") ?? []).map((one) => one.name);
  if (!names.length) return;
  const next = names.indexOf(get("parameter")) + by;
  select({ parameter: names[(next + names.length) % names.length] });
}

/** Show the numbers of the view as a table, or its drawing again. */
export function toggleTable() {
  if (!figure || get("panel") !== "views") return;
  figure.isTable = !figure.isTable;
  figure.refresh();
}

/** Write the view as something. @param {"svg" | "pdf" | "csv" | "link"} kind */
export const saveView = (kind) => figure?.save(kind);

const USED = [
  ...["session", "run", "frame", "layer", "limb", "parameter", "particle", "camera", "track"],
  ...["over", "second", "towards", "view", "panel", "summary", "whatIf", "trial", "against"],
  ...["trials", "parameters", "detail", "follow", "work"],
];

const loadLater = paced(load, LOAD_MILLISECONDS);
const asking = askingAbout(loadLater);

/** Load which views there are, and what the shown one draws. */
export function startViews() {
  fetchJson("/api/views")
    .then((answer) => {
      views.value = [...answer.views.filter((view) => DRAWINGS[view.name]), OVER_FRAMES];
      loadLater();
    })
    .catch(complain);
  watch(["view"], () => {
    if (figure) figure.isTable = false;
  });
  watch(USED, loadLater);
  onEvent("frame", (event, here) => {
    if (here && !event.reannealed) age += 1;
  });
  const computed = () => {
    age += 1;
    loadLater();
  };
  startSeeds(computed);
  startUncertainty(computed);
}
