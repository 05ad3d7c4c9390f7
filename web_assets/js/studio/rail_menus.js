// What can be done to a session, a run and what lies in the trash, from the rail's menus.

import { fault, fetchJson, patch, post, remove, runPath, sessionPath } from "../api.js";
import { openForm } from "./dialogs.js";
import { openMenu } from "./menu.js";
import { NAME } from "../elements.js";
import { complain, say } from "../messages.js";
import { newRunForm } from "./new_run.js";
import { openSession, refreshSessions, setupPath } from "../sessions.js";
import { startPoseForm } from "./start_pose.js";
import { get } from "../state.js";
import { compareForm } from "./comparing.js";
import { signal } from "./component.js";
import { showPanel } from "./panels.js";
import { makeTrackForm } from "./track_work.js";

const MOST_RESTORED = 12;
const MOST_SHARED = 12;

const go = (address) => {
  location.href = address;
};

/**
 * Do something to an open session or run that makes its name void: it is closed meanwhile, and
 * opened again if that fails.
 * @param {boolean} open
 * @param {() => Promise<any>} work
 */
async function whileClosed(open, work) {
  const [session, run] = [get("session"), get("run")];
  if (open) openSession(null);
  try {
    await work();
  } catch (error) {
    if (open) openSession(session, run ?? undefined);
    throw error;
  }
}

/** Rename what is at an API address; `done(name)` follows. */
function renameForm(what, path, name, open, done) {
  openForm({
    heading: `Rename ${what}`,
    action: "Rename",
    rows: [[{ name: "name", label: "Name", value: name, ...NAME }]],
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
    heading: `Delete ${what} ${name}?`,
    intro: "It goes to the trash, from which it can be restored.",
    action: "Delete",
    danger: true,
    rows: [],
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
  } catch (error) {
    complain(error);
  }
}

/** The page of a session's comparisons; the form of a first one where there is none. */
export const comparisonsPath = (entry) =>
  `/comparisons?session=${encodeURIComponent(entry.name)}${entry.comparisons ? "" : "&new"}`;

/** Open the menu of a session. @param {Element} opener */
export function sessionMenu(opener, entry) {
  const path = sessionPath(entry.name);
  const open = get("session") === entry.name;
  const run = get("run") ?? undefined;
  const isReady = !entry.next_step;
  const sweep = `/comparisons?${new URLSearchParams({ new: "sweep", session: entry.name })}`;
  const renamed = (name) => {
    if (open) openSession(name, run);
  };
  const deleted = () => {
    say(`${entry.name} is in the trash.`);
    if (open) openSession(get("sessions")?.[0]?.name ?? null);
  };
  openMenu(opener, [
    ["Guided set-up", () => go(setupPath(entry))],
    ...(isReady
      ? [
          ["New run…", () => newRunForm(entry)],
          ["Find the start pose…", () => startPoseForm(entry)],
        ]
      : []),
    ...(entry.has_truth ? [["Compare trackers…", () => go(comparisonsPath(entry))]] : []),
    ...(isReady ? [["Sweep knobs…", () => go(sweep)]] : []),
    ["Rename…", () => renameForm("session", path, entry.name, open, renamed)],
    ["Duplicate", () => duplicate(entry)],
    ["Delete…", () => deleteForm("session", path, entry.name, open, deleted)],
  ]);
}

/** A run as one page, with the particles of chosen frames. */
function shareForm(path, isOpen) {
  const shown = isOpen && get("frame") !== null ? String(get("frame")) : "";
  const label = "Frames with particles (9, 13, …)";
  openForm({
    heading: "Share as one page",
    intro:
      "One file that opens without the studio: settings, charts, the body moving, and layer by layer " +
      "the particles of the frames that you name.",
    action: "Save the page",
    rows: [[{ name: "frames", label, value: shown, placeholder: "the worst one" }]],
    send: async ({ frames }) => {
      const chosen = String(frames ?? "")
        .split(/[\s,]+/)
        .filter(Boolean);
      if (chosen.some((one) => !/^\d+$/.test(one)) || chosen.length > MOST_SHARED) {
        throw fault(
          `'${frames}' are not up to twelve frames.`,
          "Write their numbers, with commas between.",
        );
      }
      const [first, ...others] = chosen;
      const query = [...(first ? [["frame", first]] : []), ...others.map((one) => ["clouds", one])];
      go(`${path}/shared.html?${new URLSearchParams(query)}`);
    },
  });
}

/** Open the menu of a run. @param {Element} opener */
export function runMenu(opener, entry, run) {
  const path = runPath(entry.name, run.name);
  const open = get("session") === entry.name && get("run") === run.name;
  const exported = () => {
    openSession(entry.name, run.name);
    showPanel("export");
  };
  const renamed = (name) => openSession(entry.name, name);
  const deleted = () => {
    if (open) openSession(entry.name);
  };
  openMenu(opener, [
    ["Refine…", () => makeTrackForm(entry.name, run.name, "refine")],
    ["Smooth…", () => makeTrackForm(entry.name, run.name, "smooth")],
    ["Export…", exported],
    ["Share as one page…", () => shareForm(path, open)],
    ["Poses as CSV", () => go(`${path}/poses.csv`)],
    ["Compare with…", () => compareForm(entry.name, run.name)],
    ["New run like this…", () => newRunForm(entry, run)],
    ["Rename…", () => renameForm("run", path, run.name, open, renamed)],
    ["Delete…", () => deleteForm("run", path, run.name, open, deleted)],
  ]);
}

/** What can be restored from the trash, newest first. */
export const restorable = signal(/** @type {any[]} */ ([]));

/** Ask what lies in the trash. */
export async function loadTrash() {
  const { entries } = await fetchJson("/api/trash").catch(() => ({ entries: [] }));
  restorable.value = entries.filter((entry) => entry.restorable).reverse();
}

/** Open what came back from the trash. */
function openRestored({ name, run = "", model = "", comparison = "" }) {
  if (model) go(`/behaviours?name=${encodeURIComponent(model)}`);
  else if (comparison) {
    go(`/comparisons?${new URLSearchParams({ session: name, name: comparison })}`);
  } else openSession(name, run || undefined);
}

async function restore(entry) {
  try {
    const restored = await post("/api/trash/restore", { entry: entry.id });
    await refreshSessions();
    openRestored(restored);
  } catch (error) {
    complain(error);
  }
}

/** Open the menu of what can be restored. @param {Element} opener */
export const trashMenu = (opener) =>
  openMenu(
    opener,
    restorable.value
      .slice(0, MOST_RESTORED)
      .map((entry) => [`${entry.name} (${entry.kind})`, () => restore(entry)]),
  );
