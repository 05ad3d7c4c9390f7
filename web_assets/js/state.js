// One observable value for the whole page: what is open, which frame and layer are shown, what the
// worker does.

const values = {
  sessions: null, // [{name, title, thumbnail, runs: [...]}], null while unknown
  missing: null, // what the address names that is not here: {session, run}
  session: null, // name of the open session
  run: null, // name of the open run
  track: "raw", // whose poses are shown: as searched, refined, smoothed …
  summary: null, // the run's frames: weights, errors, settings changes
  frame: null, // frame that is shown
  layer: null, // layer that is shown, null = all together
  limb: null, // what else is chosen, by its name, null while it is not; see selection.js
  parameter: null,
  particle: null, // a row of the layer's cloud
  camera: null,
  through: null, // camera that the scene is looked through
  eye: null, // from where the scene is seen: six numbers, metres: place, and what is looked at
  panel: null, // tab under the timeline
  view: null, // which of the views its panel shows
  over: null, // "run": the view shows the whole run, null: the frame
  second: null, // a second parameter of a view
  towards: null, // what a view's line through pose space ends at
  compared: null, // runs of the session that are shown beside this one, their names with commas
  follow: true, // show every new frame as it is finished
  detail: null, // the shown frame's layers
  parameters: null, // of the run's pose vector
  layerCount: null, // how many layers a frame takes with the settings in use
  settings: null, // the settings in use, and since when
  whatIf: null, // layers of a re-annealed frame that is not stored
  moved: null, // knobs that were moved and that no stored frame uses: [{label, before, after}]
  plays: null, // "layers" while the scene plays those of the shown frame
  trial: null, // name of the trial that is shown, null while it has none yet
  against: null, // name of the trial that it is compared with, null: what is stored
  trials: null, // all that was tried of the shown frame, and the numbers of what is stored of it
  notes: [], // notes and bookmarks on the run's frames: [{frame, text, made}]
  step: null, // which of the first steps is shown, counted from 1
  work: null, // the worker's last state
  connected: null, // whether the event socket is open, null before it was
  stranger: false, // whether the studio was started anew and does not know this browser
};

const watchers = new Map();
const followers = new Set();

/** The current value under a name. */
export const get = (name) => values[name];

/** Change values and call whoever watches one of them, once each. */
export function set(changes) {
  const called = new Set();
  const changed = {};
  for (const [name, value] of Object.entries(changes)) {
    if (values[name] === value) continue;
    values[name] = value;
    changed[name] = value;
    for (const watcher of watchers.get(name) ?? []) called.add(watcher);
  }
  for (const follower of followers) follower(changed);
  for (const watcher of called) watcher(values);
}

/** Call `watcher(values)` now and after every change of one of the names. */
export function watch(names, watcher) {
  for (const name of names) {
    if (!watchers.has(name)) watchers.set(name, new Set());
    watchers.get(name).add(watcher);
  }
  watcher(values);
}

/**
 * Call `follower(changed)` with every change of any values, before the watchers; for the signals of
 * components.
 */
export const onChange = (follower) => followers.add(follower);
