// The sessions of the workspace, and which of them is open with which run.

import { fetchJson } from "./api.js";
import { complain } from "./messages.js";
import { comparedRuns, nothingChosen } from "./selection.js";
import { get, set } from "./state.js";

/** Ask the server for the list again. */
export async function refreshSessions() {
  try {
    const { sessions } = await fetchJson("/api/sessions");
    // An answer that says nothing new leaves the list alone.
    if (JSON.stringify(sessions) !== JSON.stringify(get("sessions"))) set({ sessions });
  } catch (error) {
    complain(error);
  }
}

/**
 * Open a session and one of its runs: the newest unless said, none where `run` is null. `shown`:
 * what of it is shown and chosen, by the state's names.
 * @param {string | null} session @param {string | null} [run] @param {Record<string, any>} [shown]
 */
export function openSession(session, run = undefined, shown = {}) {
  const newest = get("sessions")?.find((one) => one.name === session)?.runs[0]?.name ?? null;
  const chosen = run === undefined ? newest : run;
  if (session === get("session") && chosen === get("run")) return set({ missing: null });
  const frame = shown.frame ?? null;
  const isHere = session === get("session");
  set({
    missing: null,
    session,
    run: chosen,
    track: "raw",
    summary: null,
    detail: null,
    parameters: null,
    layerCount: null,
    settings: null,
    moved: null,
    whatIf: null,
    trial: null,
    against: null,
    trials: null,
    compared: comparedWith(session, chosen),
    through: null,
    eye: null,
    ...nothingChosen(),
    ...shown,
    frame,
    follow: frame === null,
    step: shown.step ?? (isHere ? get("step") : null),
  });
  document.body.classList.remove("rail-open");
}

/**
 * The comparison as it goes on with another of its runs, or of the session's: where that was one of
 * the others, the run that was open is now.
 */
function comparedWith(session, run) {
  const [open, next, others] = [
    `${get("session")}/${get("run")}`,
    `${session}/${run}`,
    comparedRuns(),
  ];
  const goesOn = run && (session === get("session") || others.includes(next));
  return (goesOn && others.map((one) => (one === next ? open : one)).join(",")) || null;
}

/** What a session is called in a list. */
export const sessionWords = ({ name, title }) =>
  title && title !== name ? `${name} · ${title}` : name;
/** The guided set-up of a session, at its next step. */
export const setupPath = (entry) => `/way?session=${encodeURIComponent(entry.name)}`;
/**
 * The studio's own window on a session, or on one of its runs; `more`: what is shown of it, such as
 * {frame: 12}.
 * @param {string} session @param {string} [run] @param {Record<string, string | number>} [more]
 */
export const studioPath = (session, run = "", more = {}) =>
  `/?${new URLSearchParams(Object.entries({ session, ...(run ? { run } : {}), ...more }).map(([name, value]) => [name, String(value)]))}`;
/** The page on other cameras for a run. @param {string} session @param {string} run */
export const rigPath = (session, run) => `/rig?${new URLSearchParams({ session, run })}`;
/** What a session that cannot be tracked yet says of itself. */
export const lacks = (entry) =>
  ({ footage: "no footage yet", calibration: "not calibrated yet" })[entry.next_step] ?? "";
