// A new run: tracker, likelihood, frames, seed and the knobs that matter most; everything else stays at its default.

import { fetchJson, post, runPath, sessionPath } from "./api.js";
import { openForm } from "./dialogs.js";
import { byId, dotted, offer } from "./elements.js";
import { openSession, refreshSessions } from "./sessions.js";
import { findStartPose, sayFound } from "./start_pose.js";
import { set } from "./state.js";

const NOISE = "noise", BEHAVIOUR = "behaviour";

const named = (entries) => entries.map((one) => ({ value: one.name, label: one.label }));

/** The knobs of a tracker and likelihood, by name. */
const knobsOf = async (tracker, weighting) => (await fetchJson(`/api/knobs?tracker=${encodeURIComponent(tracker)}&weighting=${encodeURIComponent(weighting)}`)).values;

/** The presets all of whose knobs are among these, as choices. */
const presetChoices = (presets, knobs) => [{ value: "", label: "defaults" }, ...named(presets.filter((one) => Object.keys(one.values).every((name) => name in knobs)))];

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
  const [{ trackers, weightings, bodies, behaviours, presets, problems }, detail] = await Promise.all([fetchJson("/api/choices"), fetchJson(sessionPath(entry.name))]);
  // Bodies whose every parameter has limits may begin anywhere between them; the others need a pose.
  const needsPose = !detail.has_start_pose && detail.body.parameters.some((one) => one.lower === null || one.upper === null);
  const first = { tracker: like?.tracker ?? entry.tracker, weighting: like?.weighting ?? entry.weighting };
  let knobs = await knobsOf(first.tracker, first.weighting);
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
      [{ name: "live", kind: "check", label: "live: drops frames rather than falls behind" }],
      ...(doubt ? [[{ name: "despite", kind: "check", label: "track although the calibration is in doubt" }]] : []),
    ],
    changed: async (name, form) => {
      const { tracker, weighting, preset } = /** @type {any} */ (form.elements);
      if (["tracker", "weighting"].includes(name)) {
        knobs = await knobsOf(tracker.value, weighting.value);
        const before = preset.value;
        offer(preset, presetChoices(presets, knobs).map((one) => [one.value, one.label]), before);
      }
      showBehaviour(form, knobs, trackers);
    },
    send: async (values, report) => {
      const found = values.find && await findStartPose(entry.name, { frame: Number(values.first), body: values.body || null, behaviour: values.behaviour || null }, report);
      if (found) sayFound(found);
      const preset = presets.find((one) => one.name === values.preset);
      const { name } = await post(`${sessionPath(entry.name)}/runs`, {
        name: values.name || null, tracker: values.tracker, weighting: values.weighting, body: values.body || null, seed: Number(values.seed),
        first: Number(values.first), last: Number(values.last) + 1, settings: { ...preset?.values, ...(values.prediction === BEHAVIOUR ? { prediction: BEHAVIOUR } : {}) },
        behaviour: values.behaviour || null, live: values.live, despite_findings: Boolean(values.despite), fit_shape: values.shape,
        ...(found ? { start_pose: found.pose, start_source: found.source } : {}),
      });
      await refreshSessions();
      openSession(entry.name, name);
      set({ follow: true });
      await post(`${runPath(entry.name, name)}/start`);
    },
  });
  showBehaviour(byId("dialog").querySelector("form"), knobs, trackers);
}
