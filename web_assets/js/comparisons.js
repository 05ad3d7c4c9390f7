// The page of comparisons: a list by session at the left, the form or one comparison at the right.

import { fetchJson, post, remove } from "./api.js";
import { showForm } from "./comparison_form.js";
import { badge, clearComparison, isGoing, shareOf, showComparison, sizeWords, updateProgress } from "./comparison_result.js";
import { openForm } from "./dialogs.js";
import { bar, byId, element, fill } from "./elements.js";
import { complain } from "./messages.js";
import { onTheme, startTheme } from "./theme.js";

/** @import { Schemas } from "./api_types" */

const POLL_MILLISECONDS = 1000;

const content = byId("content");

/** @type {Schemas["ComparisonLine"][]} */
let lines = [];        // of all comparisons
let sessions = [];
let open = null;       // {session, name} of the shown one, null while the form is shown
/** @type {Schemas["ComparisonDetail"]} */
let detail = null;
/** @type {Schemas["ComparisonChoices"]} */
let choices = null;
let bodies = [];
let timer = 0;

/** @returns {`/api/comparisons/${string}/${string}`} */
const pathOf = ({ session, name }) => `/api/comparisons/${encodeURIComponent(session)}/${encodeURIComponent(name)}`;
const same = (a, b) => a && b && a.session === b.session && a.name === b.name;
const address = (query) => history.replaceState(null, "", `?${new URLSearchParams(query)}`);

async function refresh() {
  lines = (await fetchJson("/api/comparisons")).comparisons;
  drawList();
}

function entryOf(line) {
  const mark = line.status === "done" && line.best ? element("span", { className: "mark", title: line.best }, `${line.best_mm.toFixed(1)} mm`) : element("span", { className: "mark" }, badge(line.status));
  const row = element("button", { type: "button", className: "entry", title: line.trackers.join(", "), dataset: { key: `${line.session}/${line.name}` }, onclick: () => openComparison(line).catch(complain) },
    element("span", { className: "name" }, line.name), mark, element("span", { className: "facts" }, sizeWords(line)), isGoing(line) && bar(shareOf(line)));
  if (same(line, open)) row.ariaCurrent = "true";
  return row;
}

function drawList() {
  const groups = Map.groupBy(lines, (line) => line.session);
  fill(byId("entries"), lines.length ? [...groups].flatMap(([session, members]) => [element("h3", {}, session), ...members.map(entryOf)]) : element("p", { className: "empty" }, "No comparison yet."));
}

async function openComparison({ session, name }) {
  open = { session, name };
  detail = await fetchJson(pathOf(open));
  address({ session, name });
  document.title = `${name} of ${session} · Comparisons`;
  show();
  drawList();
  watchProgress();
}

function show() {
  showComparison(content, detail, {
    cancel: () => act(() => post(`${pathOf(open)}/cancel`)), resume: () => act(() => post(`${pathOf(open)}/resume`)),
    again: () => openNew(initialLike(detail)), remove: () => removeForm(detail.comparison),
  });
}

async function act(doing) {
  try {
    await doing();
    await openComparison(open);
    await refresh();
  } catch (error) { complain(error); }
}

function removeForm(line) {
  openForm({
    heading: `Delete ${line.name}?`, action: "Delete", danger: true, rows: [], intro: "It goes to the trash of the studio, where it can be restored.",
    send: async () => {
      await remove(pathOf(line));
      open = null;
      await refresh();
      if (lines.length) await openComparison(lines.find((one) => one.session === line.session) ?? lines[0]);
      else openNew({});
    },
  });
}

/** What the form has to be filled with to compare the same again. */
function initialLike({ comparison: line, settings, body }) {
  const weightings = new Set(line.trackers.map((name) => settings[name].weighting));
  const common = weightings.size === 1 ? [...weightings][0] : null;
  const trackers = line.trackers.map((name) => {
    const { weighting, ...knobs } = settings[name];
    const known = choices.entrants.find((one) => one.name === name)?.changes ?? {};
    const brought = choices.entrants.find((one) => one.tracker === name.split(":")[0])?.sized_by ?? [];
    const own = Object.entries(knobs).filter(([knob, value]) => !brought.includes(knob) && known[knob] !== value);
    return { name, settings: Object.fromEntries(own), weighting: common ? null : weighting };
  });
  const layers = Object.values(settings).find((one) => one.layers)?.layers;
  return { session: line.session, trackers, evaluations: line.evaluations, seeds: line.seeds, weighting: common, body, first: line.first, last: line.last, layers };
}

function openNew(initial) {
  clearTimeout(timer);
  clearComparison();
  open = detail = null;
  address({ new: "", ...(initial.session ? { session: initial.session } : {}) });
  document.title = "New comparison · Capture studio";
  showForm(content, { sessions, choices, bodies, initial, started: (line) => { refresh().then(() => openComparison(line)).catch(complain); } });
  drawList();
}

/** Ask once a second while something is going on. */
function watchProgress() {
  clearTimeout(timer);
  if (![...lines, detail?.comparison].some(isGoing)) return;
  timer = setTimeout(async () => {
    try {
      await refresh();
      const line = lines.find((one) => same(one, open));
      if (line && detail && line.status !== detail.comparison.status) return await openComparison(line);
      if (line) updateProgress(content, line);
    } catch (error) { complain(error); }
    watchProgress();
  }, POLL_MILLISECONDS);
}

async function start() {
  startTheme();
  onTheme(() => detail?.result && show());
  byId("new").onclick = () => openNew({ session: open?.session });
  try {
    const [listed, known, made] = await Promise.all([fetchJson("/api/sessions"), fetchJson("/api/choices"), fetchJson("/api/comparisons/choices")]);
    [sessions, bodies, choices] = [listed.sessions, known.bodies, made];
    await refresh();
    const query = new URLSearchParams(location.search);
    const wanted = lines.find((line) => line.session === query.get("session") && line.name === query.get("name"));
    const newest = lines.find((line) => line.session === query.get("session")) ?? lines[0];
    if (query.has("new") || !newest) openNew({ session: query.get("session") ?? undefined });
    else await openComparison(wanted ?? newest);
  } catch (error) { complain(error); }
}

start();
