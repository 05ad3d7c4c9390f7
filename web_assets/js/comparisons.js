// The page of comparisons: a list by session at the left, the form or one comparison at the right.

import { fetchJson, post, remove } from "./api.js";
import { showForm } from "./comparison_form.js";
import { badge, clearComparison, showComparison, updateProgress } from "./comparison_result.js";
import { openForm } from "./dialogs.js";
import { element } from "./elements.js";
import { complain } from "./messages.js";
import { onTheme, startTheme } from "./theme.js";

const POLL_MILLISECONDS = 1000;
const GOING = ["queued", "running", "cancelling"];

const list = document.getElementById("entries");
const content = document.getElementById("content");

let lines = [];        // of all comparisons
let sessions = [];
let open = null;       // {session, name} of the shown one, null while the form is shown
let detail = null;
let timer = null;

const pathOf = ({ session, name }) => `/api/comparisons/${encodeURIComponent(session)}/${encodeURIComponent(name)}`;
const same = (a, b) => a && b && a.session === b.session && a.name === b.name;

function address(query) {
  const text = new URLSearchParams(query).toString();
  history.replaceState(null, "", text ? `?${text}` : location.pathname);
}

async function refresh() {
  lines = (await fetchJson("/api/comparisons")).comparisons;
  drawList();
}

function entryOf(line) {
  const going = GOING.includes(line.status);
  const mark = line.status === "done" && line.best
    ? element("span", { className: "mark", textContent: `${line.best_mm.toFixed(1)} mm`, title: line.best })
    : element("span", { className: "mark" }, badge(line.status));
  const row = element("button", { type: "button", className: "entry", title: line.trackers.join(", ") },
    element("span", { className: "name", textContent: line.name }), mark,
    element("span", { className: "facts", textContent: `${line.trackers.length} trackers · ${line.evaluations} poses · ${line.seeds} ${line.seeds === 1 ? "seed" : "seeds"}` }),
    going && element("span", { className: "progress" }, element("i", { style: `width: ${(100 * line.done) / Math.max(1, line.total)}%` })));
  if (same(line, open)) row.setAttribute("aria-current", "true");
  row.onclick = () => openComparison(line).catch(complain);
  return row;
}

function drawList() {
  const groups = new Map();
  for (const line of lines) groups.set(line.session, [...(groups.get(line.session) ?? []), line]);
  const blocks = [...groups].flatMap(([session, members]) => [element("h3", { textContent: session }), ...members.map(entryOf)]);
  list.replaceChildren(...(blocks.length ? blocks : [element("p", { className: "empty", textContent: "No comparison yet." })]));
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
    again: () => openNew(wishLike(detail)), remove: () => askToRemove(detail.comparison),
  });
}

async function act(doing) {
  try {
    await doing();
    await openComparison(open);
    await refresh();
  } catch (error) { complain(error); }
}

function askToRemove(line) {
  openForm({
    heading: `Delete ${line.name}?`, action: "Delete", danger: true, rows: [], intro: "It goes to the trash of the studio, where it can be restored.",
    send: async () => {
      await remove(pathOf(line));
      open = null;
      await refresh();
      if (lines.length) await openComparison(lines.find((one) => one.session === line.session) ?? lines[0]);
      else await openNew({});
    },
  });
}

/** What the form has to be filled with to ask for the same again. */
function wishLike({ comparison: line, settings, body }) {
  const first = settings[line.trackers[0]].weighting;
  const common = line.trackers.every((name) => settings[name].weighting === first) ? first : null;
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

let choices = null;
let bodies = [];

async function openNew(wish) {
  clearTimeout(timer);
  clearComparison();
  open = detail = null;
  address({ new: "", ...(wish.session ? { session: wish.session } : {}) });
  document.title = "New comparison · Capture studio";
  showForm(content, {
    sessions, choices, bodies, wish,
    started: (line) => { refresh().then(() => openComparison(line)).catch(complain); },
  });
  drawList();
}

/** Ask once a second while something is going on. */
function watchProgress() {
  clearTimeout(timer);
  if (!lines.some((line) => GOING.includes(line.status)) && !GOING.includes(detail?.comparison.status)) return;
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
  document.getElementById("new").onclick = () => openNew({ session: open?.session });
  try {
    const [told, known, made] = await Promise.all([fetchJson("/api/sessions"), fetchJson("/api/choices"), fetchJson("/api/comparisons/choices")]);
    [sessions, bodies, choices] = [told.sessions, known.bodies, made];
    await refresh();
    const wish = new URLSearchParams(location.search);
    const asked = lines.find((line) => line.session === wish.get("session") && line.name === wish.get("name"));
    const newest = lines.find((line) => line.session === wish.get("session")) ?? lines[0];
    if (wish.has("new") || !newest) await openNew({ session: wish.get("session") ?? undefined });
    else await openComparison(asked ?? newest);
  } catch (error) { complain(error); }
}

start();
