// The run's export: which format, with which options; how far it is; the files that came of it, to be downloaded.

import { fetchJson, post, remove, runPath } from "./api.js";
import { button, duration, element } from "./elements.js";
import { onEvent } from "./live.js";
import { complain } from "./messages.js";
import { get, watch } from "./state.js";
import { isGoing } from "./jobs.js";

const panel = document.getElementById("panel-export");
const WORDS = {
  auto: "auto", own: "the body's own", halpe26: "HALPE-26", mixamo: "Mixamo", opensim: "OpenSim", tpose: "T-pose", neutral: "neutral pose",
  gap: "become gaps", keep: "keep the held pose", y: "y", z: "z", pose2sim: "Pose2Sim", aniposelib: "anipose", opencv: "OpenCV",
};
const EMPTY = { first: "first", last: "end", fps: "as tracked", height: "as recorded" };
const DOWNLOAD = '<svg viewBox="0 0 16 16"><path d="M7.2 2h1.6v6l2.1-2.1 1.1 1.1L8 11 4 7l1.1-1.1L7.2 8zM3 12.4h10V14H3z"/></svg>';

let choices = null;
let listing = { exports: [], running: [], tracks: [], best: "raw", note: "", cameras: [] };
let format = localStorage.getItem("export-format") || "bvh";
const state = { wish: {}, going: null, failed: null };

const megabytes = (bytes) => (bytes < 1e5 ? `${(bytes / 1e3).toFixed(1)} kB` : `${(bytes / 1e6).toFixed(1)} MB`);
const here = () => runPath(get("session"), get("run"));
const isHere = (told) => told.session === get("session") && told.run === get("run");

/** What a select offers for an option: [value, words]. */
function offered(option, form) {
  if (option.name === "track") return [["best", `best (${listing.best})`], ...listing.tracks.map((name) => [name, name === "raw" ? "raw (as searched)" : name])];
  if (option.name === "camera") return [["", "all cameras"], ...listing.cameras.map((name) => [name, name])];
  if (option.name === "calibration") return [["", "usual"], ...(choices.calibrations[`.${form.name}`] ?? []).map((name) => [name, WORDS[name] ?? name])];
  return option.choices.map((value) => [value, value === "auto" ? `auto (${form[option.name]})` : WORDS[value] ?? value]);
}

/** One option's field; what it holds goes to `wish` where it is not the usual. */
function field(option, form) {
  const label = option.label[0].toUpperCase() + option.label.slice(1);
  const keep = (value) => { if (value === option.default || value === "") delete state.wish[option.name]; else state.wish[option.name] = value; };
  const asked = state.wish[option.name];
  if (option.kind === "bool") {
    const input = element("input", { type: "checkbox", checked: Boolean(asked) });
    input.onchange = () => keep(input.checked);
    return element("label", { className: "check", title: option.help }, input, label);
  }
  if (option.kind === "str") {
    const input = element("select", { ariaLabel: label }, ...offered(option, form).map(([value, words]) => new Option(words, value, false, value === (asked ?? option.default))));
    input.onchange = () => keep(input.value);
    return element("label", { title: option.help }, label, input);
  }
  const input = element("input", { type: "number", ariaLabel: label, min: option.low, max: option.high, step: option.kind === "int" ? 1 : "any", value: asked ?? "", placeholder: EMPTY[option.name] ?? String(option.default) });
  input.onchange = () => keep(input.value === "" ? "" : Number(input.value));
  return element("label", { title: option.help }, option.unit ? `${label} (${option.unit})` : label, input);
}

function formatList() {
  const rows = choices.formats.map((form) => {
    const row = element("button", { type: "button", className: "format", title: form.opens }, element("b", { textContent: `.${form.name}` }), form.title);
    row.setAttribute("role", "radio");
    row.setAttribute("aria-checked", String(form.name === format));
    row.onclick = () => { format = form.name; localStorage.setItem("export-format", format); state.failed = null; draw(); panel.querySelector('[aria-checked="true"]').focus(); };
    return row;
  });
  const list = element("div", { className: "formats" }, ...rows);
  list.setAttribute("role", "radiogroup");
  list.setAttribute("aria-label", "Format");
  return list;
}

async function begin() {
  const form = choices.formats.find((one) => one.name === format);
  const options = Object.fromEntries(Object.entries(state.wish).filter(([name]) => form.takes.includes(name)));
  state.failed = null;
  try {
    state.going = await post(`${here()}/exports`, { format, options });
  } catch (error) { state.failed = error; }
  draw();
}

/** The line over the options: the button, or how far it is; and what went wrong. */
function actions() {
  const line = element("div", { className: "export-actions" });
  if (!state.going) {
    line.append(button("Export", begin, "primary"));
    if (state.failed) line.append(element("p", { className: "wrong", role: "alert" }, state.failed.message, element("span", { className: "hint", textContent: state.failed.hint ?? "" })));
    return line;
  }
  const { step, done, total, seconds_left: left } = state.going;
  const share = total ? Math.round((100 * done) / total) : 0;
  const bar = element("div", { className: "progress" }, element("i"));
  bar.firstChild.style.width = `${share}%`;
  const words = [step || "beginning", total > 1 ? `${share} %` : "", left > 2 ? `${duration(left)} left` : ""].filter(Boolean).join(" · ");
  line.append(bar, element("span", { className: "hint export-step", textContent: words, role: "status" }), button("Cancel", () => remove(`/api/exports/${state.going.identifier}`).catch(complain), "quiet small"));
  return line;
}

function optionsForm() {
  const form = choices.formats.find((one) => one.name === format);
  const fields = choices.options.filter((option) => form.takes.includes(option.name)).map((option) => field(option, form));
  return element("div", { className: "export-form" }, element("p", { className: "hint", textContent: form.opens }), form.takes.includes("track") && listing.note ? element("p", { className: "hint", textContent: listing.note }) : "", actions(), element("div", { className: "export-options" }, ...fields));
}

function fileLine(made) {
  const address = `${here()}/exports/${encodeURIComponent(made.file)}`;
  const link = element("a", { href: address, download: made.file, title: "Download" });
  link.innerHTML = DOWNLOAD;
  link.append(element("span", { textContent: made.file }));
  const facts = [megabytes(made.bytes), made.track && `track ${made.track}`, made.frames ? `${made.frames} frames` : "", made.checked].filter(Boolean).join(" · ");
  const drop = button("×", async () => { try { await remove(address); await refresh(); } catch (error) { complain(error); } }, "icon quiet");
  drop.setAttribute("aria-label", `Delete ${made.file}`);
  drop.title = "Delete this file (the run stays)";
  return element("li", {}, element("div", {}, link, element("p", { className: "facts", textContent: facts }), ...made.notes.map((note) => element("p", { className: "facts note", textContent: note })),
    made.stale && element("p", { className: "stale-file", textContent: `Old: ${made.stale}. Export it again.` })), drop);
}

function fileList() {
  if (!listing.exports.length) return element("div", { className: "export-files" }, element("p", { className: "empty", textContent: "No files yet. Each is read back and compared before it is offered here." }));
  return element("ul", { className: "export-files" }, ...listing.exports.map(fileLine));
}

function draw() {
  if (!get("run")) return panel.replaceChildren(element("p", { className: "empty", textContent: "Open a run to export it." }));
  if (!choices) return;
  if (!choices.formats.some((one) => one.name === format)) format = choices.formats[0].name;
  const at = panel.querySelector(".formats")?.scrollTop ?? 0;
  panel.replaceChildren(formatList(), optionsForm(), fileList());
  panel.querySelector(".formats").scrollTop = at;
}

async function refresh() {
  if (panel.hidden || !get("run")) return draw();
  const asked = here();
  try {
    choices ??= await fetchJson("/api/exports/choices");
    const told = await fetchJson(`${asked}/exports`);
    if (asked !== here()) return;
    listing = told;
    state.going = told.running[0] ?? null;
  } catch (error) { complain(error); }
  draw();
}

/** An export of this run got further, or ended. */
function hear(told) {
  if (!isHere(told)) return;
  if (isGoing(told)) {
    if (state.going && state.going.identifier !== told.identifier) return;
    state.going = told;
    panel.querySelector(".export-actions")?.replaceWith(actions());
    return;
  }
  state.going = null;
  if (told.state === "failed") state.failed = told;
  refresh();
}

/** Wire the panel. */
export function startExporting() {
  watch(["session", "run"], () => { state.going = state.failed = null; state.wish = {}; refresh(); });
  document.addEventListener("panel", refresh);
  onEvent("export", hear);
}
