// The address is the state: what is open, shown and chosen stands in it, so that reload, back,
// forward, a copied link and a second window show the same.

import { complain, say } from "./messages.js";
import { openSession } from "./sessions.js";
import { get, set, watch } from "./state.js";
import { playWhenShown } from "./studio/visiting.js";
import { isSearching } from "./work_states.js";

const SETTLE_MILLISECONDS = 200;

const word = { read: (text) => text || null, write: (value) => value };
const count = { read: (text) => (/^\d{1,9}$/.test(text) ? Number(text) : null), write: String };
const place = {
  read: (text) => (/^(-?\d+(\.\d+)?,){5}-?\d+(\.\d+)?$/.test(text) ? text : null),
  write: (value) => value,
};

/** A run by its name; "" says that none is open, nothing that the newest is meant. */
const run = { read: (text) => text || null, write: (value) => value ?? "" };

// Every entry of the state that the address holds. `usual`: what is meant where it is left out.
// `step`: whether "back" takes a change of it back.
const HELD = [
  { name: "session", kind: word, step: true },
  { name: "run", kind: run, usual: undefined, step: true },
  { name: "track", kind: word, usual: "raw", step: true },
  { name: "frame", kind: count },
  { name: "layer", kind: count },
  { name: "plays", kind: word },
  { name: "limb", kind: word },
  { name: "parameter", kind: word },
  { name: "particle", kind: count },
  { name: "camera", kind: word },
  { name: "through", kind: word, step: true },
  { name: "eye", kind: place },
  { name: "panel", kind: word, step: true },
  { name: "view", kind: word, step: true },
  { name: "over", kind: word, step: true },
  { name: "second", kind: word },
  { name: "towards", kind: word },
  { name: "compared", kind: word, step: true },
  { name: "trial", kind: word },
  { name: "against", kind: word },
  { name: "step", kind: count },
];

/** @param {{ usual?: string }} entry */
const usualOf = (entry) => ("usual" in entry ? entry.usual : null);

/** The state that an address holds. @param {string} [query] */
export function held(query = location.search) {
  const given = new URLSearchParams(query);
  return Object.fromEntries(
    HELD.map((one) => [
      one.name,
      given.has(one.name) ? one.kind.read(given.get(one.name)) : usualOf(one),
    ]),
  );
}

/**
 * The address of the state as it is, with some entries changed: a link to it.
 * @param {Record<string, any>} [changes]
 */
export function addressOf(changes = {}) {
  const query = new URLSearchParams();
  // A frame that is followed while it is searched is not a place to come back to.
  const searched = get("follow") && isSearching(get("work"));
  for (const one of HELD) {
    const { name } = one;
    // Layers that play are no layer to come back to.
    const moves =
      (name === "frame" && searched) || (name === "layer" && get("plays") && !("layer" in changes));
    const value = name in changes ? changes[name] : moves ? null : get(name);
    if (value !== usualOf(one)) query.set(name, one.kind.write(value));
  }
  return `/?${query}`;
}

let isDue = false;
let timer = 0;
let restoring = true; // whether what changes now follows from an address that was opened

/**
 * Write the state into the address: as a step of its own where one of its steps changed, else over
 * the last one.
 */
function write() {
  isDue = false;
  const wanted = addressOf();
  // What is not here stays in the address: it may come back, and the link can be looked at.
  if (!get("session") || get("missing") || wanted === location.pathname + location.search) {
    restoring = false;
    return;
  }
  const before = held();
  if (!restoring && HELD.some(({ name, step }) => step && get(name) !== before[name]))
    history.pushState(null, "", wanted);
  else history.replaceState(null, "", wanted);
  restoring = false;
}

/** Write once what changes now has changed; @param {number} milliseconds until then. */
function writeIn(milliseconds) {
  clearTimeout(timer);
  timer = window.setTimeout(write, milliseconds);
}

/**
 * Steps are written at once, so that "back" finds them; what moves with every frame is written when
 * it rests.
 */
const writeSoon = () => {
  if (!isDue) writeIn(SETTLE_MILLISECONDS);
  isDue = true;
};
const writeNow = () => {
  isDue = true;
  writeIn(0);
};

/**
 * Show what the address says: the newest run of a session where it names none, the first session
 * where it names none. A session or run that is not here is said, and no other one opened.
 */
function read() {
  restoring = true;
  const sessions = get("sessions") ?? [];
  const { session, run: named, plays, ...shown } = held();
  if (!sessions.length) return;
  const first =
    session === null
      ? (sessions.find((one) => one.runs.length) ?? sessions[0])
      : sessions.find((one) => one.name === session);
  const isThere = first && (!named || first.runs.some((one) => one.name === named));
  if (!isThere) {
    openSession(first?.name ?? null, null);
    set({ missing: { session, run: first ? named : null } });
    return;
  }
  set({ missing: null });
  const chosen = session === null ? undefined : named;
  const more = session === null ? {} : frameOfFootage(first, chosen, shown);
  if (first.name === get("session") && chosen === get("run")) {
    const { frame, ...rest } = more;
    set({ ...rest, ...(frame === null || frame === undefined ? {} : { frame, follow: false }) });
  } else openSession(first.name, chosen, more);
  if (plays === "layers") playWhenShown().catch(complain);
  writeNow();
}

/**
 * What an address shows of a session without a run, where it names a frame that its footage does
 * not have.
 */
function frameOfFootage(entry, chosen, shown) {
  const hasRun = chosen === undefined ? entry.runs.length > 0 : chosen !== null;
  if (hasRun || shown.frame === null || shown.frame < entry.frame_count) return shown;
  say(`There is no frame ${shown.frame}: ${entry.name} has ${entry.frame_count} frames.`, {
    kind: "warning",
  });
  return { ...shown, frame: null };
}

/**
 * Open what the address says, and keep it true from then on; called once the sessions are known.
 */
export function startAddress() {
  read();
  addEventListener("popstate", read);
  watch([...HELD.filter((one) => !one.step).map((one) => one.name), "follow", "work"], writeSoon);
  watch(
    HELD.filter((one) => one.step).map((one) => one.name),
    writeNow,
  );
}
