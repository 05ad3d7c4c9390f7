// Stored runs beside the open one: curves and their difference, settings that differ, layer by layer in the shown frame, the worst
// frame of each one click away; their bodies in the scene, each in its colour.

import { addressOf } from "./address.js";
import { fetchJson, frameView, runPath } from "./api.js";
import { figure as figureWords } from "./chart_looks.js";
import { openForm } from "./dialogs.js";
import { button, byId, element, fill, hint, table } from "./elements.js";
import { Figure } from "./figure.js";
import { complain } from "./messages.js";
import { paced } from "./pacing.js";
import { comparedRuns as others, goTo, MOST_COMPARED as MOST, select } from "./selection.js";
import { openSession } from "./sessions.js";
import { get, set, watch } from "./state.js";
import { showPanel } from "./tabs.js";
import { seriesColour } from "./theme.js";
import { categories, distinct, logarithmic, numbers, records, tipOf } from "./view_sheet.js";
import { drawBeside } from "./views.js";

/** @import { Schemas } from "./api_types" */

const LOAD_MILLISECONDS = 200;
const panel = byId("panel-compare");
const words = element("section", { className: "why-words", ariaLabel: "Compared runs" });
const place = element("section", { className: "figure", ariaLabel: "Curves" });
/** @type {Figure} */
let figure = null;
/** @type {{ key: string, answer: Schemas["RunsComparedView"] } | null} */
let held = null;
/** @type {{ key: string, runs: { run: string, pose: number[], layers: any[] }[] } | null} */
let frames = null;

const own = () => `${get("session")}/${get("run")}`;
const partsOf = (name) => name.split("/");

/** Choose the runs that are shown beside a run. */
export function compareForm(session, run) {
  const all = (get("sessions") ?? []).flatMap((entry) => entry.runs.filter((one) => one.done > 0).map((one) => ({ name: `${entry.name}/${one.name}`, words: one.describe ?? one.tracker, isNear: entry.name === session })))
    .filter((one) => one.name !== `${session}/${run}`).sort((a, b) => Number(b.isNear) - Number(a.isNear));
  const chosen = session === get("session") && run === get("run") ? others() : [];
  openForm({
    heading: `Compare ${run} with`, intro: all.length ? `One to ${MOST - 1} stored runs.` : "There is no other run that has frames.", action: "Compare",
    rows: all.map((one) => [{ name: one.name, kind: "check", label: `${one.isNear ? one.name.split("/")[1] : one.name} · ${one.words}`, value: chosen.includes(one.name) }]),
    send: (values) => {
      const names = Object.entries(values).filter(([, isChosen]) => isChosen).map(([name]) => name);
      if (!names.length || names.length >= MOST) throw Object.assign(new Error(`${names.length} runs cannot be shown beside it.`), { hint: `Choose one to ${MOST - 1}.` });
      openSession(session, run);
      set({ compared: names.join(",") });
      showPanel("compare");
    },
  });
}

async function load() {
  if (panel.hidden) return;
  if (!get("run")) return drawNothing("Open a run, then choose those that it is compared with.");
  const names = others();
  if (!names.length) return drawNothing("No runs are chosen yet.", button("Choose runs…", () => compareForm(get("session"), get("run")), "primary small"));
  const key = [own(), ...names, get("summary")?.frames.length].join(" ");
  try {
    if (held?.key !== key) {
      const query = new URLSearchParams([own(), ...names].map((name) => ["run", name]));
      const answer = await fetchJson(`/api/compared-runs?${query}`);
      held = { key, answer };
    }
    draw();
    await loadFrame(names);
  } catch (error) { drawNothing(`${error.message} ${error.hint ?? ""}`); }
}

/** The shown frame of every run: its pose for the scene, its layers for the chart. */
async function loadFrame(names) {
  const frame = get("frame");
  if (frame === null) return;
  const key = [own(), ...names, frame].join(" ");
  if (frames?.key === key) return drawBodies();
  const runs = await Promise.all([own(), ...names].map(async (name) => {
    const [session, run] = partsOf(name);
    try {
      const [detail, schedule] = await Promise.all([fetchJson(`${runPath(session, run)}/frames/${frame}`), fetchJson(frameView(session, run, frame, "schedule"))]);
      return { run: name, pose: detail.pose, layers: lastSearch(schedule) };
    } catch (error) {
      if (error.status !== 404) throw error;
      return { run: name, pose: null, layers: [] };
    }
  }));
  if (frame !== get("frame")) return;
  frames = { key, runs };
  drawBodies();
  figure.refresh();
}

/** The layers of a frame's last search, whose result the frame is, counted in it: however often the frame was searched. */
function lastSearch({ tables, search_layers: layers, searches }) {
  const first = layers * (searches - 1);
  return records(tables[0]).filter((row) => row.layer >= first).map((row) => ({ ...row, layer: row.layer - first, chosen: row.layer }));
}

/** The other runs' bodies beside this one's. */
function drawBodies() {
  drawBeside(frames.runs.slice(1).flatMap(({ pose }, at) => (pose ? [{ colour: `series-${at + 1}`, pose }] : [])));
}

function drawNothing(text, ...more) {
  held = null;
  fill(words, element("p", { className: "empty" }, text), ...more);
  figure.show(null, "");
}

const swatch = (at) => element("i", { className: "swatch", style: `background: ${seriesColour(at)}` });

function draw() {
  const { answer } = held;
  const byName = Object.fromEntries(answer.tables.map((one) => [one.name, one]));
  const worst = records(byName.worst);
  fill(words,
    element("div", { className: "head-line" }, element("h2", {}, `${answer.runs.length} runs`), button("Choose…", () => compareForm(get("session"), get("run")), "small"), button("End", () => { drawBeside([]); set({ compared: null }); }, "quiet small")),
    table(["Run", "Worst frame", "Error", "Limb"], worst.map((row, at) => [
      element("td", {}, swatch(at), at ? button(row.run, () => open(row.run), "quiet small", { title: "Open this run at this frame" }) : element("b", {}, row.run)),
      row.frame === null ? "–" : button(`frame ${row.frame}`, () => goTo(row.frame), "small quiet", { dataset: { key: `worst-${row.run}` } }), row.error === null ? "–" : `${figureWords(row.error)} mm`, row.limb,
    ]), "figures compared"),
    element("h3", {}, "Settings that differ"), byName.settings.rows.length ? element("div", { className: "table-box" }, table(["", ...answer.runs.map((name) => partsOf(name)[1])], byName.settings.rows.map((row) => row.map((cell) => (cell === null ? "–" : typeof cell === "number" ? figureWords(cell) : String(cell)))))) : hint("None: only their frames or their footage differ."));
  figure.show({
    name: `compared-${answer.runs.map((name) => name.replace("/", "-")).join("-")}`, title: "Runs side by side", question: "Where do they differ?", notes: [], tables: answer.tables, choose: select, link: () => addressOf(),
    caption: `Stored runs ${answer.runs.join(", ")}; differing settings: ${byName.settings.rows.map((row) => `${row[0]} ${row.slice(1).join(" / ")}`).join(", ") || "none"}.`,
    draw: (sheet, room) => drawn(sheet, { curves: records(byName.curves), runs: answer.runs }, room),
  });
}

/** Open another of the runs at the shown frame, with this one beside it. */
function open(name) {
  const [session, run] = partsOf(name);
  const beside = [own(), ...others().filter((one) => one !== name)].join(",");
  openSession(session, run, { frame: get("frame"), compared: beside, panel: "compare" });
}

/** Curves over the frames, their difference from the open run, and the layers of the shown frame. */
function drawn(sheet, { curves, runs }, room) {
  const key = curves.some((row) => row.error !== null) ? "error" : "log_weight";
  const unit = key === "error" ? "mean error, mm" : "log weight, nats";
  const all = distinct(curves.map((row) => row.frame)).sort((a, b) => a - b);
  const measured = new Map(curves.map((row) => [`${row.run}/${row.frame}`, row[key]]));
  const places = sheet.columns(3, { gutters: 58 });
  const height = Math.max(110, room - 76);
  const names = all.map(String);
  const click = ({ dataIndex }) => (dataIndex === undefined ? null : { frame: all[dataIndex] });
  const over = (points) => tipOf(`frame ${points[0].axisValue}`, points.filter((point) => point.seriesName).map((point) => [point.seriesName, point.data]));
  const ground = (x) => (all[Math.round(x)] === undefined ? null : { frame: all[Math.round(x)] });
  const plot = sheet.plot({ ...places[0], top: 0, height }, { title: "Over the frames", unit, names: runs, x: categories(names, "frame"), y: numbers("", key === "error" ? { scale: false, min: 0 } : {}), over, click: ground });
  runs.forEach((run, at) => { sheet.line(plot, run, all.map((frame) => measured.get(`${run}/${frame}`) ?? null), seriesColour(at), { symbols: all.length < 3, click }); });
  const difference = sheet.plot({ ...places[1], top: 0, height }, { title: "Difference", unit: `from ${runs[0]}; below 0 the other is ${key === "error" ? "nearer" : "lower"}`, x: categories(names, "frame"), y: numbers("", { scale: false }), over, click: ground });
  sheet.marks(difference, [{ y: 0 }]);
  runs.slice(1).forEach((run, at) => {
    sheet.line(difference, run, all.map((frame) => { const [one, other] = [measured.get(`${runs[0]}/${frame}`), measured.get(`${run}/${frame}`)]; return one === undefined || other === undefined || one === null || other === null ? null : other - one; }), seriesColour(at + 1), { symbols: all.length < 3, click });
  });
  for (const one of [plot, difference]) sheet.chosen(one, { column: String(get("frame")) });
  const ofOpen = frames?.runs[0]?.layers ?? [];
  const layered = frames?.runs.filter((one) => one.layers.length) ?? [];
  // A swarm's layers have no effective number: as many of them as it has do not squeeze the others' together.
  const most = Math.max(1, ...layered.flatMap((one) => one.layers.filter((row) => row.effective !== null).map((row) => row.layer + 1)));
  const layers = sheet.plot({ ...places[2], top: 0, height }, { title: "Effective number", unit: `by layer of the last search, frame ${get("frame")}, log scale`, x: categories(Array.from({ length: most }, (_, at) => String(at + 1)), "layer"), y: logarithmic("", { min: 1 }), over: (points) => tipOf(`layer ${points[0].axisValue}`, points.map((point) => [point.seriesName, point.data])) });
  for (const { run, layers: rows } of layered) sheet.line(layers, run, rows.slice(0, most).map((row) => row.effective), seriesColour(runs.indexOf(run)), { click: ({ dataIndex }) => ({ layer: ofOpen[dataIndex]?.chosen ?? null }) });
  const chosen = ofOpen.findIndex((row) => row.chosen === get("layer"));
  sheet.chosen(layers, { column: chosen < 0 ? null : chosen });
  return runs.map((run) => `${run}: ${figureWords(measured.get(`${run}/${get("frame")}`))}`).join(", ") + ` (${unit}, frame ${get("frame")}).`;
}

/** Wire the panel to the state. */
export function startComparing() {
  fill(panel, words, place);
  figure = new Figure(place);
  const later = paced(() => load().catch(complain), LOAD_MILLISECONDS);
  watch(["session", "run", "frame", "layer", "compared", "panel", "summary"], later);
  document.addEventListener("panel", () => later());
}

