// The form of a new comparison: who takes part, with how many evaluations, on which frames.

import { post } from "./api.js";
import { button, element } from "./elements.js";
import { seriesColour } from "./theme.js";

const MOST_ROWS = 8;
const USUAL = ["annealed", "swarm", "condensation"];

const option = (value, label, selected) => new Option(label, value, false, value === selected);
const labelled = (words, input, hint = "") => element("label", {}, words, input, hint && element("span", { className: "hint", textContent: hint }));
const number = (name, value, more = {}) => element("input", { type: "number", name, value, min: 0, required: true, ...more });

/** "a=1, b=two" as an object. Throws words that can be shown. */
export function readKnobs(text) {
  const knobs = {};
  for (const part of text.split(/[,\n]/).map((one) => one.trim()).filter(Boolean)) {
    const [name, ...rest] = part.split("=");
    if (!rest.length || !name.trim() || !rest.join("=").trim()) throw Object.assign(new Error(`“${part}” changes nothing.`), { hint: "Write knob=value, several with commas between." });
    knobs[name.trim()] = rest.join("=").trim();
  }
  return knobs;
}

const writeKnobs = (settings) => Object.entries(settings ?? {}).map(([name, value]) => `${name}=${value}`).join(", ");

/** The rows of trackers. */
class Entrants {
  constructor(choices, changed) {
    this.choices = choices;
    this.changed = changed;
    this.list = element("div", { className: "entrants" });
    this.add = button("+ Tracker", () => this.append({ name: this.unused() }), "quiet small");
  }

  get rows() { return [...this.list.querySelectorAll(".entrant")]; }

  unused() {
    const taken = new Set(this.rows.map((row) => row.chosen()));
    return this.choices.entrants.find((one) => !taken.has(one.name))?.name ?? this.choices.entrants[0].name;
  }

  fill(wishes) {
    this.list.replaceChildren();
    for (const wish of wishes) this.append(wish);
  }

  /** wish: {name, settings, weighting} as the API takes them. */
  append({ name, settings = {}, weighting = null }) {
    const { entrants, weightings } = this.choices;
    const known = entrants.find((one) => one.name === name) ?? entrants.find((one) => one.name === name.split(":")[0]);
    const who = element("select", { ariaLabel: "Tracker" }, ...entrants.map((one) => option(one.name, one.name, known.name)));
    const label = element("input", { placeholder: "own label", ariaLabel: "Label", pattern: "[A-Za-z0-9_\\-]{1,40}", title: "Letters, digits, - and _", value: known.name === name ? "" : name.split(":")[1] ?? "" });
    const weigh = element("select", { ariaLabel: "Weighting" }, option("", "weighting of all", weighting ?? ""), ...weightings.map((one) => option(one, one, weighting)));
    const knobs = element("input", { placeholder: "knobs: survival=0.5, crossover=0", ariaLabel: "Knobs", value: writeKnobs(settings) });
    const remove = button("×", () => { row.remove(); this.redraw(); }, "icon quiet");
    remove.ariaLabel = "Leave this one out";
    const swatch = element("i", { className: "swatch" });
    const help = element("p", { className: "entrant-help" });
    const row = element("div", { className: "entrant" }, swatch, who, label, weigh, knobs, remove, help);
    row.chosen = () => who.value;
    row.read = () => {
      const choice = entrants.find((one) => one.name === who.value);
      const own = readKnobs(knobs.value);
      const named = label.value.trim();
      return { name: named ? `${choice.tracker}:${named}` : choice.name, settings: named ? { ...choice.changes, ...own } : own, weighting: weigh.value || null };
    };
    row.swatch = swatch;
    row.remover = remove;
    who.onchange = () => { help.textContent = helpOf(entrants, who.value); this.redraw(); };
    help.textContent = helpOf(entrants, known.name);
    this.list.append(row);
    this.redraw();
  }

  redraw() {
    this.rows.forEach((row, at) => { row.swatch.style.background = seriesColour(at); row.remover.disabled = this.rows.length < 2; });
    this.add.disabled = this.rows.length >= MOST_ROWS;
    this.changed();
  }

  read() { return this.rows.map((row) => row.read()); }
}

const helpOf = (entrants, name) => (name.includes(":") ? entrants.find((one) => one.name === name)?.help ?? "" : "");

/** The wish of the form as `POST /api/comparisons` takes it. */
function read(form, entrants) {
  const value = (name) => form.elements[name].value;
  return {
    session: value("session"), name: value("name") || null, trackers: entrants.read(), evaluations: Number(value("evaluations")), seeds: Number(value("seeds")),
    weighting: value("weighting") || null, body: value("body") || null, first: Number(value("first")), last: Number(value("last")) + 1, layers: Number(value("layers")),
  };
}

/** Show the form in `content`. wish: what it is filled with, as the API takes it. started: called with the line of what was begun. */
export function showForm(content, { sessions, choices, bodies, wish, started }) {
  const able = sessions.filter((one) => one.has_truth && !one.problem);
  if (!able.length) return content.replaceChildren(nothingToCompare());
  const chosen = able.find((one) => one.name === wish.session) ?? able[0];
  const sum = element("span", { className: "hint" });
  const wrong = element("p", { className: "wrong", hidden: true });
  const remedy = element("p", { className: "hint", hidden: true });
  const entrants = new Entrants(choices, () => tell());
  const session = element("select", { name: "session" }, ...able.map((one) => option(one.name, one.title && one.title !== one.name ? `${one.name} · ${one.title}` : one.name, chosen.name)));
  const weighting = element("select", { name: "weighting" });
  const body = element("select", { name: "body" });
  const first = number("first", wish.first ?? 0);
  const last = number("last", 0);
  const submit = element("button", { className: "primary", textContent: "Compare" });
  const fields = element("div", { className: "fields" },
    labelled("Session", session), labelled("Evaluations a frame, each", number("evaluations", wish.evaluations ?? 1000, { min: 1 })),
    labelled("Seeds", number("seeds", wish.seeds ?? 5, { min: 1, max: 1000 })), labelled("Weighting of all", weighting),
    labelled("Frames", element("span", { className: "two" }, first, element("span", { textContent: "to" }), last)),
    labelled("Layers, where they can be chosen", number("layers", wish.layers ?? 10, { min: 1, max: 60 })),
    labelled("Body", body), labelled("Name", element("input", { name: "name", placeholder: "numbered", pattern: "[A-Za-z0-9_\\-]{0,64}" })));
  const lineup = element("select", { ariaLabel: "Line-up" }, option("", "Line-up…", ""), ...choices.lineups.map((one) => option(one.name, `${one.name}: ${one.trackers.join(", ")}`)));
  lineup.onchange = () => { const found = choices.lineups.find((one) => one.name === lineup.value); if (found) entrants.fill(found.trackers.map((name) => ({ name }))); lineup.value = ""; };
  const form = element("form", { className: "compare-form", noValidate: false },
    element("div", { className: "card-box" }, fields),
    element("div", { className: "card-box" },
      element("div", { className: "form-foot" }, element("h2", { textContent: "Trackers" }), element("span", { className: "spring" }), element("span", { style: "width: 130px" }, lineup)),
      entrants.list, element("div", {}, entrants.add)),
    wrong, remedy, element("div", { className: "form-foot" }, submit, sum));

  const takeSession = () => {
    const entry = able.find((one) => one.name === session.value);
    first.max = last.max = entry.frame_count - 1;
    last.value = Math.min((wish.session === entry.name && wish.last ? wish.last : entry.frame_count) - 1, entry.frame_count - 1);
    weighting.replaceChildren(option("", `the session's (${entry.weighting})`, wish.weighting ?? ""), ...choices.weightings.map((one) => option(one, one, wish.weighting)));
    body.replaceChildren(option("", `the session's (${entry.body})`, wish.body ?? ""), ...bodies.map((one) => option(one.name, one.name, wish.body)));
    tell();
  };
  function tell() {
    const value = (name) => Number(form.elements[name]?.value ?? 0);
    const frames = value("last") - value("first") + 1;
    const trials = entrants.rows.length * value("seeds");
    const poses = trials * frames * value("evaluations");
    sum.textContent = poses > 0 ? `${trials} trials of ${frames} frames: ${poses >= 1e6 ? `${(poses / 1e6).toPrecision(3)} million` : poses.toLocaleString("en")} poses to weigh, in the background.` : "";
  }
  session.onchange = takeSession;
  form.oninput = tell;
  form.onsubmit = async (event) => {
    event.preventDefault();
    submit.disabled = true;
    wrong.hidden = remedy.hidden = true;
    try {
      started(await post("/api/comparisons", read(form, entrants)));
    } catch (error) {
      wrong.textContent = error.message;
      remedy.textContent = error.hint ?? "";
      wrong.hidden = false;
      remedy.hidden = !error.hint;
    } finally { submit.disabled = false; }
  };
  const known = new Set(choices.entrants.map((one) => one.name));
  entrants.fill(wish.trackers ?? USUAL.filter((name) => known.has(name)).map((name) => ({ name })));
  takeSession();
  content.replaceChildren(element("div", { className: "column" },
    element("header", { className: "head" }, element("div", {}, element("h1", { textContent: "Compare trackers" }),
      element("p", { className: "lead", textContent: "Same evidence, weighting, start and seeds, and as many poses weighed in every frame: what differs is the search. Errors are measured against the session's truth." }))),
    form));
}

function nothingToCompare() {
  return element("div", { className: "nothing" }, element("h1", { textContent: "No session with a truth" }),
    element("p", { textContent: "Trackers are compared by their distance from true markers. Import a session with truth/*.trc, open the bundled walk in the studio, or render footage:" }),
    element("code", { textContent: "studio synthesize walk" }));
}
