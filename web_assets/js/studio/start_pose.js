// Finding a start pose in a frame: progress while it is looked for, what was found and how sure it
// is.

import { post, remove, sessionPath } from "../api.js";
import { percent } from "../elements.js";
import { jobDone, standing } from "../jobs.js";
import { say } from "../messages.js";
import { openSession, refreshSessions } from "../sessions.js";
import { openForm, whileOpen } from "./dialogs.js";

/**
 * Look for the pose in a frame; resolves with what was found, throws what went wrong.
 * @param {string} session
 * @param {any} request frame, body, behaviour, replace
 * @param {(words: string) => void} report
 */
export async function findStartPose(session, request, report) {
  const { identifier } = await post(`${sessionPath(session)}/initialise`, request);
  /** @type {`/api/initialisations/${string}`} */
  const job = `/api/initialisations/${identifier}`;
  const stop = () => remove(job).catch(() => {});
  return whileOpen(stop, () =>
    jobDone(job, (state) => report(standing(state, "Finding the pose…"))),
  );
}

/**
 * How sure a pose is, and how much of the masks it covers: two numbers that say different things.
 */
export function foundWords({ confidence, overlap }) {
  const sure = `confidence ${percent(confidence)} that it is right`;
  return overlap == null ? sure : `${sure}, it agrees with ${percent(overlap)} of the masks`;
}

/** Say what was found, as a warning where it may be wrong. */
export function sayFound(found) {
  const doubt = "Check it in the scene before you track: it may face the other way.";
  say(`Start pose found in frame ${found.frame}: ${foundWords(found)}; kept in ${found.file}.`, {
    kind: found.unsure ? "warning" : "info",
    remedy: [found.unsure && doubt, found.note].filter(Boolean).join(" "),
  });
}

/** Open the form for a session. */
export function startPoseForm(entry) {
  openForm({
    heading: `Start pose of ${entry.name}`,
    action: "Find it",
    intro:
      "The pose in a frame is found from the masks and pictures alone; " +
      "it is shown in the scene when it is there.",
    rows: [
      [
        {
          name: "frame",
          label: "In frame",
          kind: "number",
          min: 0,
          max: entry.frame_count - 1,
          value: 0,
        },
      ],
      [
        {
          name: "replace",
          kind: "check",
          label: "make it the session's start pose (the present one stays beside it)",
        },
      ],
    ],
    send: async (values, report) => {
      const request = { frame: Number(values.frame), replace: values.replace };
      const found = await findStartPose(entry.name, request, report);
      await refreshSessions();
      // A run's frames would be shown over it.
      openSession(entry.name, null);
      sayFound(found);
    },
  });
}
