// What the state is filled from: the stored run over the API, the search as it happens over the
// events.

import { fetchJson, post, runPath } from "./api.js";
import { onEvent } from "./live.js";
import { complain, say } from "./messages.js";
import { paced } from "./pacing.js";
import { dressScene } from "./scene_window.js";
import { isWatched } from "./studio/tracking.js";
import { refreshSessions } from "./sessions.js";
import { goTo } from "./selection.js";
import { get, set, watch } from "./state.js";
import { isSearching } from "./work_states.js";

const SUMMARY_MILLISECONDS = 1500;
const DETAIL_MILLISECONDS = 80;
const SCENE_MILLISECONDS = 33;
const SESSIONS_MILLISECONDS = 800;
const MOVED_MILLISECONDS = 250;
// A frame that takes longer than this is shown layer by layer while it is searched, quicker ones
// when they are done; a search that is slowed to be watched is shown layer by layer always.
const PATIENCE_MILLISECONDS = 700;
// A frame that is annealed again is shown when it is whole; one that takes longer than this, with
// the layers so far.
const AGAIN_MILLISECONDS = 250;

const searching = () => isSearching(get("work"));
const isShown = (session, run) => session === get("session") && run === get("run");

let arrived = []; // lines of frames that finished since the summary was last loaded
let layers = []; // of the frame that is being searched
let drawnAt = 0; // when live layers were last shown
let scene = {}; // what the scene last showed
let moves = 0; // of the page, which the scene is asked to follow
let requested = 0; // the last move that it was asked to follow
let again = []; // layers of the frame that is annealed again
let showsAgain = 0; // timer that shows them
let asking = ""; // the frame whose layers are on their way
let isOpening = false; // whether the run's frames are on their way: the scene is built after that
let plays = false; // whether the scene plays layers: it goes on with them unless one is chosen here
let isHeld = false; // whether a layer was chosen by hand since the scene was last asked: what plays stops at it
let isAnew = true; // whether the page was loaded since: a frame that was annealed again before is not shown on it

const sceneLater = paced(() => showInScene(), SCENE_MILLISECONDS);

/**
 * The run's frames: shown at once, with the chosen one, before anything of `next`; and again when
 * the server has read all that is stored of them and knows what is damaged.
 */
async function loadSummary(next = () => {}) {
  const isAll = await loadFrames(get("summary") !== null);
  isOpening = false;
  sceneLater();
  await loadDetail();
  next();
  if (!isAll) await loadFrames(true);
}

/**
 * Load the run's frames; those that finish while the answer is on its way are kept. Whether no
 * other answer is to be requested.
 */
async function loadFrames(check) {
  const [session, run] = [get("session"), get("run")];
  if (!run) return true;
  arrived = [];
  try {
    const track = get("track");
    const summary = await fetchJson(
      `${runPath(session, run)}/frames?${new URLSearchParams({ track, check: String(check) })}`,
    );
    if (!isShown(session, run) || track !== get("track")) return true;
    const last = summary.frames.at(-1)?.frame ?? -1;
    summary.frames.push(...arrived.filter((line) => line.frame > last));
    // A search that was paused inside a run's first frame has layers to be looked at already.
    const newest = summary.frames.at(-1)?.frame ?? summary.partial ?? null;
    set({
      summary,
      frame: get("frame") === null || (get("follow") && searching()) ? newest : get("frame"),
    });
    // An address may name a frame that is not tracked; the one in which the search stands has
    // layers.
    const known =
      summary.frames.some((line) => line.frame === get("frame")) ||
      [summary.partial, get("detail")?.frame].includes(get("frame"));
    if (get("frame") !== null && !known && !searching()) {
      const asked = get("frame");
      if (summary.frames.length) goTo(asked);
      else set({ frame: null });
      if (isOpening) sayMissingFrame(asked, summary, run, get("frame"));
    }
    return summary.checked;
  } catch (error) {
    complain(error);
  }
  return true;
}

/** Say which frame an address names that is not there, and what is shown instead. */
function sayMissingFrame(asked, { first, last, frames }, run, shown) {
  const isOutside = asked < first || asked >= last;
  const cause = isOutside
    ? `There is no frame ${asked}: ${run} goes from frame ${first} to ${last - 1}.`
    : `Frame ${asked} of ${run} is not tracked.`;
  say(
    frames.length
      ? `${cause} Frame ${shown} is shown.`
      : isOutside
        ? cause
        : `${run} has no frames yet, so none is shown.`,
    { kind: "warning" },
  );
}

/** The run: its parameters and its layers. */
async function loadRun() {
  const [session, run] = [get("session"), get("run")];
  if (!run) return;
  try {
    const { parameters, settings } = await fetchJson(`${runPath(session, run)}?check=false`);
    if (isShown(session, run))
      set({ parameters, layerCount: get("layerCount") ?? layersOf(settings) });
  } catch (error) {
    complain(error);
  }
}

/** The knobs that were moved in this run, wherever that was, and that no stored frame uses. */
async function loadMoved() {
  const [session, run] = [get("session"), get("run")];
  if (!run) return set({ moved: null });
  try {
    const { moved, values, knobs } = await fetchJson(`${runPath(session, run)}/settings`);
    if (!isShown(session, run)) return;
    const named = knobs.filter((knob) => knob.name in moved);
    set({
      moved: named.map(({ name, label, unit }) => ({
        label: unit ? `${label} (${unit})` : label,
        before: values[name],
        after: moved[name],
      })),
    });
  } catch (error) {
    complain(error);
  }
}

/** The shown frame's layers, unless they came with the events. */
async function loadDetail() {
  const [session, run, frame] = [get("session"), get("run"), get("frame")];
  if (!run || frame === null) return set({ detail: null });
  const key = `${runPath(session, run)}/frames/${frame}`;
  if (get("detail")?.frame === frame || key === asking) return;
  asking = key;
  try {
    const detail = await fetchJson(key);
    if (isShown(session, run) && frame === get("frame")) set({ detail });
  } catch (error) {
    if (error.status !== 404) complain(error);
  } finally {
    if (asking === key) asking = "";
  }
}

/** What the page shows, as the scene takes it. */
const shownNow = (frame) => ({
  session: get("session"),
  run: get("run"),
  frame,
  layer: get("layer"),
  follow: get("follow"),
  limb: get("limb"),
  parameter: get("parameter"),
  particle: get("particle"),
  camera: get("camera"),
  look_through: get("through"),
  eye: get("eye"),
});

/** The six numbers of a place in the scene, from the text that the address holds. */
const eyeOf = (text) => text?.split(",").map(Number) ?? null;

/** What the scene should show. While a search is followed the scene follows it by itself. */
const wantedNow = () => shownNow(get("follow") && searching() ? null : get("frame"));
const isElsewhere = (shown) => Object.keys(shown).some((name) => shown[name] !== scene[name]);

/**
 * Hold the scene at the layer that the page shows, also where it said that one last and has gone on
 * since.
 */
export function holdLayer() {
  isHeld = true;
  moves += 1;
  sceneLater();
}

/** Move the scene to what the page shows. */
async function showInScene() {
  if (!get("session") || isOpening) return;
  const shown = wantedNow();
  if (!isElsewhere(shown) && requested === moves) return;
  const { layer, ...others } = shown;
  const request = plays && !isHeld && layer === scene.layer ? others : shown;
  isHeld = false;
  scene = shown;
  requested = moves;
  // A page that is loaded again begins with one scene, and without what was annealed before.
  const anew = isAnew ? { discard: !get("trial"), twin: false } : {};
  isAnew = false;
  const moved = { ...request, eye: eyeOf(shown.eye), request_number: requested, ...anew };
  await post("/api/scene/show", moved).catch(complain);
}

/**
 * The scene's own controls moved, or it plays: follow them, without sending the change back. What
 * it said before it knew of the page's own last move is old.
 */
function takeScene(event) {
  if (!isShown(event.session, event.run) || event.request_number !== moves) return;
  const chosen = {
    limb: event.limb,
    parameter: event.parameter,
    camera: event.camera,
    through: event.look_through,
    eye: event.eye?.join(",") ?? null,
  };
  Object.assign(scene, chosen, { look_through: event.look_through });
  if (event.follow && get("follow") && searching()) return set(chosen);
  const stored = get("summary")?.frames.some((line) => line.frame === event.frame);
  /** @type {Record<string, any>} */
  const changes = {
    ...chosen,
    layer: event.layer,
    particle: event.particle,
    follow: event.follow,
    ...(stored ? { frame: event.frame } : {}),
  };
  if (stored && event.frame !== get("frame") && get("whatIf")) changes.whatIf = null;
  scene = {
    ...scene,
    session: event.session,
    run: event.run,
    layer: event.layer,
    particle: event.particle,
    frame: stored ? event.frame : scene.frame,
    follow: event.follow,
  };
  set(changes);
}

/**
 * A layer: those of a what-if stand beside the stored answer; those of a frame in progress are
 * shown when it is slow.
 */
function takeLayer(event) {
  if (event.reannealed) {
    // What another window anneals again, or this one did before it moved on, changes nothing here.
    if (event.frame !== get("frame")) return;
    const goesOn = event.layer > 0 && again[0]?.frame === event.frame;
    again = [...(goesOn ? again.filter((layer) => layer.layer < event.layer) : []), event];
    showsAgain ||= setTimeout(showAgain, AGAIN_MILLISECONDS);
    return;
  }
  layers = [
    ...layers.filter((layer) => layer.frame === event.frame && layer.layer < event.layer),
    event,
  ];
  if (!get("follow")) return;
  const slow = performance.now() - drawnAt > PATIENCE_MILLISECONDS;
  if (!searching() || slow || isWatched()) showLive(event.frame, false);
}

/**
 * Show the layers of the frame that is annealed again, all that came together: each would have
 * every chart drawn anew, beside the scene.
 */
function showAgain() {
  clearTimeout(showsAgain);
  showsAgain = 0;
  if (again.length && again[0].frame === get("frame")) set({ whatIf: again });
}

/** Show the layers that came with the events; whether they could be shown. */
function showLive(frame, finished) {
  if (
    !get("parameters") ||
    layers[0]?.layer !== 0 ||
    layers.some((layer, at) => layer.layer !== at)
  )
    return false;
  drawnAt = performance.now();
  const { search_layers, searches } = layers[0];
  set({
    frame,
    whatIf: null,
    detail: { frame, finished, search_layers, searches, parameters: get("parameters"), layers },
  });
  return true;
}

/** A finished frame goes on the timeline at once; its error comes with the next summary. */
function takeFrame(event) {
  const summary = get("summary");
  if (!summary) return;
  const line = {
    frame: event.frame,
    log_weight: event.log_weight,
    milliseconds: event.milliseconds,
    error_mm: null,
    lost: false,
    tracking: event.tracking,
    limbs_off: event.limbs_off,
  };
  arrived.push(line);
  set({
    summary: {
      ...summary,
      frames: [...summary.frames.filter((one) => one.frame < event.frame), line],
    },
  });
  const whole = layers.length === event.layers && layers[0].frame === event.frame;
  if (get("follow") && whole && showLive(event.frame, true)) return;
  const changes = get("follow") ? { frame: event.frame } : {};
  if (get("detail")?.frame === event.frame) {
    // What was tried of the frame before is no longer of this run.
    Object.assign(changes, { detail: null, whatIf: null, trial: null, against: null });
  }
  set(changes);
}

/** The search came to rest: show where it is, and let the rest of the page load again. */
function takeRest(work) {
  const inside = work.state === "paused" && work.layer > 0 && layers.at(-1)?.frame === work.frame;
  if (inside && get("follow") && !get("whatIf")) showLive(work.frame, false);
}

/**
 * How many layers a frame takes with these settings, null where one says so itself
 * (studio/search/trackers/partitions.py).
 */
function layersOf(values) {
  if (values.layers) return values.layers;
  if (!values.stage1_iterations) return null;
  const evaluations =
    values.stage1_particles * values.stage1_iterations +
    values.stage2_particles * values.stage2_iterations;
  if (values.partition === "hard-twelve") return Math.round(evaluations / values.stage1_particles);
  if (values.partition === "global") return Math.round(evaluations / values.stage2_particles);
  return values.stage1_iterations + values.stage2_iterations;
}

/** Wire events and state to the API. */
export function startData() {
  const summaryLater = paced(() => loadSummary(), SUMMARY_MILLISECONDS);
  const detailLater = paced(loadDetail, DETAIL_MILLISECONDS);
  const movedLater = paced(loadMoved, MOVED_MILLISECONDS);
  const sessionsLater = paced(refreshSessions, SESSIONS_MILLISECONDS);
  watch(["session", "run"], () => {
    layers = [];
    isOpening = Boolean(get("run"));
    loadSummary(() => {
      loadRun();
      movedLater();
    });
  });
  let shownTrack = get("track");
  watch(["track"], () => {
    if (get("track") !== shownTrack) {
      shownTrack = get("track");
      if (get("summary")) loadSummary();
    }
  });
  watch(["session", "run", "frame"], detailLater);
  watch(
    [
      "session",
      "run",
      "frame",
      "layer",
      "follow",
      "limb",
      "parameter",
      "particle",
      "camera",
      "through",
      "eye",
    ],
    () => {
      if (isElsewhere(wantedNow())) moves += 1;
      sceneLater();
    },
  );
  onEvent("frame", (event, here) => {
    if (!here) return;
    if (event.reannealed) return showAgain();
    // What is kept comes as layers that are annealed again and a frame that is stored.
    again = [];
    takeFrame(event);
    detailLater();
    summaryLater();
  });
  onEvent("layer", (event, here) => {
    if (here) takeLayer(event);
  });
  onEvent("settings", (event, here) => {
    if (here) {
      set({ settings: event, layerCount: layersOf(event.values) });
      movedLater();
    }
  });
  let state = "";
  onEvent("state", (event, here) => {
    // A frame that is annealed again changes nothing that is stored.
    const isTrial =
      event.state === "reannealing" ||
      (state === "reannealing" && ["paused", "finished"].includes(event.state));
    if (here) state = event.state;
    if (here && !searching()) {
      takeRest(event);
      sceneLater();
    }
    if (isTrial) return;
    if (here && !searching()) summaryLater();
    if (event.state !== "tracking") sessionsLater();
  });
  onEvent("sessions", sessionsLater);
  onEvent("scene", (event, here) => {
    if (here) plays = event.layers.playing;
  });
  onEvent("scene", takeScene);
  let before = false;
  watch(["connected"], () => {
    if (get("connected") && before) {
      scene = {};
      dressScene();
      sceneLater();
      sessionsLater();
      summaryLater();
      movedLater();
    }
    before ||= get("connected");
  });
}
