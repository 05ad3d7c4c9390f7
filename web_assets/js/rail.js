// Sessions and their runs: list, open, import, new run, rename, duplicate, delete to the trash.

import { fetchJson, patch, post, remove, runPath, sessionPath } from "./api.js";
import { figure } from "./charts.js";
import { openForm, openMenu } from "./dialogs.js";
import { importForm } from "./importing.js";
import { complain, say } from "./messages.js";
import { newRunForm } from "./new_run.js";
import { startPoseForm } from "./start_pose.js";
import { get, set, watch } from "./state.js";
import { showPanel } from "./tabs.js";
import { makeTrackForm } from "./tracks.js";

const list = document.getElementById("sessions");

function element(tag, className, text = "") {
  const made = document.createElement(tag);
  made.className = className;
  made.textContent = text;
  return made;
}

/** Ask the server for the list again. */
export async function refreshSessions() {
  try {
    const told = await fetchJson("/api/sessions");
    // An answer that says nothing new leaves the list (and the focus in it) alone.
    if (JSON.stringify(told.sessions) !== JSON.stringify(get("sessions"))) set({ sessions: told.sessions });
  } catch (error) { complain(error); }
}

/** Open a session and one of its runs (the newest unless told). */
export function openSession(session, run) {
  const entry = get("sessions")?.find((one) => one.name === session);
  const chosen = run || entry?.runs?.[0]?.name || null;
  if (session === get("session") && chosen === get("run")) return;
  set({ session, run: chosen, track: "raw", summary: null, detail: null, parameters: null, layerCount: null, settings: null, whatIf: null, frame: null, layer: null, follow: true });
  document.body.classList.remove("rail-open");
}

/** Open a session without any of its runs. */
export function openSessionAlone(session) {
  set({ session, run: null, track: "raw", summary: null, detail: null, parameters: null, layerCount: null, settings: null, whatIf: null, frame: null, layer: null, follow: true });
  document.body.classList.remove("rail-open");
}

function renameForm(what, path, name, open, done) {
  openForm({
    heading: `Rename ${what}`, action: "Rename", rows: [[{ name: "name", label: "Name", value: name, required: true, pattern: "[A-Za-z0-9_\\-]{1,64}", title: "Letters, digits, - and _, up to 64" }]],
    send: async (values) => {
      if (values.name === name) return;
      await whileClosed(open, () => patch(path, { name: values.name }));
      await done(values.name);
    },
  });
}

function deleteForm(what, name, path, open, done) {
  openForm({
    heading: `Delete ${what} ${name}?`, intro: "It goes to the trash, from which it can be restored.", action: "Delete", danger: true, rows: [],
    send: async () => { await whileClosed(open, () => remove(path)); await done(); },
  });
}

/** Do something to an open session or run that makes its name void: it is closed meanwhile, and opened again if that fails. */
async function whileClosed(open, work) {
  const [session, run] = [get("session"), get("run")];
  if (open) openSession(null);
  try { await work(); } catch (error) { if (open) openSession(session, run ?? undefined); throw error; }
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

/** The guided way of a session, at its next step. */
export const wayPath = (entry) => `/way?session=${encodeURIComponent(entry.name)}`;

/** What a session that cannot be tracked yet says of itself. */
export const lacks = (entry) => ({ footage: "no footage yet", calibration: "not calibrated yet" })[entry.next_step] ?? "";

function sessionMenu(button, entry) {
  const path = sessionPath(entry.name);
  const open = get("session") === entry.name;
  const run = get("run") ?? undefined;
  openMenu(button, [
    ["Guided way", () => { location.href = wayPath(entry); }],
    ...(entry.next_step ? [] : [["New run…", () => newRunForm(entry)]]),
    ...(entry.next_step ? [] : [["Find the start pose…", () => startPoseForm(entry)]]),
    ...(entry.has_truth ? [["Compare trackers…", () => { location.href = comparisonsPath(entry); }]] : []),
    ["Rename…", () => renameForm("session", path, entry.name, open, async (name) => { await refreshSessions(); if (open) openSession(name, run); })],
    ["Duplicate", async () => { try { const made = await post(`${path}/duplicate`); await refreshSessions(); say(`${entry.name} is copied as ${made.name}.`); } catch (error) { complain(error); } }],
    ["Delete…", () => deleteForm("session", entry.name, path, open, async () => { await refreshSessions(); say(`${entry.name} is in the trash.`); if (open) openSession(get("sessions")?.[0]?.name ?? null); })],
  ]);
}

function runMenu(button, entry, run) {
  const path = runPath(entry.name, run.name);
  const open = get("session") === entry.name && get("run") === run.name;
  openMenu(button, [
    ["Refine…", () => makeTrackForm(entry.name, run.name, "refine")],
    ["Smooth…", () => makeTrackForm(entry.name, run.name, "smooth")],
    ["Export…", () => { openSession(entry.name, run.name); showPanel("export"); }],
    ["Poses as CSV", () => { location.href = `${path}/poses.csv`; }],
    ["New run like this…", () => newRunForm(entry, run)],
    ["Rename…", () => renameForm("run", path, run.name, open, async (name) => { await refreshSessions(); openSession(entry.name, name); })],
    ["Delete…", () => deleteForm("run", run.name, path, open, async () => { await refreshSessions(); if (open) openSession(entry.name); })],
  ]);
}

function runRow(entry, run) {
  const row = element("div", "run");
  row.setAttribute("role", "treeitem");
  row.setAttribute("aria-selected", String(entry.name === get("session") && run.name === get("run")));
  row.tabIndex = 0;
  row.dataset.key = `${entry.name}/${run.name}`;
  const words = element("div", "");
  words.append(element("div", "name", run.name), element("div", "facts", run.describe ?? run.tracker));
  const value = element("div", "figure");
  if (run.mean_mm != null) { value.append(figure(run.mean_mm), " "); value.append(Object.assign(element("small", ""), { textContent: "mm" })); }
  else value.append(element("small", "done", `${run.done}/${run.last - run.first}`));
  if (run.damaged?.length) value.append(" ", Object.assign(element("small", "damaged", `${run.damaged.length} damaged`), { title: `Frames ${run.damaged.join(", ")} are damaged on the disk: resume the run to track them again.` }));
  const more = element("button", "more", "⋯");
  more.setAttribute("aria-label", `More for ${run.name}`);
  more.onclick = (event) => { event.stopPropagation(); runMenu(more, entry, run); };
  row.append(words, value, more);
  row.onclick = () => openSession(entry.name, run.name);
  row.onkeydown = (event) => { if (event.key === "Enter" && event.target === row) row.onclick(); };
  return row;
}

function sessionBlock(entry) {
  const block = element("div", entry.name === get("session") ? "session open" : "session");
  const head = element("div", "head");
  head.tabIndex = 0;
  head.dataset.key = entry.name;
  head.setAttribute("role", "treeitem");
  head.setAttribute("aria-expanded", String(entry.name === get("session")));
  const picture = entry.next_step === "footage" ? element("span", "no-picture") : Object.assign(document.createElement("img"), { src: `${sessionPath(entry.name)}/thumbnail.jpg`, alt: "", loading: "lazy" });
  picture.onerror = () => picture.replaceWith(element("span", "no-picture"));
  const words = element("div", "");
  words.append(element("div", "name", entry.name), element("div", "facts", entry.problem || lacks(entry) || `${entry.cameras} ${entry.cameras === 1 ? "camera" : "cameras"} · ${entry.frame_count} frames`));
  const more = element("button", "more", "⋯");
  more.setAttribute("aria-label", `More for ${entry.name}`);
  more.onclick = (event) => { event.stopPropagation(); sessionMenu(more, entry); };
  head.append(picture, words, more);
  head.onclick = () => openSession(entry.name);
  head.onkeydown = (event) => { if (event.key === "Enter" && event.target === head) head.onclick(); };
  const runs = element("div", "runs");
  runs.setAttribute("role", "group");
  const fresh = element("button", "new-run quiet small", entry.next_step ? "Go on in the guided way" : "+ New run");
  fresh.onclick = entry.next_step ? () => { location.href = wayPath(entry); } : () => newRunForm(entry);
  const compare = element("a", "compare", entry.comparisons ? `${entry.comparisons} ${entry.comparisons === 1 ? "comparison" : "comparisons"}` : "Compare trackers");
  compare.href = comparisonsPath(entry);
  const last = element("div", "last-line");
  last.append(fresh, ...(entry.has_truth ? [compare] : []));
  runs.append(...entry.runs.map((run) => runRow(entry, run)), last);
  head.title = [entry.title, entry.problem || `${entry.frame_count} frames at ${figure(entry.fps)} per second, ${entry.body}`, ...(entry.warnings ?? [])].join("\n");
  block.append(head, runs);
  return block;
}

function draw() {
  const sessions = get("sessions");
  if (sessions === null) { list.replaceChildren(element("p", "empty", "Loading…")); return; }
  if (!sessions.length) { list.replaceChildren(element("p", "empty", "No sessions yet.")); return; }
  const at = list.scrollTop;
  const key = list.contains(document.activeElement) ? document.activeElement.dataset.key : undefined;
  list.replaceChildren(...sessions.map(sessionBlock));
  list.scrollTop = at;
  if (key) list.querySelector(`[data-key="${CSS.escape(key)}"]`)?.focus();
  drawProgress();
}

/** How far the run is that the tracking process has open. */
function drawProgress() {
  const work = get("work");
  if (!work?.run) return;
  const count = list.querySelector(`[data-key="${CSS.escape(`${work.session}/${work.run}`)}"] .done`);
  if (count) count.textContent = `${work.done}/${work.last - work.first}`;
}

/** Up and down go from line to line. */
function takeArrow(event) {
  const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  const lines = [...list.querySelectorAll("[role=treeitem]")].filter((line) => line.offsetParent);
  const at = lines.indexOf(event.target);
  if (!by || at < 0) return;
  event.preventDefault();
  lines[Math.max(0, Math.min(lines.length - 1, at + by))].focus();
}

async function drawTrash() {
  const line = document.getElementById("trash-line");
  const told = await fetchJson("/api/trash").catch(() => ({ entries: [] }));
  const entries = told.entries.filter((entry) => entry.restorable).reverse();
  line.hidden = !entries.length;
  line.replaceChildren(`${entries.length} in the trash`);
  const button = element("button", "quiet small", "Restore…");
  button.onclick = () => openMenu(button, entries.slice(0, 12).map((entry) => [`${entry.name} (${entry.kind})`, async () => {
    try {
      const told = await post("/api/trash/restore", { entry: entry.id });
      await refreshSessions();
      if (told.model) location.href = `/behaviours?name=${encodeURIComponent(told.model)}`;
      else if (told.comparison) location.href = `/comparisons?session=${encodeURIComponent(told.name)}&name=${encodeURIComponent(told.comparison)}`;
      else openSession(told.name, told.run || undefined);
    } catch (error) { complain(error); }
  }]));
  line.append(button);
}

/** Wire the rail. */
export function startRail() {
  document.getElementById("import-open").onclick = importForm;
  document.getElementById("way-new").onclick = () => { location.href = "/way?new"; };
  list.addEventListener("keydown", takeArrow);
  watch(["sessions", "session", "run"], draw);
  watch(["sessions"], () => { closeWhatIsGone(); drawTrash(); });
  watch(["work"], drawProgress);
}
