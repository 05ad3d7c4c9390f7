// A new run: tracker, weighting, frames, seed and the knobs that matter most; everything else stays at its default.

import { fetchJson, post, runPath, sessionPath } from "./api.js";
import { openForm } from "./dialogs.js";
import { refreshSessions, openSession } from "./rail.js";
import { set } from "./state.js";

let choices = null;

/** What can be chosen: trackers, weightings, bodies (asked once). */
async function known() {
  choices ??= await fetchJson("/api/choices");
  return choices;
}

const presetChoices = (presets) => [{ value: "", label: "defaults" }, ...presets.map((one) => ({ value: one.name, label: one.label }))];

/** The presets all of whose knobs a tracker and weighting have. */
async function offered(presets, tracker, weighting) {
  const { values } = await fetchJson(`/api/knobs?tracker=${encodeURIComponent(tracker)}&weighting=${encodeURIComponent(weighting)}`);
  return presets.filter((one) => Object.keys(one.values).every((name) => name in values));
}

/** Open the form for a session; `like` is a run whose settings are taken over. */
export async function newRunForm(entry, like = null) {
  const { trackers, weightings, bodies, presets } = await known();
  const usual = (tracker) => trackers.find((one) => one.name === tracker)?.weighting;
  let chosen = false;
  const first = { tracker: like?.tracker ?? entry.tracker, weighting: like?.weighting ?? entry.weighting };
  const bodyChoices = [{ value: "", label: `the session's (${entry.body})` }, ...bodies.map((body) => ({ value: body.name, label: `${body.name} · ${body.parameters} parameters` }))];
  openForm({
    heading: `New run of ${entry.name}`, action: "Track",
    rows: [
      [{ name: "tracker", label: "Tracker", choices: trackers.map((one) => ({ value: one.name, label: one.label })), value: first.tracker },
        { name: "weighting", label: "Weighting", choices: weightings.map((one) => ({ value: one.name, label: one.label })), value: first.weighting }],
      [{ name: "preset", label: "Preset", choices: presetChoices(await offered(presets, first.tracker, first.weighting)), value: "" },
        { name: "body", label: "Body", choices: bodyChoices, value: "" }],
      [{ name: "first", label: "First frame", kind: "number", min: 0, max: entry.frame_count - 1, value: 0 },
        { name: "last", label: "Last frame", kind: "number", min: 0, max: entry.frame_count - 1, value: entry.frame_count - 1 }],
      [{ name: "seed", label: "Seed", kind: "number", min: 0, value: like ? like.seed + 1 : 0, hint: "The same seed gives the same run." },
        { name: "name", label: "Name", value: "", placeholder: "numbered", pattern: "[A-Za-z0-9_\\-]{0,64}" }],
    ],
    // A tracker brings its usual weighting along, unless the session or the person wants another.
    changed: async (name, form) => {
      const { tracker, weighting, preset } = form.elements;
      chosen ||= name === "weighting";
      if (name === "tracker" && !chosen && usual(entry.tracker) === entry.weighting) weighting.value = usual(tracker.value);
      if (!["tracker", "weighting"].includes(name)) return;
      const before = preset.value;
      const fitting = presetChoices(await offered(presets, tracker.value, weighting.value));
      preset.replaceChildren(...fitting.map((one) => new Option(one.label, one.value, false, one.value === before)));
    },
    send: async (values) => {
      const preset = presets.find((one) => one.name === values.preset);
      const made = await post(`${sessionPath(entry.name)}/runs`, {
        name: values.name || null, tracker: values.tracker, weighting: values.weighting, body: values.body || null, seed: Number(values.seed),
        first: Number(values.first), last: Number(values.last) + 1, settings: preset?.values ?? {},
      });
      await refreshSessions();
      openSession(entry.name, made.name);
      set({ follow: true });
      await post(`${runPath(entry.name, made.name)}/start`);
    },
  });
}
