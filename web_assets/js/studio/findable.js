// What "Find" knows: all that can be opened, chosen or done, each with its words and what it does.

import { fetchJson, patch, readOnly, runPath } from "../api.js";
import { openForm } from "./dialogs.js";
import { complain, say } from "../messages.js";
import { goTo, limbGroup, range, select } from "../selection.js";
import { openSession, rigPath, setupPath } from "../sessions.js";
import { get, set } from "../state.js";
import { useTheme } from "../theme.js";
import { chooseFormat } from "./exporting.js";
import { commands } from "./keys.js";
import { PANELS, showPanel } from "./panels.js";
import { allViews, saveView, showView, stepView, toggleTable } from "./views.js";

/**
 * Something that can be found. `also`: what it is found by besides.
 * @typedef {{ kind: string, words: string, more: string, also?: string, act: () => void }} Entry
 */

const THEMES = /** @type {const} */ ([
  ["light", "Light"],
  ["dark", "Dark"],
  ["system", "As the system is"],
]);
const FILES = /** @type {const} */ ([
  ["svg", "SVG"],
  ["pdf", "PDF"],
  ["csv", "CSV"],
  ["link", "link"],
]);

const upper = (words) => words[0].toUpperCase() + words.slice(1);
const go = (address) => {
  location.href = address;
};
const openBeside = (address, target = "_blank") => window.open(address, target, "noopener");

/**
 * What is asked of the server when "Find" is opened: knobs of the run, formats, headings of the
 * guide.
 */
let asked = {
  knobs: /** @type {any} */ (null),
  formats: /** @type {any[]} */ ([]),
  help: /** @type {any[]} */ ([]),
};

/**
 * Ask again for what depends on the run; `changed()` when there is more to find.
 * @param {() => void} changed
 */
export async function askForFindable(changed) {
  const [session, run] = [get("session"), get("run")];
  const none = () => null;
  const [knobs, choices, guide] = await Promise.all([
    session && run ? fetchJson(`${runPath(session, run)}/settings`).catch(none) : null,
    asked.formats.length ? null : fetchJson("/api/exports/choices").catch(none),
    asked.help.length ? null : fetchJson("/api/guide-contents").catch(none),
  ]);
  asked = {
    knobs: knobs && { session, run, ...knobs },
    formats: choices?.formats ?? asked.formats,
    help: guide?.headings ?? asked.help,
  };
  changed();
}

/** The field of a form for a knob's value. */
function knobField(knob, value) {
  const isNumber = knob.kind === "int" || knob.kind === "float";
  const isLimited = isNumber && Number.isFinite(knob.low) && Number.isFinite(knob.high);
  const common = {
    name: "value",
    label: knob.unit ? `${upper(knob.label)} (${knob.unit})` : upper(knob.label),
    value,
    hint: isLimited ? `${knob.help} ${knob.low} to ${knob.high}.` : knob.help,
  };
  if (knob.choices?.length) return { ...common, choices: knob.choices };
  return {
    ...common,
    kind: knob.kind === "bool" ? "check" : isNumber ? "number" : "text",
    min: knob.low,
    max: knob.high,
    step: knob.kind === "int" ? 1 : "any",
  };
}

/** Change a knob of the open run, as its slider in the scene does. */
function knobForm(knob, value) {
  openForm({
    heading: upper(knob.label),
    action: "Try it",
    rows: [[knobField(knob, value)]],
    intro: "The shown frame is annealed again with it; nothing is stored.",
    send: async (values) => {
      set({ follow: false });
      const isNumber = knob.kind === "int" || knob.kind === "float";
      const wanted = isNumber ? Number(values.value) : values.value;
      const path = runPath(get("session"), get("run"));
      await patch(`${path}/settings?frame=${get("frame")}`, { [knob.name]: wanted });
      say(`${upper(knob.label)}: ${wanted}. The next search of the frame uses it.`);
    },
  });
}

function knobs() {
  const { knobs: known } = asked;
  const isHere = known?.session === get("session") && known?.run === get("run");
  if (readOnly || !known || !isHere || get("frame") === null) return [];
  return known.knobs.map((knob) => {
    const value = known.moved[knob.name] ?? known.values[knob.name];
    return {
      kind: "Knob",
      words: upper(knob.label),
      more: `${value === "" ? "none" : value} ${knob.unit ?? ""}`,
      also: `${knob.name} ${knob.help}`,
      act: () => knobForm(knob, value),
    };
  });
}

function limbs() {
  const groups = (get("parameters") ?? []).map((one) => limbGroup(one.limb));
  return [...new Set(groups)].filter(Boolean).map((limb) => ({
    kind: "Limb",
    words: upper(limb),
    more: get("limb") === limb ? "chosen" : "",
    act: () => select({ limb }),
  }));
}

const parameters = () =>
  (get("parameters") ?? []).map(({ name, label }) => ({
    kind: "Parameter",
    words: upper(label),
    more: get("parameter") === name ? "chosen" : "",
    also: name,
    act: () => select({ parameter: name }),
  }));

/** The frame that a number names. @param {string} wanted @returns {Entry[]} */
function frames(wanted) {
  const number = /^(?:frame\s*)?(\d{1,9})$/.exec(wanted)?.[1];
  if (!number || !get("summary")?.frames.length) return [];
  const [first, last] = range();
  const frame = Number(number);
  const act = () => goTo(frame);
  if (frame < first || frame >= last) {
    const words = `There is no frame ${frame}`;
    return [{ kind: "Frame", words, more: `${first} to ${last - 1}`, act }];
  }
  const note = get("notes").find((one) => one.frame === frame);
  return [{ kind: "Frame", words: `Frame ${frame}`, more: note?.text ?? "", act }];
}

const notes = () =>
  get("notes").map((note) => ({
    kind: "Note",
    words: note.text || `Bookmark on frame ${note.frame}`,
    more: `frame ${note.frame}`,
    act: () => goTo(note.frame),
  }));

function exports() {
  const views = FILES.map(([kind, word]) => ({
    kind: "Export",
    words: `This view as ${word}`,
    more: "",
    act: () => {
      showPanel("views");
      saveView(kind);
    },
  }));
  if (!get("run")) return views;
  const files = asked.formats.map((form) => ({
    kind: "Export",
    words: form.title,
    more: `.${form.name}`,
    also: form.opens,
    act: () => {
      showPanel("export");
      chooseFormat(form.name);
    },
  }));
  return [...views, ...files];
}

function pages() {
  const links = /** @type {NodeListOf<HTMLAnchorElement>} */ (
    document.querySelectorAll(".places a")
  );
  const own = [...links].map((link) => ({
    kind: "Page",
    words: link.textContent,
    more: "",
    act: () => {
      if (link.target) openBeside(link.href, link.target);
      else go(link.href);
    },
  }));
  const [session, run] = [get("session"), get("run")];
  const page = (/** @type {string} */ words, /** @type {string} */ address) => ({
    kind: "Page",
    words,
    more: "",
    act: () => go(address),
  });
  return [
    ...own,
    ...(run ? [page("Where should cameras stand?", rigPath(session, run))] : []),
    ...(session && !readOnly
      ? [page(`Guided set-up of ${session}`, setupPath({ name: session }))]
      : []),
  ];
}

function doings() {
  const keys = commands().map(([key, words, act]) => ({
    kind: "Command",
    words: upper(words),
    more: key,
    act,
  }));
  return [
    { kind: "Command", words: "Next view", more: "v", act: () => stepView(1) },
    { kind: "Command", words: "View as a table", more: "t", act: toggleTable },
    ...keys,
  ];
}

const panels = () =>
  PANELS.map(([name, words]) => ({
    kind: "Panel",
    words,
    more: "",
    act: () => showPanel(name),
  }));

const views = () =>
  allViews().map((view) => ({
    kind: "View",
    words: view.title,
    more: view.question,
    // By what it shows, too: a knob's word finds the view of what the knob does.
    also: (view.tables ?? [])
      .flatMap(({ title, columns }) => [title, ...columns.map((one) => one.label)])
      .join(" "),
    act: () => {
      showPanel("views");
      showView(view.name);
    },
  }));

const themes = () =>
  THEMES.map(([name, words]) => ({
    kind: "Theme",
    words,
    more: "light or dark",
    act: () => useTheme(name),
  }));

const help = () =>
  asked.help.map(({ title, page, address }) => ({
    kind: "Help",
    words: title,
    more: page,
    act: () => openBeside(address),
  }));

/** The runs, and the sessions without one. */
const runs = () =>
  (get("sessions") ?? []).flatMap((session) =>
    session.runs.length
      ? session.runs.map((run) => ({
          kind: "Run",
          words: `${session.name} / ${run.name}`,
          more: run.describe ?? "",
          act: () => openSession(session.name, run.name),
        }))
      : [
          {
            kind: "Session",
            words: session.name,
            more: session.title ?? "",
            act: () => openSession(session.name),
          },
        ],
  );

/** What there is, the nearest to the search's own first. */
const KINDS = [
  frames,
  views,
  panels,
  doings,
  knobs,
  limbs,
  parameters,
  notes,
  exports,
  pages,
  themes,
  runs,
  help,
];

/** Do it; what goes wrong is said. @param {Entry} entry */
const act = (entry) => {
  try {
    entry.act();
  } catch (error) {
    complain(error);
  }
};

/**
 * All that can be found.
 * @param {string} wanted what is looked for, in small letters
 * @returns {Entry[]}
 */
export const findable = (wanted) =>
  KINDS.flatMap((kind) => kind(wanted)).map((entry) => ({ ...entry, act: () => act(entry) }));
