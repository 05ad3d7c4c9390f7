// Stored runs beside the open one: curves and their difference, settings that differ, layer by
// layer in the shown frame, the worst frame of each one click away; their bodies in the scene, each
// in its colour.

import { addressOf } from "../address.js";
import { fault, fetchJson, frameView, runPath } from "../api.js";
import { figure as figureWords, seriesToken } from "../chart_looks.js";
import { openForm } from "./dialogs.js";
import { complain } from "../messages.js";
import { paced } from "../pacing.js";
import { comparedRuns as others, goTo, MOST_COMPARED as MOST, select } from "../selection.js";
import { openSession } from "../sessions.js";
import { get, set, watch } from "../state.js";
import { records } from "../view_sheet.js";
import { coloursOf, drawCompared, lastSearch } from "./comparing_drawing.js";
import { follow, html, signal } from "./component.js";
import { FigurePlace } from "./figure_place.js";
import { showPanel } from "./panels.js";
import { drawBeside } from "./views.js";

/** @import { Schemas } from "../api_types" */

const LOAD_MILLISECONDS = 200;
/** The runs' numbers, and of which runs they are. */
const held = signal(/** @type {{ key: string, answer: Schemas["RunsCompared"] } | null} */ (null));
/** The shown frame of every run: its pose for the scene, its layers for the chart. */
const frames = signal(
  /** @type {{ key: string, runs: { run: string, pose: number[] | null, layers: any[] }[] } | null} */ (
    null
  ),
);
/** Why the runs cannot be compared. */
const wrong = signal("");

const own = () => `${get("session")}/${get("run")}`;
const partsOf = (name) => name.split("/");

/** The runs of the same body that have frames, those of the session first, as fields of a form. */
function runFields(session, run, chosen) {
  const sessions = get("sessions") ?? [];
  const body = sessions.find((entry) => entry.name === session)?.body;
  return sessions
    .filter((entry) => entry.body === body)
    .flatMap((entry) => entry.runs.map((one) => ({ entry, one })))
    .filter(({ one, entry }) => one.done > 0 && !(entry.name === session && one.name === run))
    .sort((a, b) => Number(b.entry.name === session) - Number(a.entry.name === session))
    .map(({ entry, one }) => {
      const name = `${entry.name}/${one.name}`;
      const words = entry.name === session ? one.name : name;
      const label = `${words} · ${one.describe ?? one.tracker}`;
      return { name, kind: "check", label, value: chosen.includes(name) };
    });
}

/** Choose the runs that are shown beside a run. */
export function compareForm(session, run) {
  const isOpen = session === get("session") && run === get("run");
  const fields = runFields(session, run, isOpen ? others() : []);
  const none = "There is no other run of this body that has frames.";
  openForm({
    heading: `Compare ${run} with`,
    intro: fields.length ? `One to ${MOST - 1} stored runs.` : none,
    action: "Compare",
    rows: fields.map((field) => [field]),
    send: (values) => {
      const names = Object.keys(values).filter((name) => values[name]);
      if (!names.length || names.length >= MOST) {
        throw fault(
          `${names.length} runs cannot be shown beside it.`,
          `Choose one to ${MOST - 1}.`,
        );
      }
      openSession(session, run);
      set({ compared: names.join(",") });
      showPanel("compare");
    },
  });
}

/** The chosen runs, in a component: it renders again when others are. */
function followOthers() {
  follow("session");
  follow("compared");
  return follow("run") ? others() : [];
}

const chooseHere = () => compareForm(get("session"), get("run"));

async function load() {
  const names = others();
  if (get("panel") !== "compare" || !get("run") || !names.length) return;
  const key = [own(), ...names, get("summary")?.frames.length].join(" ");
  try {
    if (held.value?.key !== key) {
      const query = new URLSearchParams([own(), ...names].map((name) => ["run", name]));
      held.value = { key, answer: await fetchJson(`/api/compared-runs?${query}`) };
    }
    wrong.value = "";
    await loadFrames([own(), ...names]);
  } catch (error) {
    const { message, hint = "" } = /** @type {any} */ (error);
    held.value = null;
    wrong.value = `${message} ${hint}`;
  }
}

/** The shown frame of a run; none where the run does not have it. */
async function loadFrame(name, frame) {
  const [session, run] = partsOf(name);
  try {
    const [detail, schedule] = await Promise.all([
      fetchJson(`${runPath(session, run)}/frames/${frame}`),
      fetchJson(frameView(session, run, frame, "schedule")),
    ]);
    return { run: name, pose: detail.pose, layers: lastSearch(schedule) };
  } catch (error) {
    if (/** @type {any} */ (error).status !== 404) throw error;
    return { run: name, pose: null, layers: [] };
  }
}

/** The shown frame of every run; the others' bodies are drawn beside this one's. */
async function loadFrames(names) {
  const frame = get("frame");
  if (frame === null) return;
  const key = [...names, frame].join(" ");
  if (frames.value?.key !== key) {
    const runs = await Promise.all(names.map((name) => loadFrame(name, frame)));
    if (frame !== get("frame")) return;
    frames.value = { key, runs };
  }
  const colours = coloursOf(names);
  drawBeside(
    frames.value.runs
      .slice(1)
      .flatMap(({ run, pose }) =>
        pose ? [{ colour: seriesToken(colours.get(run) ?? 0), pose }] : [],
      ),
  );
}

/** Open another of the runs at the shown frame, with this one beside it. */
function open(name) {
  const [session, run] = partsOf(name);
  openSession(session, run, { frame: get("frame"), panel: "compare" });
}

/**
 * The worst frame of each run.
 * @param {{ rows: any[], colours: Map<string, number> }} properties
 */
const Worst = ({ rows, colours }) => html`<table class="figures compared">
  <thead>
    <tr>
      ${["Run", "Worst frame", "Error", "Limb"].map((head) => html`<th key=${head}>${head}</th>`)}
    </tr>
  </thead>
  <tbody>
    ${rows.map(
      ({ run, frame, error, limb }, at) =>
        html`<tr key=${run}>
          <td>
            <i class="swatch" style=${{ background: `var(--${seriesToken(colours.get(run) ?? 0)})` }}></i>
            ${
              at
                ? html`<button
                    type="button"
                    class="quiet small"
                    title="Open this run at this frame"
                    onClick=${() => open(run)}
                  >
                    ${run}
                  </button>`
                : html`<b>${run}</b>`
            }
          </td>
          <td>
            ${
              frame === null
                ? "–"
                : html`<button
                    type="button"
                    class="small quiet"
                    data-key=${`worst-${run}`}
                    onClick=${() => goTo(frame)}
                  >
                    frame ${frame}
                  </button>`
            }
          </td>
          <td>${error === null ? "–" : `${figureWords(error)} mm`}</td>
          <td>${limb}</td>
        </tr>`,
    )}
  </tbody>
</table>`;

const cellWords = (value) =>
  value === null ? "–" : typeof value === "number" ? figureWords(value) : String(value);

/** The settings that differ. @param {{ runs: string[], rows: any[][] }} properties */
function Settings({ runs, rows }) {
  if (!rows.length)
    return html`<p class="hint">None: only their frames or their footage differ.</p>`;
  return html`<div class="table-box">
    <table class="figures">
      <thead>
        <tr>
          ${["", ...runs.map((name) => partsOf(name)[1])].map((head) => html`<th>${head}</th>`)}
        </tr>
      </thead>
      <tbody>
        ${rows.map(
          (row) =>
            html`<tr key=${row[0]}>${row.map((cell) => html`<td>${cellWords(cell)}</td>`)}</tr>`,
        )}
      </tbody>
    </table>
  </div>`;
}

/** @param {{ answer: Schemas["RunsCompared"] }} properties */
function Words({ answer: { runs, tables } }) {
  const named = (name) => tables.find((table) => table.name === name);
  const end = () => {
    drawBeside([]);
    set({ compared: null });
  };
  return html`
    <div class="head-line">
      <h2>${runs.length} runs</h2>
      <button type="button" class="small" onClick=${chooseHere}>Choose…</button>
      <button type="button" class="quiet small" onClick=${end}>End</button>
    </div>
    <${Worst} rows=${records(named("worst"))} colours=${coloursOf(runs)} />
    <h3>Settings that differ</h3>
    <${Settings} runs=${runs} rows=${named("settings")?.rows ?? []} />
  `;
}

/** The figure of the runs' curves. @param {Schemas["RunsCompared"]} answer */
function figureOf({ runs, tables }) {
  const named = (name) => tables.find((table) => table.name === name);
  const curves = records(named("curves"));
  const [frame, layer] = [follow("frame"), follow("layer")];
  const layered = frames.value?.runs ?? [];
  const differing = named("settings")?.rows.map(
    ([name, ...values]) => `${name} ${values.join(" / ")}`,
  );
  return {
    name: `compared-${runs.map((name) => name.replace("/", "-")).join("-")}`,
    title: "Runs side by side",
    question: "Where do they differ?",
    notes: [],
    tables,
    choose: select,
    link: () => addressOf(),
    caption: `Stored runs ${runs.join(", ")}; differing settings: ${differing?.join(", ") || "none"}.`,
    draw: (sheet, room) => drawCompared(sheet, { curves, runs, frame, layer, layered }, room),
  };
}

/** What the panel says: why there is nothing to compare, or the runs. */
function Said() {
  const empty = (words) => html`<p class="empty">${words}</p>`;
  if (!follow("run")) return empty("Open a run, then choose those that it is compared with.");
  if (!followOthers().length) {
    return html`${empty("No runs are chosen yet.")}
      <button type="button" class="primary small" onClick=${chooseHere}>Choose runs…</button>`;
  }
  if (wrong.value) return empty(wrong.value);
  if (!held.value) return empty("The runs are being compared…");
  return html`<${Words} answer=${held.value.answer} />`;
}

/** The panel. */
export function Comparing() {
  const isShown = followOthers().length > 0 && held.value;
  return html`
    <section class="why-words" aria-label="Compared runs"><${Said} /></section>
    <${FigurePlace}
      panel="compare"
      label="Curves"
      shown=${isShown ? figureOf(isShown.answer) : null}
    />
  `;
}

/** Load what the panel compares. */
export function startComparing() {
  const later = paced(() => load().catch(complain), LOAD_MILLISECONDS);
  watch(["session", "run", "frame", "compared", "panel", "summary"], later);
}
