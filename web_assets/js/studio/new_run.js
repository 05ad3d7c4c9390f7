// A new run: tracker, likelihood, frames, seed and the knobs that matter most; everything else
// stays at its default.

import { fetchJson, post, runPath, sessionPath } from "../api.js";
import { dotted, duration } from "../elements.js";
import { complain } from "../messages.js";
import { openSession, refreshSessions } from "../sessions.js";
import { findStartPose, sayFound } from "./start_pose.js";
import { set } from "../state.js";
import { batch, html, useEffect, useSignal } from "./component.js";
import { Field, Form, openDialog, valuesOf } from "./dialogs.js";

const NOISE = "noise";
const BEHAVIOUR = "behaviour";
const PREDICTIONS = [
  { value: NOISE, label: "by noise" },
  { value: BEHAVIOUR, label: "by behaviour" },
];
const SWITCH = [
  { value: "true", label: "on" },
  { value: "false", label: "off" },
];
/**
 * What a run costs and how it searches: shown with its value, whatever the preset, and so is what
 * the preset sets; all others stay in the scene's panel.
 */
const CHIEF = [
  ...["particles", "layers", "survival"],
  ...["stage1_particles", "stage1_iterations", "stage2_particles", "stage2_iterations"],
];
/** The fields that change what the others offer. */
const LEADING = ["tracker", "weighting", "preset"];
/** What a preset may bring. */
const BROUGHT = ["tracker", "weighting", "body"];

const fieldName = (knob) => `knob-${knob.name}`;
const choicesOf = (entries) => entries.map((one) => ({ value: one.name, label: one.label }));

/** The knobs of a tracker and likelihood: their values by name, and what they are. */
const knobsOf = (tracker, weighting) =>
  fetchJson(`/api/knobs?${new URLSearchParams({ tracker, weighting })}`);

/**
 * How many poses are evaluated in a frame with these values; null where the tracker decides that
 * itself.
 */
function evaluationsOf(values) {
  const { layers, particles, stage1_particles: first, stage2_particles: second } = values;
  if (layers && particles) return layers * particles;
  if (!first) return null;
  return first * values.stage1_iterations + second * values.stage2_iterations;
}

/**
 * How long an evaluation and a frame take with a tracker and likelihood, by the session's stored
 * runs.
 */
const paceOf = (session, tracker, weighting, evaluations) =>
  fetchJson(
    `${sessionPath(session)}/pace?${new URLSearchParams({ tracker, weighting, evaluations })}`,
  );

/** A knob's field. @param {{ knob: any, value: any }} properties */
function KnobField({ knob, value }) {
  const isNumber = knob.kind === "int" || knob.kind === "float";
  const limits = isNumber && {
    kind: "number",
    min: knob.low,
    max: knob.high,
    step: knob.kind === "int" ? 1 : "any",
    required: true,
  };
  const choices = knob.kind === "bool" ? SWITCH : knob.choices.length ? knob.choices : null;
  const own = { name: fieldName(knob), label: knob.label, help: knob.help, value, choices };
  return html`<${Field} ...${own} ...${limits} />`;
}

/** What a knob's field holds, as the run's settings have it. */
function knobValue(knob, value) {
  if (knob.kind === "bool") return value === "true";
  return knob.kind === "int" || knob.kind === "float" ? Number(value) : value;
}

/**
 * The presets made for a tracker, which they bring, and of the others those all of whose knobs are
 * among these.
 */
const presetChoices = (presets, knobs) => [
  { value: "", label: "defaults" },
  ...choicesOf(
    presets.filter((one) => one.tracker || Object.keys(one.values).every((name) => name in knobs)),
  ),
];

/** A behaviour model as a choice. */
function modelChoice({ name, problem, body, clusters, states }) {
  const words = problem || `${body}, ${clusters} clusters, ${states} states`;
  return { value: name, label: dotted(name, words) };
}

/** Whether a preset is made for a tracker and likelihood. */
const fits = (preset, chosen) =>
  ["tracker", "weighting"].every((name) => !preset[name] || preset[name] === chosen[name]);

/** What the run will take, in words. */
function useCost(session, { tracker, weighting }, evaluations, frames) {
  const words = useSignal("");
  useEffect(() => {
    let isOld = false;
    const known = [`${evaluations} evaluations a frame`, `${frames} frames`];
    const say = ({ run, milliseconds, frame_milliseconds: more }) => {
      if (isOld) return;
      const took = duration(((milliseconds * evaluations + more) * frames) / 1000);
      const unknown = "how long that takes is known once its first frames are tracked";
      words.value = dotted(...known, run ? `about ${took}, judged by ${run}` : unknown);
    };
    if (!evaluations || frames <= 0) words.value = "";
    else {
      words.value ||= dotted(...known);
      paceOf(session, tracker, weighting, String(evaluations)).then(say).catch(complain);
    }
    return () => {
      isOld = true;
    };
  }, [tracker, weighting, evaluations, frames]);
  return words.value;
}

/**
 * The form for a session.
 * @param {{ entry: any, like: any, known: any, detail: any, first: any }} properties
 *   `known`: all that can be chosen. `first`: tracker and likelihood, and their knobs.
 */
function NewRun({ entry, like, known, detail, first }) {
  const { trackers, weightings, bodies, behaviours, presets, problems } = known;
  const chosen = useSignal({
    tracker: first.tracker,
    weighting: first.weighting,
    preset: "",
    body: "",
    prediction: NOISE,
    behaviour: "",
    shape: true,
  });
  const offered = useSignal({ number: 0, ...first.offered });
  const { tracker, weighting, preset: named, prediction } = chosen.value;
  const preset = presets.find((one) => one.name === named);
  const isPredicted = "prediction" in offered.value.values;
  const needsModel =
    trackers.find((one) => one.name === tracker)?.needs_behaviour || prediction === BEHAVIOUR;
  const usual = { ...offered.value.values, ...preset?.values };
  // Of a whole tracker's two dozen knobs the chief ones are enough here.
  const isShown = ({ name }) =>
    CHIEF.includes(name) || (name in (preset?.values ?? {}) && !preset.weighting);
  const knobs = offered.value.knobs.filter(isShown);
  const chiefValues = (values) =>
    Object.fromEntries(knobs.map((knob) => [knob.name, knobValue(knob, values[fieldName(knob)])]));

  const last = entry.frame_count - 1;
  /** What was typed since tracker, likelihood and preset were chosen. */
  const typed = useSignal({ first: detail.start_pose_frame ?? 0, last, knobs: {} });
  const evaluations = evaluationsOf({ ...usual, ...typed.value.knobs });
  const count = Math.max(0, typed.value.last - typed.value.first + 1);
  const cost = useCost(entry.name, chosen.value, evaluations, count);

  /** Take over what was chosen, and what follows from it. */
  const choose = async (name, values) => {
    const next = { ...chosen.value };
    for (const one of Object.keys(next)) next[one] = values[one] ?? next[one];
    const brought = presets.find((one) => one.name === next.preset);
    if (name === "preset" && brought) {
      for (const one of BROUGHT) next[one] = brought[one] || next[one];
      // A paper's tracker has no shape that is fitted on the way.
      if (brought.weighting) next.shape = false;
    }
    chosen.value = next;
    typed.value = {
      first: Number(values.first),
      last: Number(values.last),
      knobs: LEADING.includes(name) ? {} : chiefValues(values),
    };
    if (!LEADING.includes(name)) return;
    const found = await knobsOf(next.tracker, next.weighting);
    if (chosen.value !== next) return;
    const isKept = brought && fits(brought, next);
    const hasPrediction = "prediction" in found.values;
    batch(() => {
      offered.value = { number: offered.value.number + 1, ...found };
      chosen.value = {
        ...next,
        preset: isKept ? next.preset : "",
        prediction: hasPrediction ? next.prediction : NOISE,
      };
    });
  };

  const send = async (values, report) => {
    const request = {
      frame: Number(values.first),
      body: values.body || null,
      behaviour: values.behaviour || null,
    };
    const found = values.find && (await findStartPose(entry.name, request, report));
    if (found) sayFound(found);
    const moved = Object.entries(chiefValues(values)).filter(
      ([name, value]) => value !== usual[name],
    );
    const { name } = await post(`${sessionPath(entry.name)}/runs`, {
      name: values.name || null,
      tracker: values.tracker,
      weighting: values.weighting,
      body: values.body || null,
      seed: Number(values.seed),
      first: Number(values.first),
      last: Number(values.last) + 1,
      settings: {
        ...preset?.values,
        ...Object.fromEntries(moved),
        ...(values.prediction === BEHAVIOUR ? { prediction: BEHAVIOUR } : {}),
      },
      behaviour: values.behaviour || null,
      live: values.live,
      allow_inconsistent: Boolean(values.inconsistent),
      fit_shape: values.shape,
      ...(found ? { start_pose: found.pose, start_source: found.source } : {}),
    });
    await refreshSessions();
    openSession(entry.name, name);
    if (!values.start) return;
    set({ follow: true });
    await post(`${runPath(entry.name, name)}/start`);
  };

  const [warning] = detail.doubts;
  // Bodies whose every parameter has limits may begin anywhere between them; the others need a
  // pose.
  const isOpenEnded = ({ lower, upper }) => lower === null || upper === null;
  const needsPose = !detail.has_start_pose && detail.body.parameters.some(isOpenEnded);
  const own = { value: "", label: `the session's (${entry.body})` };
  const bodyChoices = bodies.map(({ name, parameters }) => ({
    value: name,
    label: `${name} · ${parameters} parameters`,
  }));
  const anyModel = behaviours.length ? "the only one that fits" : "none learnt yet";
  const { body, behaviour, shape } = chosen.value;
  const frames = { kind: "number", min: 0, max: last };
  return html`<${Form}
    heading=${`New run of ${entry.name}`}
    action="Track"
    intro=${[warning && `The footage contradicts the calibration. ${warning}`, ...problems].filter(Boolean).join(" ")}
    send=${send}
    changed=${(name, form) => choose(name, valuesOf(form))}
  >
    <div class="row">
      <${Field} name="tracker" label="Tracker" choices=${choicesOf(trackers)} value=${tracker} />
      <${Field}
        name="weighting"
        label="Likelihood"
        choices=${choicesOf(weightings)}
        value=${weighting}
      />
    </div>
    <div class="row">
      <${Field}
        name="preset"
        label="Preset"
        choices=${presetChoices(presets, offered.value.values)}
        value=${named}
      />
      <${Field} name="body" label="Body" choices=${[own, ...bodyChoices]} value=${body} />
    </div>
    <div class="chief-knobs" key=${`${offered.value.number} ${named}`}>
      ${knobs.map(
        (knob) => html`<${KnobField} key=${knob.name} knob=${knob} value=${usual[knob.name]} />`,
      )}
    </div>
    <p class="hint" role="status">${cost}</p>
    <div class="row" hidden=${!isPredicted && !needsModel}>
      <${Field}
        name="prediction"
        label="Prediction"
        hidden=${!isPredicted}
        choices=${PREDICTIONS}
        value=${prediction}
      />
      <${Field}
        name="behaviour"
        label="Behaviour model"
        hidden=${!needsModel}
        choices=${[{ value: "", label: anyModel }, ...behaviours.map(modelChoice)]}
        value=${needsModel ? behaviour : ""}
      />
    </div>
    <div class="row">
      <${Field} ...${frames} name="first" label="First frame" value=${detail.start_pose_frame ?? 0} />
      <${Field} ...${frames} name="last" label="Last frame" value=${last} />
    </div>
    <div class="row">
      <${Field}
        name="seed"
        label="Seed"
        kind="number"
        min="0"
        value=${like ? like.seed + 1 : 0}
        hint="The same seed gives the same run."
      />
      <${Field} name="name" label="Name" placeholder="numbered" pattern="[A-Za-z0-9_\\-]{0,64}" />
    </div>
    <${Field} name="find" kind="check" label="find the start pose in the first frame" value=${needsPose} />
    <${Field}
      name="shape"
      kind="check"
      label="fit the body's shape to the first frames (some seconds)"
      checked=${shape}
    />
    <${Field} name="start" kind="check" label="start tracking at once" value=${true} />
    <${Field} name="live" kind="check" label="live: drops frames rather than falls behind" />
    ${
      warning &&
      html`<${Field}
        name="inconsistent"
        kind="check"
        label="track although the calibration is in doubt"
      />`
    }
  </${Form}>`;
}

/** Open the form for a session; `like` is a run whose settings are taken over. */
export async function newRunForm(entry, like = null) {
  const { tracker, weighting } = like ?? entry;
  const [known, detail, offered] = await Promise.all([
    fetchJson(`/api/choices?session=${encodeURIComponent(entry.name)}`),
    fetchJson(sessionPath(entry.name)),
    knobsOf(tracker, weighting),
  ]);
  const first = { tracker, weighting, offered };
  openDialog(
    html`<${NewRun} entry=${entry} like=${like} known=${known} detail=${detail} first=${first} />`,
  );
}
