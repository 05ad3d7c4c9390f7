// The form of a new comparison: trackers, evaluations, frames.

import { fault, post } from "./api.js";
import {
  button,
  card,
  element,
  field,
  fill,
  nothing,
  number,
  optional,
  pageHead,
  select,
  sends,
  spring,
} from "./elements.js";
import { sessionWords } from "./sessions.js";
import { seriesColour } from "./theme.js";

const MOST_ROWS = 8;
const USUAL = ["annealed", "swarm", "condensation"];

/** "a=1, b=two" as an object. Throws words that can be shown. */
function readKnobs(text) {
  const knobs = {};
  for (const part of text
    .split(/[,\n]/)
    .map((one) => one.trim())
    .filter(Boolean)) {
    const [name, ...rest] = part.split("=");
    if (!name.trim() || !rest.join("=").trim())
      throw fault(
        `“${part}” is not a knob with a value.`,
        "Write knob=value, separate several with commas.",
      );
    knobs[name.trim()] = rest.join("=").trim();
  }
  return knobs;
}

const writeKnobs = (settings) =>
  Object.entries(settings)
    .map(([name, value]) => `${name}=${value}`)
    .join(", ");

/**
 * The rows of trackers: `box` and `lineUp` are put on the page, `fill(trackers)` and `read()` as
 * the API has them.
 */
function candidates({ candidates: offered, weightings, lineups }, changed) {
  let rows = [];
  const list = element("div", { className: "candidates" });
  const more = button(
    "+ Tracker",
    () =>
      add({
        name:
          offered.find((one) => !rows.some((row) => row.who.value === one.name))?.name ??
          offered[0].name,
      }),
    "quiet small",
  );
  const helpOf = (name) =>
    name.includes(":") ? (offered.find((one) => one.name === name)?.help ?? "") : "";

  function add({ name, settings = {}, weighting = "" }) {
    const known =
      offered.find((one) => one.name === name) ??
      offered.find((one) => one.name === name.split(":")[0]);
    const help = element("p", { className: "candidate-help" }, helpOf(known.name));
    const who = select(
      offered.map((one) => one.name),
      known.name,
      {
        ariaLabel: "Tracker",
        onchange: () => {
          help.textContent = helpOf(who.value);
          draw();
        },
      },
    );
    const label = element("input", {
      placeholder: "own label",
      ariaLabel: "Label",
      pattern: "[A-Za-z0-9_\\-]{1,40}",
      title: "Letters, digits, - and _",
      value: known.name === name ? "" : (name.split(":")[1] ?? ""),
    });
    const likelihood = select([["", "likelihood of all"], ...weightings], weighting ?? "", {
      ariaLabel: "Likelihood",
    });
    const knobs = element("input", {
      placeholder: "knobs: survival=0.5, crossover=0",
      ariaLabel: "Knobs",
      value: writeKnobs(settings),
    });
    const remover = button(
      "×",
      () => {
        rows = rows.filter((one) => one !== row);
        draw();
      },
      "icon quiet",
      { ariaLabel: "Leave this one out" },
    );
    const swatch = element("i", { className: "swatch" });
    const read = () => {
      const choice = offered.find((one) => one.name === who.value);
      const own = readKnobs(knobs.value);
      const named = label.value.trim();
      return {
        name: named ? `${choice.tracker}:${named}` : choice.name,
        settings: named ? { ...choice.changes, ...own } : own,
        weighting: likelihood.value || null,
      };
    };
    const row = {
      who,
      swatch,
      remover,
      read,
      line: element(
        "div",
        { className: "candidate" },
        swatch,
        who,
        label,
        likelihood,
        knobs,
        remover,
        help,
      ),
    };
    rows.push(row);
    draw();
  }

  function draw() {
    fill(
      list,
      rows.map((row) => row.line),
    );
    for (const [at, row] of rows.entries()) {
      row.swatch.style.background = seriesColour(at);
      row.remover.disabled = rows.length < 2;
    }
    more.disabled = rows.length >= MOST_ROWS;
    changed();
  }

  const replace = (wanted) => {
    rows = [];
    for (const each of wanted) add(each);
  };
  const lineUp = select(
    [
      ["", "Line-up…"],
      ...lineups.map(
        (one) =>
          /** @type {[string, string]} */ ([one.name, `${one.name}: ${one.trackers.join(", ")}`]),
      ),
    ],
    "",
    { ariaLabel: "Line-up" },
  );
  lineUp.onchange = () => {
    replace(
      lineups.find((one) => one.name === lineUp.value)?.trackers.map((name) => ({ name })) ?? [],
    );
    lineUp.value = "";
  };
  return {
    list,
    more,
    lineUp,
    fill: replace,
    count: () => rows.length,
    read: () => rows.map((row) => row.read()),
  };
}

/**
 * Show the form in `content`. initial: what it is filled with, as the API takes it. started: called
 * with the line of what was begun. instead: what leads to the other form.
 */
export function showForm(content, { sessions, choices, bodies, initial, started, instead }) {
  const able = sessions.filter((one) => one.has_truth && !one.problem);
  if (!able.length) {
    return fill(
      content,
      nothing(
        "No session with a truth",
        element(
          "p",
          {},
          "Trackers are compared by their distance from true markers. Import a session with truth/*.trc, open the bundled walk in the studio, or render footage:",
        ),
        element("code", {}, "studio synthesize walk"),
        instead,
      ),
    );
  }
  const chosen = able.find((one) => one.name === initial.session) ?? able[0];
  const sum = element("span", { className: "hint" });
  const wrong = optional();
  const rows = candidates(choices, () => count());
  const whole = (name, value, more = {}) =>
    number(value, { name, step: 1, required: true, ...more });
  const session = select(
    able.map((one) => [one.name, sessionWords(one)]),
    chosen.name,
    { name: "session", onchange: takeSession },
  );
  const likelihood = element("span", {});
  const body = element("span", {});
  const first = whole("first", initial.first ?? 0);
  const last = whole("last", 0);
  const submit = element("button", { className: "primary" }, "Compare");
  const form = element(
    "form",
    { className: "compare-form" },
    card(
      "",
      element(
        "div",
        { className: "fields" },
        field("Session", session),
        field(
          "Evaluations a frame, each",
          whole("evaluations", initial.evaluations ?? 1000, { min: 1 }),
        ),
        field("Seeds", whole("seeds", initial.seeds ?? 5, { min: 1, max: 1000 })),
        field("Likelihood of all", likelihood),
        field(
          "Frames",
          element("span", { className: "two" }, first, element("span", {}, "to"), last),
        ),
        field(
          "Layers, where they can be chosen",
          whole("layers", initial.layers ?? 10, { min: 1, max: 60 }),
        ),
        field(
          "Frames that tell whose fault errors are",
          whole("split_frames", initial.split_frames ?? 0, { min: 0, max: 60 }),
        ),
        field("Body", body),
        field(
          "Name",
          element("input", {
            name: "name",
            placeholder: "numbered",
            pattern: "[A-Za-z0-9_\\-]{0,64}",
          }),
        ),
      ),
    ),
    card(
      "",
      element(
        "div",
        { className: "form-foot" },
        element("h2", {}, "Trackers"),
        spring(),
        element("span", { style: "width: 130px" }, rows.lineUp),
      ),
      rows.list,
      element("div", {}, rows.more),
    ),
    wrong,
    element("div", { className: "form-foot" }, submit, sum),
  );
  const value = (name) => /** @type {any} */ (form.elements).namedItem(name)?.value ?? "";

  function takeSession() {
    const entry = able.find((one) => one.name === session.value);
    first.max = last.max = String(entry.frame_count - 1);
    last.value = String(
      Math.min(
        (initial.session === entry.name && initial.last ? initial.last : entry.frame_count) - 1,
        entry.frame_count - 1,
      ),
    );
    fill(
      likelihood,
      select(
        [["", `the session's (${entry.weighting})`], ...choices.weightings],
        initial.weighting ?? "",
        { name: "weighting" },
      ),
    );
    fill(
      body,
      select(
        [["", `the session's (${entry.body})`], ...bodies.map((one) => one.name)],
        initial.body ?? "",
        { name: "body" },
      ),
    );
    count();
  }

  /** How much work it is. */
  function count() {
    const frames = value("last") - value("first") + 1;
    const trials = rows.count() * value("seeds");
    const poses = trials * frames * value("evaluations");
    sum.textContent =
      poses > 0
        ? `${trials} trials of ${frames} frames: ${poses >= 1e6 ? `${(poses / 1e6).toPrecision(3)} million` : poses.toLocaleString("en")} poses to evaluate, in the background.`
        : "";
  }

  form.oninput = count;
  sends(form, submit, wrong, async () =>
    started(
      await post("/api/comparisons", {
        session: value("session"),
        name: value("name") || null,
        trackers: rows.read(),
        evaluations: Number(value("evaluations")),
        seeds: Number(value("seeds")),
        weighting: value("weighting") || null,
        body: value("body") || null,
        first: Number(value("first")),
        last: Number(value("last")) + 1,
        layers: Number(value("layers")),
        split_frames: Number(value("split_frames")),
      }),
    ),
  );
  const known = new Set(choices.candidates.map((one) => one.name));
  rows.fill(initial.trackers ?? USUAL.filter((name) => known.has(name)).map((name) => ({ name })));
  takeSession();
  fill(
    content,
    element(
      "div",
      { className: "column" },
      pageHead(
        "Compare trackers",
        "Same evidence, likelihood, start and seeds, and as many poses evaluated in every frame: only the search differs. Errors are measured against the session's truth.",
        instead,
      ),
      form,
    ),
  );
}
