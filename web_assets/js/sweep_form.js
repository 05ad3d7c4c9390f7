// The form of a new sweep: knobs with their values, seeds, frames; how many runs that is and how
// long they take.

import { fetchJson, post, sessionPath } from "./api.js";
import {
  button,
  card,
  check,
  dotted,
  duration,
  element,
  failure,
  field,
  fill,
  nothing,
  number,
  optional,
  pageHead,
  select,
  sends,
  text,
} from "./elements.js";
import { paced } from "./pacing.js";
import { sessionWords } from "./sessions.js";

/** @import { Schemas } from "./api_types" */

const USUAL = ["survival", "particles"];
const MOST_KNOBS = 6;
const ASK_MILLISECONDS = 350;

/** "a, b" as the words between the commas. */
const words = (line) =>
  line
    .split(",")
    .map((one) => one.trim())
    .filter(Boolean);

/**
 * Three values to begin with: about the default, within the knob's range; all choices of a word.
 */
function proposed(knob) {
  if (knob.kind === "bool") return "true, false";
  if (knob.choices.length) return knob.choices.join(", ");
  if (typeof knob.default !== "number") return "";
  const within = (value) =>
    Math.min(
      knob.high ?? value,
      Math.max(
        knob.low ?? value,
        knob.kind === "int" ? Math.round(value) : Number(value.toPrecision(2)),
      ),
    );
  return [...new Set([0.5, 1, 1.5].map((factor) => within(knob.default * factor)))].join(", ");
}

const allowed = (knob) =>
  knob.choices.length
    ? knob.choices.join(", ")
    : knob.kind === "bool"
      ? "true or false"
      : knob.low === null
        ? ""
        : `${knob.low} to ${knob.high}${knob.unit ? ` ${knob.unit}` : ""}`;

/** The rows of knobs that are varied. changed: called whenever something of it changes. */
function variedKnobs(changed) {
  let known = [];
  let rows = [];
  const list = element("div", { className: "varied" });
  const more = button(
    "+ Knob",
    () => add(known.find((knob) => !rows.some((row) => row.which.value === knob.name))?.name),
    "quiet small",
  );
  const knobOf = (name) => known.find((knob) => knob.name === name);

  function add(name, given = null) {
    if (!knobOf(name)) return;
    const about = element("p", { className: "hint" });
    const values = text({
      ariaLabel: "Values",
      placeholder: "values, separated by commas",
      value: given ?? proposed(knobOf(name)),
      required: true,
    });
    const describe = () => {
      const knob = knobOf(which.value);
      about.textContent = dotted(
        knob.help,
        `default ${knob.default}`,
        allowed(knob) && `allowed: ${allowed(knob)}`,
      );
    };
    const which = select(
      known.map(
        (knob) =>
          /** @type {[string, string]} */ ([
            knob.name,
            knob.label === knob.name ? knob.name : `${knob.label} (${knob.name})`,
          ]),
      ),
      name,
      {
        ariaLabel: "Knob",
        onchange: () => {
          values.value = proposed(knobOf(which.value));
          describe();
          changed();
        },
      },
    );
    const row = {
      which,
      values,
      line: element(
        "div",
        { className: "varied-knob" },
        which,
        values,
        button(
          "×",
          () => {
            rows = rows.filter((one) => one !== row);
            draw();
          },
          "icon quiet",
          { ariaLabel: "Leave this knob out" },
        ),
        about,
      ),
    };
    describe();
    rows.push(row);
    draw();
  }

  function draw() {
    fill(
      list,
      rows.map((row) => row.line),
    );
    more.disabled = rows.length >= MOST_KNOBS || rows.length >= known.length;
    changed();
  }

  return {
    list,
    more,
    /** Offer the knobs of a tracker and likelihood; those that it does not have fall away. */
    offer(knobs, vary) {
      known = knobs;
      const kept =
        vary ?? Object.fromEntries(rows.map((row) => [row.which.value, row.values.value]));
      rows = [];
      for (const [name, given] of Object.entries(kept)) add(name, given);
      if (!rows.length) for (const name of USUAL) add(name);
      if (!rows.length) add(known[0]?.name);
    },
    read: () => Object.fromEntries(rows.map((row) => [row.which.value, words(row.values.value)])),
  };
}

/**
 * Show the form in `content`. initial: what it is filled with. started: called with the line of
 * what was begun. instead: what leads to the other form.
 */
export async function showSweepForm(
  content,
  { sessions, trackers, weightings, initial, started, instead },
) {
  const able = sessions.filter((one) => !one.problem && !one.next_step);
  if (!able.length)
    return fill(
      content,
      nothing(
        "No session to track",
        element("p", {}, "Import one, or open the bundled walk in the studio."),
      ),
    );
  const chosen = able.find((one) => one.name === initial.session) ?? able[0];
  const wait = element("p", { className: "hint", role: "status" });
  const wrong = optional();
  const ask = paced(expect, ASK_MILLISECONDS);
  const rows = variedKnobs(() => ask());
  const whole = (name, value, more = {}) =>
    number(value, { name, step: 1, required: true, ...more });
  const session = select(
    able.map((one) => [one.name, sessionWords(one)]),
    chosen.name,
    { name: "session", onchange: takeSession },
  );
  const tracker = select(
    trackers.map((one) => [one.name, one.label]),
    "",
    { name: "tracker", onchange: () => takeKnobs() },
  );
  const weighting = select(
    weightings.map((one) => [one.name, one.label]),
    "",
    { name: "weighting", onchange: () => takeKnobs() },
  );
  const [first, last] = [whole("first", 0), whole("last", 0)];
  const inconsistent = check("track although the calibration is in doubt", {
    name: "inconsistent",
  });
  const submit = element("button", { className: "primary" }, "Start the sweep");
  const form = element(
    "form",
    { className: "compare-form" },
    card(
      "",
      element(
        "div",
        { className: "fields" },
        field("Session", session),
        field("Tracker", tracker),
        field("Likelihood", weighting),
        field(
          "Seeds of each combination",
          whole("seeds", initial.seeds ?? 3, { min: 1, max: 1000 }),
        ),
        field(
          "Frames",
          element("span", { className: "two" }, first, element("span", {}, "to"), last),
        ),
        field(
          "Knobs of all runs",
          text({
            name: "fixed",
            placeholder: "layers=10, crossover=0",
            value: initial.fixed ?? "",
          }),
        ),
        field(
          "Name",
          text({ name: "name", placeholder: "numbered", pattern: "[A-Za-z0-9_\\-]{0,48}" }),
        ),
        check(
          "fit the body's shape in each run",
          { name: "shape", checked: initial.fit_shape ?? true },
          "Some seconds a run: radii, hands, feet and head that the first frames show.",
        ),
        inconsistent,
      ),
    ),
    card("Knobs and their values", rows.list, element("div", {}, rows.more)),
    wrong,
    element("div", { className: "form-foot" }, submit, wait),
  );
  const own = (name) => /** @type {any} */ (form.elements).namedItem(name);

  function request() {
    const fixed = Object.fromEntries(
      words(own("fixed").value).map((one) => one.split("=").map((part) => part.trim())),
    );
    return {
      session: session.value,
      tracker: tracker.value,
      weighting: weighting.value,
      vary: rows.read(),
      seeds: Number(own("seeds").value),
      first: Number(first.value),
      last: Number(last.value) + 1,
      settings: fixed,
      fit_shape: own("shape").checked,
      allow_inconsistent: !inconsistent.hidden && own("inconsistent").checked,
      ...(session.value === initial.session
        ? { body: initial.body || null, behaviour: initial.behaviour || null }
        : {}),
    };
  }

  /** Say how many runs that is and how long they take, or what is wrong with it. */
  async function expect() {
    if (!form.isConnected) return;
    try {
      const found = await post("/api/comparisons/sweeps/expected", request());
      fill(wrong);
      wait.textContent = dotted(
        `${found.runs} ${found.runs === 1 ? "run" : "runs"} of ${found.frames} frames`,
        `${found.evaluations.toLocaleString("en")} evaluations`,
        found.seconds === null
          ? "how long that takes is known once the first one is done"
          : `about ${duration(found.seconds)} in the background, judged by ${found.judged_by}`,
      );
    } catch (error) {
      wait.textContent = "";
      fill(wrong, failure(error));
    }
  }

  async function takeKnobs(vary) {
    const { knobs } = await fetchJson(
      `/api/knobs?tracker=${encodeURIComponent(tracker.value)}&weighting=${encodeURIComponent(weighting.value)}`,
    );
    rows.offer(knobs, vary);
  }

  async function takeSession() {
    const entry = able.find((one) => one.name === session.value);
    const isSame = initial.session === entry.name;
    const { start_pose_frame, doubts } = await fetchJson(sessionPath(entry.name));
    inconsistent.hidden = !doubts.length;
    first.value = String((isSame ? initial.first : undefined) ?? start_pose_frame);
    first.max = last.max = String(entry.frame_count - 1);
    last.value = String(
      Math.min(
        (isSame && initial.last ? initial.last : entry.frame_count) - 1,
        entry.frame_count - 1,
      ),
    );
    tracker.value = (isSame && initial.tracker) || entry.tracker;
    weighting.value = (isSame && initial.weighting) || entry.weighting;
    await takeKnobs(isSame ? initial.vary : undefined);
  }

  form.oninput = () => ask();
  sends(form, submit, wrong, async () =>
    started(
      await post("/api/comparisons/sweeps", { ...request(), name: own("name").value || null }),
    ),
  );
  fill(
    content,
    element(
      "div",
      { className: "column" },
      pageHead(
        "Sweep knobs",
        "Every combination of the values is tracked with several seeds, in the background. Each is a run of the session that can be opened; errors are measured where there is a truth.",
        instead,
      ),
      form,
    ),
  );
  await takeSession();
}
