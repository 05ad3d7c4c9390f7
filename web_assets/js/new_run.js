// A new run: tracker, likelihood, frames, seed and the knobs that matter most; everything else stays at its default.

import { fetchJson, post, runPath, sessionPath } from "./api.js";
import { openForm } from "./dialogs.js";
import { byId, dotted, duration, element, field, fill, number, offer, select, text } from "./elements.js";
import { complain } from "./messages.js";
import { openSession, refreshSessions } from "./sessions.js";
import { findStartPose, sayFound } from "./start_pose.js";
import { set } from "./state.js";

const NOISE = "noise", BEHAVIOUR = "behaviour";

const named = (entries) => entries.map((one) => ({ value: one.name, label: one.label }));

// What a run costs and how it searches: shown with its value, whatever the preset, and so is what the preset sets; all others stay
// in the scene's panel.
const CHIEF = ["particles", "layers", "survival", "stage1_particles", "stage1_iterations", "stage2_particles", "stage2_iterations"];

/** The knobs of a tracker and likelihood: their values by name, and what they are. */
const knobsOf = async (tracker, weighting) => fetchJson(`/api/knobs?tracker=${encodeURIComponent(tracker)}&weighting=${encodeURIComponent(weighting)}`);

/** How many poses are evaluated in a frame with these values; null where the tracker decides that itself. */
const evaluationsOf = (values) => (values.layers && values.particles ? values.layers * values.particles
  : values.stage1_particles ? values.stage1_particles * values.stage1_iterations + values.stage2_particles * values.stage2_iterations : null);

/** How long an evaluation and a frame take with a tracker and likelihood, judged by the session's stored runs. */
const paceOf = (session, tracker, weighting, evaluations) => fetchJson(`${sessionPath(session)}/pace?${new URLSearchParams({ tracker, weighting, evaluations })}`);

/** A field for a knob's value. */
function knobInput(knob, value) {
  const name = `knob-${knob.name}`;
  if (knob.kind === "bool") return select([["true", "on"], ["false", "off"]], String(value), { name, dataset: { kind: "bool" } });
  if (knob.choices.length) return select(knob.choices, value, { name });
  if (knob.kind === "str") return text({ name, value });
  return number(value, { name, min: knob.low, max: knob.high, step: knob.kind === "int" ? 1 : "any", required: true });
}

/**
 * The presets as choices: those made for a tracker, which they bring, and of the others those
 * all of whose knobs are among these.
 */
const presetChoices = (presets, knobs) => [{ value: "", label: "defaults" },
  ...named(presets.filter((one) => one.tracker
    || Object.keys(one.values).every((name) => name in knobs)))];

/** Set the tracker, likelihood and body that a preset is made for. */
function bringWhole(form, preset) {
  for (const name of ["tracker", "weighting", "body"]) {
    if (preset?.[name]) form.elements[name].value = preset[name];
  }
  // A paper's tracker has no shape that is fitted on the way.
  if (preset?.weighting) form.elements.shape.checked = false;
}

/** Whether a preset is made for the tracker and likelihood that are chosen. */
const fits = (form, preset) => ["tracker", "weighting"].every((name) => !preset[name]
  || preset[name] === form.elements[name].value);

/** A behaviour model as a choice. */
const modelChoice = (model) => ({ value: model.name, label: dotted(model.name, model.problem || `${model.body}, ${model.clusters} clusters, ${model.states} states`) });

/** Show the prediction where a tracker has one, and the model where something needs it. */
function showBehaviour(form, knobs, trackers) {
  const { tracker, prediction, behaviour } = form.elements;
  const chooses = "prediction" in knobs;
  if (!chooses) prediction.value = NOISE;
  const needs = trackers.find((one) => one.name === tracker.value)?.needs_behaviour || prediction.value === BEHAVIOUR;
  if (!needs) behaviour.value = "";
  prediction.closest("label").hidden = !chooses;
  behaviour.closest("label").hidden = !needs;
  prediction.closest(".row").hidden = !chooses && !needs;
}

/** Open the form for a session; `like` is a run whose settings are taken over. */
export async function newRunForm(entry, like = null) {
  const [{ trackers, weightings, bodies, behaviours, presets, problems }, detail] = await Promise.all([fetchJson(`/api/choices?session=${encodeURIComponent(entry.name)}`), fetchJson(sessionPath(entry.name))]);
  // Bodies whose every parameter has limits may begin anywhere between them; the others need a pose.
  const needsPose = !detail.has_start_pose && detail.body.parameters.some((one) => one.lower === null || one.upper === null);
  const first = { tracker: like?.tracker ?? entry.tracker, weighting: like?.weighting ?? entry.weighting };
  let offered = await knobsOf(first.tracker, first.weighting);
  let knobs = offered.values;
  const chief = element("div", { className: "chief-knobs" });
  const cost = element("p", { className: "hint", role: "status" });
  let newest = 0;

  /** The chief knobs with the preset's values, and what they cost. */
  function drawChief(form) {
    const chosen = presets.find((one) => one.name === form.elements.preset.value);
    const own = chosen?.values ?? {};
    // Of a whole tracker's two dozen knobs the chief ones are enough here.
    const isShown = (knob) => CHIEF.includes(knob.name) || (knob.name in own && !chosen.weighting);
    fill(chief, offered.knobs.filter(isShown).map((knob) => field(knob.label, knobInput(knob, own[knob.name] ?? knobs[knob.name]), { title: knob.help })));
    drawCost(form);
  }

  /** The values of the chief knobs as they stand in the form. */
  const chiefValues = () => Object.fromEntries([...chief.querySelectorAll("input, select")].map((/** @type {any} */ input) => [input.name.slice("knob-".length), input.type === "number" ? Number(input.value) : input.dataset.kind === "bool" ? input.value === "true" : input.value]));

  function drawCost(form) {
    const evaluations = evaluationsOf({ ...knobs, ...chiefValues() });
    const frames = Number(form.elements.last.value) - Number(form.elements.first.value) + 1;
    const known = [`${evaluations} evaluations a frame`, `${Math.max(0, frames)} frames`];
    if (!evaluations || frames <= 0) { cost.textContent = ""; return; }
    newest += 1;
    const own = newest;
    if (!cost.textContent) cost.textContent = dotted(...known);
    paceOf(entry.name, form.elements.tracker.value, form.elements.weighting.value, String(evaluations)).then(({ run, milliseconds, frame_milliseconds }) => {
      if (newest === own) cost.textContent = dotted(...known, run ? `about ${duration(((milliseconds * evaluations + frame_milliseconds) * frames) / 1000)}, judged by ${run}` : "how long that takes is known once its first frames are tracked");
    }).catch(complain);
  }

  const [doubt] = detail.doubts;
  openForm({
    heading: `New run of ${entry.name}`, action: "Track",
    intro: [...(doubt ? [`The footage contradicts the calibration. ${doubt}`] : []), ...problems].join(" "),
    rows: [
      [{ name: "tracker", label: "Tracker", choices: named(trackers), value: first.tracker }, { name: "weighting", label: "Likelihood", choices: named(weightings), value: first.weighting }],
      [{ name: "preset", label: "Preset", choices: presetChoices(presets, knobs) },
        { name: "body", label: "Body", choices: [{ value: "", label: `the session's (${entry.body})` }, ...bodies.map((body) => ({ value: body.name, label: `${body.name} · ${body.parameters} parameters` }))] }],
      [{ name: "prediction", label: "Prediction", choices: [{ value: NOISE, label: "by noise" }, { value: BEHAVIOUR, label: "by behaviour" }], value: NOISE },
        { name: "behaviour", label: "Behaviour model", choices: [{ value: "", label: behaviours.length ? "the only one that fits" : "none learnt yet" }, ...behaviours.map(modelChoice)] }],
      [{ name: "first", label: "First frame", kind: "number", min: 0, max: entry.frame_count - 1, value: detail.start_pose_frame ?? 0 },
        { name: "last", label: "Last frame", kind: "number", min: 0, max: entry.frame_count - 1, value: entry.frame_count - 1 }],
      [{ name: "seed", label: "Seed", kind: "number", min: 0, value: like ? like.seed + 1 : 0, hint: "The same seed gives the same run." },
        { name: "name", label: "Name", placeholder: "numbered", pattern: "[A-Za-z0-9_\\-]{0,64}" }],
      [{ name: "find", kind: "check", label: "find the start pose in the first frame", value: needsPose }],
      [{ name: "shape", kind: "check", label: "fit the body's shape to the first frames (some seconds)", value: true }],
      [{ name: "start", kind: "check", label: "start tracking at once", value: true }],
      [{ name: "live", kind: "check", label: "live: drops frames rather than falls behind" }],
      ...(doubt ? [[{ name: "inconsistent", kind: "check", label: "track although the calibration is in doubt" }]] : []),
    ],
    changed: async (name, form) => {
      const { tracker, weighting, preset } = /** @type {any} */ (form.elements);
      const chosen = presets.find((one) => one.name === preset.value);
      if (name === "preset") bringWhole(form, chosen);
      if (["tracker", "weighting", "preset"].includes(name)) {
        offered = await knobsOf(tracker.value, weighting.value);
        knobs = offered.values;
        const before = chosen && fits(form, chosen) ? preset.value : "";
        offer(preset, presetChoices(presets, knobs).map((one) => [one.value, one.label]), before);
      }
      showBehaviour(form, knobs, trackers);
      if (["tracker", "weighting", "preset"].includes(name)) drawChief(form);
      else drawCost(form);
    },
    send: async (values, report) => {
      const found = values.find && await findStartPose(entry.name, { frame: Number(values.first), body: values.body || null, behaviour: values.behaviour || null }, report);
      if (found) sayFound(found);
      const preset = presets.find((one) => one.name === values.preset);
      const moved = (chosen) => Object.fromEntries(Object.entries(chiefValues()).filter(([name, value]) => value !== (chosen?.values[name] ?? knobs[name])));
      const { name } = await post(`${sessionPath(entry.name)}/runs`, {
        name: values.name || null, tracker: values.tracker, weighting: values.weighting, body: values.body || null, seed: Number(values.seed),
        first: Number(values.first), last: Number(values.last) + 1, settings: { ...preset?.values, ...moved(preset), ...(values.prediction === BEHAVIOUR ? { prediction: BEHAVIOUR } : {}) },
        behaviour: values.behaviour || null, live: values.live, allow_inconsistent: Boolean(values.inconsistent), fit_shape: values.shape,
        ...(found ? { start_pose: found.pose, start_source: found.source } : {}),
      });
      await refreshSessions();
      openSession(entry.name, name);
      if (!values.start) return;
      set({ follow: true });
      await post(`${runPath(entry.name, name)}/start`);
    },
  });
  const form = byId("dialog").querySelector("form");
  form.elements.preset.closest(".row").after(chief, cost);
  showBehaviour(form, knobs, trackers);
  drawChief(form);
}
