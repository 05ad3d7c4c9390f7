// Sessions and their runs: list, open, import, new run, rename, duplicate, delete to the trash.

import { fetchJson, patch, post, readOnly, remove, runPath, sessionPath } from "./api.js";
import { figure } from "./chart_looks.js";
import { compareForm } from "./comparing.js";
import { openForm, openMenu } from "./dialogs.js";
import { acceptDrops } from "./dropping.js";
import { button, byId, element, fill, NAME } from "./elements.js";
import { importForm } from "./importing.js";
import { complain, say } from "./messages.js";
import { newRunForm } from "./new_run.js";
import { lacks, openSession, refreshSessions, setupPath, studioPath } from "./sessions.js";
import { startPoseForm } from "./start_pose.js";
import { get, watch } from "./state.js";
import { showPanel } from "./tabs.js";
import { makeTrackForm } from "./tracks.js";

const list = byId("sessions");
const counted = (count, word) => `${count} ${count === 1 ? word : `${word}s`}`;
const go = (address) => { location.href = address; };

/** Do something to an open session or run that makes its name void: it is closed meanwhile, and opened again if that fails. */
async function whileClosed(open, work) {
  const [session, run] = [get("session"), get("run")];
  if (open) openSession(null);
  try { await work(); } catch (error) { if (open) openSession(session, run ?? undefined); throw error; }
}

/** Rename what is at an API address; `done(name)` follows. */
function renameForm(what, path, name, open, done) {
  openForm({
    heading: `Rename ${what}`, action: "Rename", rows: [[{ name: "name", label: "Name", value: name, ...NAME }]],
    send: async (values) => {
      if (values.name === name) return;
      await whileClosed(open, () => patch(path, { name: values.name }));
      await refreshSessions();
      done(values.name);
    },
  });
}

/** Delete what is at an API address; `done()` follows. */
function deleteForm(what, path, name, open, done) {
  openForm({
    heading: `Delete ${what} ${name}?`, intro: "It goes to the trash, from which it can be restored.", action: "Delete", danger: true, rows: [],
    send: async () => {
      await whileClosed(open, () => remove(path));
      await refreshSessions();
      done();
    },
  });
}

async function duplicate(entry) {
  try {
    const made = await post(`${sessionPath(entry.name)}/duplicate`);
    await refreshSessions();
    say(`${entry.name} is copied as ${made.name}.`);
  } catch (error) { complain(error); }
}

/** A session or run that went away in another window is closed. */
function closeWhatIsGone() {
  const sessions = get("sessions");
  const entry = sessions?.find((one) => one.name === get("session"));
  if (!sessions || !get("session")) return;
  if (!entry) openSession(sessions[0]?.name ?? null);
  else if (get("run") && !entry.runs.some((run) => run.name === get("run"))) openSession(entry.name);
}

/** The page of a session's comparisons; the form of a first one where there is none. */
const comparisonsPath = (entry) => `/comparisons?session=${encodeURIComponent(entry.name)}${entry.comparisons ? "" : "&new"}`;

function sessionMenu(opener, entry) {
  const path = sessionPath(entry.name);
  const open = get("session") === entry.name;
  const run = get("run") ?? undefined;
  openMenu(opener, [
    ["Guided set-up", () => go(setupPath(entry))],
    ...(entry.next_step ? [] : [["New run…", () => newRunForm(entry)], ["Find the start pose…", () => startPoseForm(entry)]]),
    ...(entry.has_truth ? [["Compare trackers…", () => go(comparisonsPath(entry))]] : []),
    ...(entry.next_step ? [] : [["Sweep knobs…", () => go(`/comparisons?${new URLSearchParams({ new: "sweep", session: entry.name })}`)]]),
    ["Rename…", () => renameForm("session", path, entry.name, open, (name) => { if (open) openSession(name, run); })],
    ["Duplicate", () => duplicate(entry)],
    ["Delete…", () => deleteForm("session", path, entry.name, open, () => { say(`${entry.name} is in the trash.`); if (open) openSession(get("sessions")?.[0]?.name ?? null); })],
  ]);
}

/** A run as one page, with the particles of chosen frames. */
function shareForm(path, isOpen) {
  const shown = isOpen && get("frame") !== null ? String(get("frame")) : "";
  openForm({
    heading: "Share as one page", intro: "One file that opens without the studio: settings, charts, the body moving, and layer by layer the particles of the frames that you name.", action: "Save the page",
    rows: [[{ name: "frames", label: "Frames with particles (9, 13, …)", value: shown, placeholder: "the worst one" }]],
    send: ({ frames }) => {
      const chosen = String(frames ?? "").split(/[\s,]+/).filter(Boolean);
      if (chosen.some((one) => !/^\d+$/.test(one)) || chosen.length > 12) throw Object.assign(new Error(`'${frames}' are not up to twelve frames.`), { hint: "Write their numbers, with commas between." });
      go(`${path}/shared.html?${new URLSearchParams([...chosen.slice(0, 1).map((one) => ["frame", one]), ...chosen.slice(1).map((one) => ["clouds", one])])}`);
    },
  });
}

function runMenu(opener, entry, run) {
  const path = runPath(entry.name, run.name);
  const open = get("session") === entry.name && get("run") === run.name;
  openMenu(opener, [
    ["Refine…", () => makeTrackForm(entry.name, run.name, "refine")],
    ["Smooth…", () => makeTrackForm(entry.name, run.name, "smooth")],
    ["Export…", () => { openSession(entry.name, run.name); showPanel("export"); }],
    ["Share as one page…", () => shareForm(path, open)],
    ["Poses as CSV", () => go(`${path}/poses.csv`)],
    ["Compare with…", () => compareForm(entry.name, run.name)],
    ["New run like this…", () => newRunForm(entry, run)],
    ["Rename…", () => renameForm("run", path, run.name, open, (name) => openSession(entry.name, name))],
    ["Delete…", () => deleteForm("run", path, run.name, open, () => { if (open) openSession(entry.name); })],
  ]);
}

/** A line of the list: a click or Enter opens it, its button the menu. */
function line(key, className, properties, open, menu, ...children) {
  const more = element("button", { className: "more", ariaLabel: `More for ${key.split("/").at(-1)}`, onclick: (event) => { event.stopPropagation(); menu(more); } }, "⋯");
  const row = element("div", { className, role: "treeitem", tabIndex: 0, dataset: { key }, onclick: open, ...properties }, ...children, more);
  row.onkeydown = (event) => { if (event.key === "Enter" && event.target === row) open(); };
  return row;
}

const lineWords = (name, facts) => element("div", {}, element("div", { className: "name" }, name), element("div", { className: "facts" }, facts));

/** How much of a run is tracked, in words that are the same everywhere. */
const countWords = (done, all) => `${done} of ${all}`;

function runRow(entry, run) {
  const measured = run.mean_mm != null;
  const all = run.last - run.first;
  const partial = run.done < all;
  const count = partial && element("small", { className: "done", title: `${countWords(run.done, all)} frames are tracked${measured ? ": the mean is of these only" : ""}.` }, countWords(run.done, all));
  const figures = element("div", { className: "figure" }, measured ? [figure(run.mean_mm), " ", element("small", {}, partial ? "mm, partial " : "mm"), count] : partial ? count : element("small", { className: "done" }, countWords(run.done, all)),
    run.damaged?.length > 0 && [" ", element("a", { className: "damaged", href: studioPath(entry.name, run.name, { frame: run.damaged[0] }), onclick: (event) => event.stopPropagation(), title: `Frames ${run.damaged.join(", ")} are damaged on the disk: resume the run to track them again.` }, `${run.damaged.length} damaged`)]);
  return line(`${entry.name}/${run.name}`, "run", { ariaSelected: String(entry.name === get("session") && run.name === get("run")) },
    () => openSession(entry.name, run.name), (more) => runMenu(more, entry, run), lineWords(run.name, run.describe ?? run.tracker), figures);
}

/** Runs of a sweep, as SWEEP-pPOINT-sSEED. */
const SWEPT = /^(.+)-p\d+-s\d+(-\d+)?$/;
/** @type {Set<string>} */
const unfolded = new Set();

/** The rows of a session's runs; those of a sweep are folded under one line. */
function runRows(entry) {
  const groups = Map.groupBy(entry.runs, (run) => SWEPT.exec(run.name)?.[1] ?? run);
  return [...groups].flatMap(([sweep, runs]) => {
    if (typeof sweep !== "string") return runs.map((run) => runRow(entry, run));
    const key = `${entry.name}/${sweep}`;
    const isOpen = unfolded.has(key) || (entry.name === get("session") && runs.some((run) => run.name === get("run")));
    const fold = () => { if (unfolded.has(key)) unfolded.delete(key); else unfolded.add(key); draw(); };
    const all = element("a", { className: "sweep-result", href: `/comparisons?${new URLSearchParams({ session: entry.name, name: sweep })}`, onclick: (event) => event.stopPropagation() }, "result");
    const head = element("div", { className: "run swept", role: "treeitem", tabIndex: 0, ariaExpanded: String(isOpen), dataset: { key }, onclick: fold }, lineWords(`${isOpen ? "▾" : "▸"} ${sweep}`, `sweep · ${counted(runs.length, "run")}`), all);
    head.onkeydown = (event) => { if (event.key === "Enter" && event.target === head) fold(); };
    return [head, ...(isOpen ? [...runs].sort((a, b) => a.name.localeCompare(b.name, "en", { numeric: true })).map((run) => runRow(entry, run)) : [])];
  });
}

function sessionBlock(entry) {
  const isOpen = entry.name === get("session");
  const empty = () => element("span", { className: "no-picture" });
  const picture = entry.next_step === "footage" ? empty() : element("img", { src: `${sessionPath(entry.name)}/thumbnail.jpg`, alt: "", loading: "lazy" });
  picture.onerror = () => picture.replaceWith(empty());
  const title = [entry.title, entry.problem || `${entry.frame_count} frames at ${figure(entry.fps)} per second, ${entry.body}`, ...(entry.warnings ?? [])].join("\n");
  const head = line(entry.name, "head", { ariaExpanded: String(isOpen), title }, () => openSession(entry.name), (more) => sessionMenu(more, entry),
    picture, lineWords(entry.name, entry.problem || lacks(entry) || `${counted(entry.cameras, "camera")} · ${entry.frame_count} frames`));
  const next = entry.next_step ? button("Continue in the guided set-up", () => go(setupPath(entry)), "new-run quiet small") : button("+ New run", () => newRunForm(entry), "new-run quiet small");
  const compare = entry.has_truth && element("a", { className: "compare", href: comparisonsPath(entry) }, entry.comparisons ? counted(entry.comparisons, "comparison") : "Compare trackers");
  return element("div", { className: isOpen ? "session open" : "session" }, head,
    element("div", { className: "runs", role: "group" }, runRows(entry), element("div", { className: "last-line", role: "treeitem", tabIndex: -1, ariaLabel: entry.next_step ? "Next step" : "New run" }, next, compare)));
}

function draw() {
  const sessions = get("sessions");
  const empty = (words) => fill(list, element("p", { className: "empty" }, words));
  if (sessions === null) return empty("Loading…");
  if (!sessions.length) return empty("No sessions yet.");
  fill(list, sessions.map(sessionBlock));
  drawProgress();
}

/** How far the run is that the tracking process has open. */
function drawProgress() {
  const work = get("work");
  if (!work?.run) return;
  const count = list.querySelector(`[data-key="${CSS.escape(`${work.session}/${work.run}`)}"] .done`);
  if (count) count.textContent = countWords(work.done, work.last - work.first);
}

/** Up and down go from line to line. */
function takeArrow(event) {
  const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  const lines = [...list.querySelectorAll("[role=treeitem]")].filter((one) => one.offsetParent);
  const at = lines.indexOf(event.target);
  if (!by || at < 0) return;
  event.preventDefault();
  lines[Math.max(0, Math.min(lines.length - 1, at + by))].focus();
}

/** Open what came back from the trash. */
function openRestored({ name, run = "", model = "", comparison = "" }) {
  if (model) go(`/behaviours?name=${encodeURIComponent(model)}`);
  else if (comparison) go(`/comparisons?${new URLSearchParams({ session: name, name: comparison })}`);
  else openSession(name, run || undefined);
}

async function drawTrash() {
  const { entries } = await fetchJson("/api/trash").catch(() => ({ entries: [] }));
  const restorable = entries.filter((entry) => entry.restorable).reverse();
  const restore = async (entry) => {
    try {
      const restored = await post("/api/trash/restore", { entry: entry.id });
      await refreshSessions();
      openRestored(restored);
    } catch (error) { complain(error); }
  };
  const opener = button("Restore…", () => openMenu(opener, restorable.slice(0, 12).map((entry) => [`${entry.name} (${entry.kind})`, () => restore(entry)])), "quiet small");
  byId("trash-line").hidden = !restorable.length;
  fill(byId("trash-line"), `${restorable.length} in the trash`, opener);
}

/** Wire the rail. */
export function startRail() {
  byId("import-open").onclick = () => importForm();
  if (!readOnly) acceptDrops("Drop videos or a folder to import them", importForm);
  byId("session-new").onclick = () => go("/way?new");
  list.addEventListener("keydown", takeArrow);
  watch(["sessions", "session", "run"], draw);
  watch(["sessions"], () => { closeWhatIsGone(); drawTrash(); });
  watch(["work"], drawProgress);
}
