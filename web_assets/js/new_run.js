// A new run: tracker, weighting, frames, seed and the knobs that matter most; everything else stays at its default.

import { fetchJson, post, runPath, sessionPath } from "./api.js";
import { openForm } from "./dialogs.js";
import { refreshSessions, openSession } from "./rail.js";
import { findStartPose, tellFound } from "./start_pose.js";
import { set } from "./state.js";

const NOISE = "noise", BEHAVIOUR = "behaviour";

const presetChoices = (presets) => [{ value: "", label: "defaults" }, ...presets.map((one) => ({ value: one.name, label: one.label }))];

/** The knobs of a tracker and weighting, by name. */
const knobsOf = async (tracker, weighting) => (await fetchJson(`/api/knobs?tracker=${encodeURIComponent(tracker)}&weighting=${encodeURIComponent(weighting)}`)).values;

/** The presets all of whose knobs are among these. */
const offered = (presets, knobs) => presets.filter((one) => Object.keys(one.values).every((name) => name in knobs));

/** A behaviour model as a choice. */
const modelChoice = (model) => ({ value: model.name, label: model.problem ? `${model.name} · ${model.problem}` : `${model.name} · ${model.body}, ${model.clusters} clusters, ${model.states} states` });

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
  const { trackers, weightings, bodies, behaviours, presets, problems } = await fetchJson("/api/choices");
  // Bodies whose every parameter has limits may begin anywhere between them; the others need a pose.
  const detail = await fetchJson(sessionPath(entry.name));
  const needsPose = !detail.has_start_pose && detail.body.parameters.some((one) => one.lower === null || one.upper === null);
  const first = { tracker: like?.tracker ?? entry.tracker, weighting: like?.weighting ?? entry.weighting };
  let knobs = await knobsOf(first.tracker, first.weighting);
  const bodyChoices = [{ value: "", label: `the session's (${entry.body})` }, ...bodies.map((body) => ({ value: body.name, label: `${body.name} · ${body.parameters} parameters` }))];
  openForm({
    heading: `New run of ${entry.name}`, action: "Track",
    intro: [...(detail.doubts.length ? [`The footage speaks against the calibration. ${detail.doubts[0]}`] : []), ...problems].join(" "),
    rows: [
      [{ name: "tracker", label: "Tracker", choices: trackers.map((one) => ({ value: one.name, label: one.label })), value: first.tracker },
        { name: "weighting", label: "Weighting", choices: weightings.map((one) => ({ value: one.name, label: one.label })), value: first.weighting }],
      [{ name: "preset", label: "Preset", choices: presetChoices(offered(presets, knobs)), value: "" },
        { name: "body", label: "Body", choices: bodyChoices, value: "" }],
      [{ name: "prediction", label: "Prediction", choices: [{ value: NOISE, label: "by noise" }, { value: BEHAVIOUR, label: "by behaviour" }], value: NOISE },
        { name: "behaviour", label: "Behaviour model", choices: [{ value: "", label: behaviours.length ? "the only one that fits" : "none learnt yet" }, ...behaviours.map(modelChoice)], value: "" }],
      [{ name: "first", label: "First frame", kind: "number", min: 0, max: entry.frame_count - 1, value: detail.start_pose_frame ?? 0 },
        { name: "last", label: "Last frame", kind: "number", min: 0, max: entry.frame_count - 1, value: entry.frame_count - 1 }],
      [{ name: "seed", label: "Seed", kind: "number", min: 0, value: like ? like.seed + 1 : 0, hint: "The same seed gives the same run." },
        { name: "name", label: "Name", value: "", placeholder: "numbered", pattern: "[A-Za-z0-9_\\-]{0,64}" }],
      [{ name: "find", kind: "check", label: "find the start pose in the first frame", value: needsPose }],
      [{ name: "shape", kind: "check", label: "fit the body's shape to the first frames (some seconds)", value: true }],
      [{ name: "live", kind: "check", label: "live: drops frames rather than falls behind", value: false }],
      ...(detail.doubts.length ? [[{ name: "despite", kind: "check", label: "track although the calibration is in doubt", value: false }]] : []),
    ],
    changed: async (name, form) => {
      const { tracker, weighting, preset } = form.elements;
      if (["tracker", "weighting"].includes(name)) {
        knobs = await knobsOf(tracker.value, weighting.value);
        const before = preset.value;
        preset.replaceChildren(...presetChoices(offered(presets, knobs)).map((one) => new Option(one.label, one.value, false, one.value === before)));
      }
      showBehaviour(form, knobs, trackers);
    },
    send: async (values, report) => {
      const found = values.find
        ? await findStartPose(entry.name, { frame: Number(values.first), body: values.body || null, behaviour: values.behaviour || null }, report)
        : null;
      if (found) tellFound(found);
      const preset = presets.find((one) => one.name === values.preset);
      const guided = values.prediction === BEHAVIOUR ? { prediction: BEHAVIOUR } : {};
      const made = await post(`${sessionPath(entry.name)}/runs`, {
        name: values.name || null, tracker: values.tracker, weighting: values.weighting, body: values.body || null, seed: Number(values.seed),
        first: Number(values.first), last: Number(values.last) + 1, settings: { ...preset?.values, ...guided },
        behaviour: values.behaviour || null, live: values.live, despite_findings: Boolean(values.despite), fit_shape: values.shape,
        ...(found ? { start_pose: found.pose, start_source: found.source } : {}),
      });
      await refreshSessions();
      openSession(entry.name, made.name);
      set({ follow: true });
      await post(`${runPath(entry.name, made.name)}/start`);
    },
  });
  showBehaviour(document.querySelector("#dialog form"), knobs, trackers);
}
