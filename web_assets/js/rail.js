// Sessions and their runs: list, open, import, new run, rename, duplicate, delete to the trash.

import { fetchJson, patch, post, remove, runPath, sessionPath } from "./api.js";
import { figure } from "./charts.js";
import { openForm, openMenu } from "./dialogs.js";
import { importForm } from "./importing.js";
import { complain, say } from "./messages.js";
import { newRunForm } from "./new_run.js";
import { get, set, watch } from "./state.js";

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
    set({ sessions: told.sessions });
  } catch (error) { complain(error); }
}

/** Open a session and one of its runs (the newest unless told). */
export function openSession(session, run) {
  const entry = get("sessions")?.find((one) => one.name === session);
  const chosen = run ?? entry?.runs?.[0]?.name ?? null;
  if (session === get("session") && chosen === get("run")) return;
  set({ session, run: chosen, summary: null, detail: null, whatIf: null, frame: null, layer: null, follow: true });
  document.body.classList.remove("rail-open");
}

function renameForm(what, path, name, done) {
  openForm({
    heading: `Rename ${what}`, action: "Rename", rows: [[{ name: "name", label: "Name", value: name, required: true, pattern: "[A-Za-z0-9_\\-]{1,64}", title: "Letters, digits, - and _, up to 64" }]],
    send: async (values) => { await patch(path, { name: values.name }); await done(values.name); },
  });
}

function deleteForm(what, name, path, done) {
  openForm({
    heading: `Delete ${what} ${name}?`, intro: "It goes to the workspace's trash and can be restored from there.", action: "Delete", danger: true, rows: [],
    send: async () => { await remove(path); await done(); },
  });
}

function sessionMenu(button, entry) {
  const path = sessionPath(entry.name);
  const closed = () => { if (get("session") === entry.name) set({ session: null, run: null, summary: null, detail: null, frame: null }); };
  openMenu(button, [
    ["New run…", () => newRunForm(entry)],
    ["Rename…", () => renameForm("session", path, entry.name, async (name) => { closed(); await refreshSessions(); openSession(name); })],
    ["Duplicate", async () => { try { await post(`${path}/duplicate`); await refreshSessions(); } catch (error) { complain(error); } }],
    ["Delete…", () => deleteForm("session", entry.name, path, async () => { closed(); await refreshSessions(); say(`${entry.name} is in the trash.`); })],
  ]);
}

function runMenu(button, entry, run) {
  const path = runPath(entry.name, run.name);
  openMenu(button, [
    ["Poses as CSV", () => { location.href = `${path}/poses.csv`; }],
    ["New run like this…", () => newRunForm(entry, run)],
    ["Rename…", () => renameForm("run", path, run.name, async (name) => { await refreshSessions(); openSession(entry.name, name); })],
    ["Delete…", () => deleteForm("run", run.name, path, async () => { if (get("run") === run.name) set({ run: null, summary: null, detail: null, frame: null }); await refreshSessions(); })],
  ]);
}

function runRow(entry, run) {
  const row = element("div", "run");
  row.setAttribute("role", "treeitem");
  row.setAttribute("aria-selected", String(entry.name === get("session") && run.name === get("run")));
  row.tabIndex = 0;
  const words = element("div", "");
  words.append(element("div", "name", run.name), element("div", "facts", run.describe ?? run.tracker));
  const value = element("div", "figure");
  if (run.mean_mm != null) { value.append(figure(run.mean_mm), " "); value.append(Object.assign(element("small", ""), { textContent: "mm" })); }
  else value.append(element("small", "", `${run.done}/${run.last - run.first}`));
  const more = element("button", "more", "⋯");
  more.setAttribute("aria-label", `More for ${run.name}`);
  more.onclick = (event) => { event.stopPropagation(); runMenu(more, entry, run); };
  row.append(words, value, more);
  row.onclick = () => openSession(entry.name, run.name);
  row.onkeydown = (event) => { if (event.key === "Enter") row.onclick(); };
  return row;
}

function sessionBlock(entry) {
  const block = element("div", entry.name === get("session") ? "session open" : "session");
  const head = element("div", "head");
  head.tabIndex = 0;
  head.setAttribute("role", "treeitem");
  head.setAttribute("aria-expanded", String(entry.name === get("session")));
  const picture = Object.assign(document.createElement("img"), { src: `${sessionPath(entry.name)}/thumbnail.jpg`, alt: "", loading: "lazy" });
  picture.onerror = () => picture.replaceWith(element("span", "no-picture"));
  const words = element("div", "");
  words.append(element("div", "name", entry.name), element("div", "facts", `${entry.cameras} ${entry.cameras === 1 ? "camera" : "cameras"} · ${entry.frame_count} frames · ${figure(entry.fps)} fps`));
  const more = element("button", "more", "⋯");
  more.setAttribute("aria-label", `More for ${entry.name}`);
  more.onclick = (event) => { event.stopPropagation(); sessionMenu(more, entry); };
  head.append(picture, words, more);
  head.onclick = () => openSession(entry.name);
  head.onkeydown = (event) => { if (event.key === "Enter") head.onclick(); };
  const runs = element("div", "runs");
  runs.setAttribute("role", "group");
  const fresh = element("button", "new-run quiet small", "+ New run");
  fresh.onclick = () => newRunForm(entry);
  runs.append(...entry.runs.map((run) => runRow(entry, run)), fresh);
  if (entry.warnings?.length) head.title = entry.warnings.join("\n");
  block.append(head, runs);
  return block;
}

function draw() {
  const sessions = get("sessions");
  if (sessions === null) { list.replaceChildren(element("p", "empty", "Loading…")); return; }
  if (!sessions.length) { list.replaceChildren(element("p", "empty", "No sessions yet.")); return; }
  const at = list.scrollTop;
  list.replaceChildren(...sessions.map(sessionBlock));
  list.scrollTop = at;
}

async function drawTrash() {
  const line = document.getElementById("trash-line");
  const told = await fetchJson("/api/trash").catch(() => ({ entries: [] }));
  line.hidden = !told.entries.length;
  line.replaceChildren(`${told.entries.length} in the trash`);
  const button = element("button", "quiet small", "Restore…");
  button.onclick = () => openMenu(button, told.entries.slice(0, 12).map((entry) => [entry.name, async () => {
    try { await post("/api/trash/restore", { entry: entry.id }); await refreshSessions(); } catch (error) { complain(error); }
  }]));
  line.append(button);
}

/** Wire the rail. */
export function startRail() {
  document.getElementById("import-open").onclick = importForm;
  watch(["sessions", "session", "run"], draw);
  watch(["sessions"], drawTrash);
}
