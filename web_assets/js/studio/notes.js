// Notes and bookmarks on frames: marks over the timeline, and the note of the shown frame, written
// where the frame is named. They are kept with the run; every window hears of them.

import { fetchJson, put, readOnly, remove, runPath } from "../api.js";
import { onEvent } from "../live.js";
import { complain } from "../messages.js";
import { goTo } from "../selection.js";
import { get, set, watch } from "../state.js";
import { follow, html, mount, useEffect, useRef, useSignal } from "./component.js";

/** @typedef {import("../api_types").Schemas["Note"]} Note */

// As the timeline draws its frames.
const PADDING = 6;
const LONGEST = 2000;

/** What a note says in a line. @param {Note} note */
const noteWords = (note) => note.text || "bookmark";

/** @param {number} frame */
const pathOf = (frame) =>
  /** @type {const} */ (`${runPath(get("session"), get("run"))}/frames/${String(frame)}/note`);

async function load() {
  const [session, run] = [get("session"), get("run")];
  if (!run) return set({ notes: [] });
  try {
    const { notes } = await fetchJson(`${runPath(session, run)}/notes`);
    if (session === get("session") && run === get("run")) set({ notes });
  } catch (error) {
    if (/** @type {any} */ (error).status !== 404) complain(error);
  }
}

/** @param {number} frame @param {string} text */
async function keep(frame, text) {
  try {
    set({ notes: (await put(pathOf(frame), { text })).notes });
    return true;
  } catch (error) {
    complain(error);
    return false;
  }
}

/** @param {number} frame */
async function drop(frame) {
  try {
    set({ notes: (await remove(pathOf(frame))).notes });
  } catch (error) {
    complain(error);
  }
}

/** @param {number | null} frame @returns {Note | undefined} */
const noteOn = (frame) => get("notes").find((/** @type {Note} */ note) => note.frame === frame);

/** Put a bookmark on the shown frame, or take one without words away. */
export function toggleBookmark() {
  const frame = get("frame");
  if (readOnly || !get("run") || frame === null) return;
  const note = noteOn(frame);
  if (!note) keep(frame, "");
  else if (!note.text) drop(frame);
  else openEditor();
}

let openEditor = () => {};

/** The flags over the timeline. */
function Flags() {
  const notes = /** @type {Note[]} */ (follow("notes"));
  const summary = follow("summary");
  if (!summary) return null;
  const span = Math.max(1, summary.last - summary.first - 1);
  return notes.map((note) => {
    const share = (note.frame - summary.first) / span;
    return html`<button
      key=${note.frame}
      type="button"
      class="note-flag"
      tabindex="-1"
      style=${{ left: `calc(${PADDING}px + (100% - ${2 * PADDING}px) * ${share})` }}
      title=${`frame ${note.frame}: ${noteWords(note)}`}
      aria-label=${`Note on frame ${note.frame}: ${noteWords(note)}`}
      onPointerDown=${(/** @type {Event} */ event) => event.stopPropagation()}
      onClick=${() => goTo(note.frame)}
    ></button>`;
  });
}

/** The button beside the frame, and what is written. */
function NoteOfFrame() {
  const run = follow("run");
  const frame = /** @type {number | null} */ (follow("frame"));
  const notes = /** @type {Note[]} */ (follow("notes"));
  const open = useSignal(false);
  const field = useRef(/** @type {HTMLTextAreaElement | null} */ (null));
  openEditor = () => {
    open.value = true;
  };
  const note = notes.find((one) => one.frame === frame);
  useEffect(() => {
    if (open.value) field.current?.focus();
  }, [open.value]);
  useEffect(() => {
    open.value = false;
  }, [run, frame]);
  if (!run || frame === null) return null;
  const save = async () => {
    if (await keep(frame, field.current?.value ?? "")) open.value = false;
  };
  const discard = async () => {
    open.value = false;
    await drop(frame);
  };
  /** @param {KeyboardEvent} event */
  const takeKey = (event) => {
    if (event.key === "Escape") open.value = false;
    else if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) save();
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  const words = note
    ? `Note on frame ${frame}: ${noteWords(note)}`
    : `Note on frame ${frame} (b: a bookmark)`;
  return html`
    <button
      type="button"
      class="icon toggle"
      aria-pressed=${String(Boolean(note))}
      aria-expanded=${String(open.value)}
      aria-label=${note ? "Note on this frame" : "Write a note on this frame"}
      title=${words}
      disabled=${readOnly && !note}
      onClick=${() => {
        open.value = !open.value;
      }}
    >
      <svg viewBox="0 0 16 16"><path d="M4 2h8v12l-4-3.2L4 14z" /></svg>
    </button>
    ${
      open.value &&
      html`<section class="note-card" aria-label=${`Note on frame ${frame}`} onKeyDown=${takeKey}>
        ${
          readOnly
            ? html`<p>${note && noteWords(note)}</p>`
            : html`<textarea
                  ref=${field}
                  rows="3"
                  maxlength=${LONGEST}
                  aria-label="Note"
                  placeholder="What is to be remembered of this frame; nothing is a bookmark"
                  defaultValue=${note?.text ?? ""}
                ></textarea>
                <div class="group">
                  <button type="button" class="primary small" title="Ctrl Enter" onClick=${save}>Keep</button>
                  ${
                    note &&
                    html`<button type="button" class="quiet small" onClick=${discard}>Remove</button>`
                  }
                  ${
                    notes.length > 0 &&
                    html`<a class="small" href=${`${runPath(get("session"), get("run"))}/notes.csv`}>
                      All notes as CSV
                    </a>`
                  }
                </div>`
        }
      </section>`
    }
  `;
}

/** Show the flags over the timeline and the button beside the frame's number. */
export function startNotes() {
  const flags = document.createElement("div");
  flags.className = "note-flags";
  document.getElementById("track")?.append(flags);
  mount(flags, html`<${Flags} />`);
  const place = document.getElementById("note");
  if (place) mount(place, html`<${NoteOfFrame} />`);
  let shown = "";
  watch(["session", "run"], () => {
    const now = `${get("session")}/${get("run")}`;
    if (now === shown) return;
    shown = now;
    load();
  });
  onEvent("notes", (/** @type {any} */ _event, /** @type {boolean} */ here) => {
    if (here) load();
  });
}
