// The page of comparisons: a list by session at the left, the form or one comparison at the right.

import { fetchJson, post, remove } from "./api.js";
import { showForm } from "./comparison_form.js";
import {
  badge,
  clearComparison,
  isGoing,
  isSweep,
  shareOf,
  showComparison,
  sizeWords,
  updateProgress,
} from "./comparison_result.js";
import { openForm } from "./studio/dialogs.js";
import { bar, button, byId, element, fill } from "./elements.js";
import { askOnEach } from "./events.js";
import { complain, say } from "./messages.js";
import { paced } from "./pacing.js";
import { studioPath } from "./sessions.js";
import { showSweepForm } from "./sweep_form.js";
import { onTheme, startTheme } from "./theme.js";

/** @import { Schemas } from "./api_types" */

const PACE_MILLISECONDS = 500;

const content = byId("content");

/** @type {Schemas["ComparisonLine"][]} */
let lines = []; // of all comparisons
let sessions = [];
/** @typedef {{ session: string, name: string }} Place */
/** @type {Place | null} */
let open = null; // the shown one, null while the form is shown
/** @type {Schemas["ComparisonDetail"] | null} */
let detail = null;
/** @type {Schemas["ComparisonChoices"]} */
let choices = { candidates: [], lineups: [], weightings: [] };
/** @type {any[]} */
let bodies = [];
/** @type {any[]} */
let trackers = [];
/** @type {any[]} */
let weightings = [];

/** @returns {`/api/comparisons/${string}/${string}`} */
const pathOf = ({ session, name }) =>
  `/api/comparisons/${encodeURIComponent(session)}/${encodeURIComponent(name)}`;
const same = (a, b) => a && b && a.session === b.session && a.name === b.name;
const address = (query) => history.replaceState(null, "", `?${new URLSearchParams(query)}`);

async function refresh() {
  lines = (await fetchJson("/api/comparisons")).comparisons;
  drawList();
}

function entryOf(line) {
  const mark =
    line.status === "done" && line.best
      ? element(
          "span",
          { className: "mark", title: line.best },
          line.best_mm === null ? "done" : `${line.best_mm.toFixed(1)} mm`,
        )
      : element("span", { className: "mark" }, badge(line.status));
  const row = element(
    "button",
    {
      type: "button",
      className: "entry",
      title: line.trackers.join(", "),
      dataset: { key: `${line.session}/${line.name}` },
      onclick: () => openComparison(line).catch(complain),
    },
    element("span", { className: "name" }, line.name),
    mark,
    element("span", { className: "facts" }, sizeWords(line)),
    isGoing(line) && bar(shareOf(line)),
  );
  if (same(line, open)) row.ariaCurrent = "true";
  return row;
}

function drawList() {
  const groups = Map.groupBy(lines, (line) => line.session);
  fill(
    byId("entries"),
    lines.length
      ? [...groups].flatMap(([session, members]) => [
          element("h3", {}, session),
          ...members.map(entryOf),
        ])
      : element("p", { className: "empty" }, "No comparison yet."),
  );
}

async function openComparison({ session, name }) {
  open = { session, name };
  detail = await fetchJson(pathOf({ session, name }));
  address({ session, name });
  document.title = `${name} of ${session} · Comparisons`;
  show();
  drawList();
}

function show() {
  const [shown, place] = [detail, open];
  if (!shown || !place) return;
  showComparison(content, shown, {
    cancel: () => act(place, () => post(`${pathOf(place)}/cancel`)),
    resume: () => act(place, () => post(`${pathOf(place)}/resume`)),
    again: () =>
      isSweep(shown.comparison) ? openNewSweep(sweepLike(shown)) : openNew(initialLike(shown)),
    remove: () => removeForm(shown.comparison),
    session: place.session,
    look: (trial) => look(place, trial),
    show: (trial, frame = trial.worst_frame) => showTrial(place, trial, frame),
  });
}

/**
 * Open the run of a trial at its worst frame.
 * @param {Place} place
 * @param {Schemas["TrialLine"]} trial
 */
async function look(place, trial) {
  try {
    const { session, run } = await post(`${pathOf(place)}/trials`, {
      tracker: trial.tracker,
      seed: trial.seed,
    });
    location.href = studioPath(session, run, { frame: trial.worst_frame, panel: "why" });
  } catch (error) {
    complain(error);
  }
}

/**
 * Go to the run of a trial; where there is none, to the button that makes it.
 * @param {Place} place
 * @param {Schemas["TrialLine"]} trial
 * @param {number} frame
 */
function showTrial(place, trial, frame) {
  if (trial.run) location.href = studioPath(place.session, trial.run, { frame, panel: "why" });
  else
    content.querySelector(`[data-trial="${CSS.escape(`${trial.tracker} ${trial.seed}`)}"]`).focus();
}

/** @param {Place} place @param {() => Promise<any>} doing */
async function act(place, doing) {
  try {
    await doing();
    await openComparison(place);
    await refresh();
  } catch (error) {
    complain(error);
  }
}

function removeForm(line) {
  openForm({
    heading: `Delete ${line.name}?`,
    action: "Delete",
    danger: true,
    intro: "It goes to the trash of the studio, where it can be restored.",
    rows: isSweep(line) ? [[{ name: "runs", kind: "check", label: "its runs, too" }]] : [],
    send: async (values) => {
      await remove(`${pathOf(line)}${values.runs ? "?runs=true" : ""}`);
      open = null;
      await refresh();
      if (lines.length)
        await openComparison(lines.find((one) => one.session === line.session) ?? lines[0]);
      else openNew({});
    },
  });
}

/** What the form has to be filled with to compare the same again. */
function initialLike({ comparison: line, settings, body, split_frames }) {
  const weightings = new Set(line.trackers.map((name) => settings[name].weighting));
  const common = weightings.size === 1 ? [...weightings][0] : null;
  const trackers = line.trackers.map((name) => {
    const { weighting, ...knobs } = settings[name];
    const known = choices.candidates.find((one) => one.name === name)?.changes ?? {};
    const brought =
      choices.candidates.find((one) => one.tracker === name.split(":")[0])?.sized_by ?? [];
    const own = Object.entries(knobs).filter(
      ([knob, value]) => !brought.includes(knob) && known[knob] !== value,
    );
    return { name, settings: Object.fromEntries(own), weighting: common ? null : weighting };
  });
  const layers = Object.values(settings).find((one) => one.layers)?.layers;
  return {
    session: line.session,
    trackers,
    evaluations: line.evaluations,
    seeds: line.seeds,
    weighting: common,
    body,
    first: line.first,
    last: line.last,
    layers,
    split_frames,
  };
}

/**
 * What the form has to be filled with to sweep the same again.
 * @param {Schemas["ComparisonDetail"]} detail
 */
function sweepLike({ comparison: line, settings, body, behaviour, fit_shape }) {
  const [{ weighting, ...knobs }] = Object.values(settings);
  const fixed = Object.entries(knobs)
    .filter(([name]) => !(name in line.vary))
    .map(([name, value]) => `${name}=${value}`)
    .join(", ");
  const vary = Object.fromEntries(
    Object.entries(line.vary).map(([name, values]) => [name, values.join(", ")]),
  );
  return {
    session: line.session,
    tracker: line.tracker,
    weighting,
    vary,
    fixed,
    seeds: line.seeds,
    first: line.first,
    last: line.last,
    body,
    behaviour,
    fit_shape,
  };
}

/** Take away what is shown, for a form. */
function clearForForm(kind, initial, title) {
  clearComparison();
  open = detail = null;
  address({ new: kind, ...(initial.session ? { session: initial.session } : {}) });
  document.title = `${title} · Capture studio`;
}

const started = (line) => {
  refresh()
    .then(() => openComparison(line))
    .catch(complain);
};

function openNew(initial) {
  clearForForm("", initial, "New comparison");
  showForm(content, {
    sessions,
    choices,
    bodies,
    initial,
    started,
    instead: button("Sweep knobs instead…", () => openNewSweep({ session: initial.session })),
  });
  drawList();
}

function openNewSweep(initial) {
  clearForForm("sweep", initial, "New sweep");
  showSweepForm(content, {
    sessions,
    trackers,
    weightings,
    initial,
    started,
    instead: button("Compare trackers instead…", () => openNew({ session: initial.session })),
  }).catch(complain);
  drawList();
}

/** Show how all comparisons stand; the open one again where it has ended, or goes on. */
const lookAgain = paced(async () => {
  try {
    await refresh();
    const line = lines.find((one) => same(one, open));
    if (line && detail && line.status !== detail.comparison.status) await openComparison(line);
    else if (line) updateProgress(content, line);
  } catch (error) {
    complain(error);
  }
}, PACE_MILLISECONDS);

async function start() {
  startTheme();
  onTheme(() => detail?.result && show());
  byId("new").onclick = () => openNew({ session: open?.session });
  try {
    const [listed, known, made] = await Promise.all([
      fetchJson("/api/sessions"),
      fetchJson("/api/choices"),
      fetchJson("/api/comparisons/choices"),
    ]);
    [sessions, bodies, trackers, weightings, choices] = [
      listed.sessions,
      known.bodies,
      known.trackers,
      known.weightings,
      made,
    ];
    askOnEach("comparison", lookAgain);
    await refresh();
    const query = new URLSearchParams(location.search);
    const wanted = lines.find(
      (line) => line.session === query.get("session") && line.name === query.get("name"),
    );
    const session = query.get("session");
    // Another session's comparison is no answer to a link to this one.
    const newest = session ? lines.find((line) => line.session === session) : lines[0];
    if (session && !sessions.some((one) => one.name === session))
      say(`Session “${session}” is not here.`, { kind: "warning" });
    else if (query.get("name") && !wanted)
      say(`${session} has no comparison “${query.get("name")}”.`, { kind: "warning" });
    if (query.get("new") === "sweep") openNewSweep({ session: query.get("session") ?? undefined });
    else if (query.has("new") || !newest) openNew({ session: query.get("session") ?? undefined });
    else await openComparison(wanted ?? newest);
  } catch (error) {
    complain(error);
  }
}

start();
