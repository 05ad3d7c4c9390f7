// Finding a start pose in a frame: progress while it is looked for, what was found and how sure it is.

import { post, remove, sessionPath } from "./api.js";
import { openForm } from "./dialogs.js";
import { jobDone, standing } from "./jobs.js";
import { say } from "./messages.js";
import { openSessionAlone, refreshSessions } from "./rail.js";

const UNSURE = 0.75;

/** Look for the pose in a frame; resolves with what was found, throws what went wrong. `wish`: frame, body, behaviour, replace. */
export async function findStartPose(session, wish, report) {
  const { identifier } = await post(`${sessionPath(session)}/initialise`, wish);
  const dialog = document.getElementById("dialog");
  const stop = () => { remove(`/api/initialisations/${identifier}`).catch(() => {}); };
  dialog.addEventListener("close", stop, { once: true });
  try {
    return await jobDone(`/api/initialisations/${identifier}`, (told) => report(standing(told, "Finding the pose…")));
  } finally {
    dialog.removeEventListener("close", stop);
  }
}

/** Say what was found, as a warning where it may be wrong. */
export function tellFound(found) {
  const unsure = found.confidence < UNSURE;
  const sure = `confidence ${Math.round(100 * found.confidence)} %`;
  say(`Start pose found in frame ${found.frame} (${sure}), kept in ${found.file}.`, {
    kind: unsure ? "warning" : "info",
    remedy: [unsure ? "Look at it in the scene before you track: it may face the other way." : "", found.note].filter(Boolean).join(" "),
  });
}

/** Open the form for a session. */
export function startPoseForm(entry) {
  openForm({
    heading: `Start pose of ${entry.name}`, action: "Find it",
    intro: "The pose in a frame is found from the masks and pictures alone; it is shown in the scene when it is there.",
    rows: [
      [{ name: "frame", label: "In frame", kind: "number", min: 0, max: entry.frame_count - 1, value: 0 }],
      [{ name: "replace", kind: "check", label: "make it the session's start pose (the present one stays beside it)" }],
    ],
    send: async (values, report) => {
      const found = await findStartPose(entry.name, { frame: Number(values.frame), replace: values.replace }, report);
      await refreshSessions();
      // A run's frames would be shown over it.
      openSessionAlone(entry.name);
      tellFound(found);
    },
  });
}
