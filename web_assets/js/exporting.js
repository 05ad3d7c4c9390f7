// The run's export: format, options, progress, and the files to download.

import { fetchJson, post, remove, runPath } from "./api.js";
import { bar, button, byId, check, dotted, element, failure, field, fill, hint, number, select } from "./elements.js";
import { isGoing, standing, timeLeft } from "./jobs.js";
import { onEvent } from "./live.js";
import { complain } from "./messages.js";
import { get, watch } from "./state.js";

/** @import { Schemas } from "./api_types" */

const panel = byId("panel-export");
const WORDS = {
  auto: "auto", own: "the body's own", halpe26: "HALPE-26", mixamo: "Mixamo", opensim: "OpenSim", tpose: "T-pose", neutral: "neutral pose",
  gap: "become gaps", keep: "keep the held pose", y: "y", z: "z", pose2sim: "Pose2Sim", aniposelib: "anipose", opencv: "OpenCV",
};
const EMPTY = { first: "first", last: "end", fps: "as tracked", height: "as recorded" };
const DOWNLOAD = '<svg viewBox="0 0 16 16"><path d="M7.2 2h1.6v6l2.1-2.1 1.1 1.1L8 11 4 7l1.1-1.1L7.2 8zM3 12.4h10V14H3z"/></svg>';

/** @type {Schemas["ExportChoices"]} */
let choices = null;
/** @type {Schemas["ExportList"]} */
let listing = null;
let format = localStorage.getItem("export-format") || "bvh";
let changed = {};         // options that are not at their defaults
let going = null;      // the export that is being made
let failed = null;     // what went wrong last

const megabytes = (bytes) => (bytes < 1e5 ? `${(bytes / 1e3).toFixed(1)} kB` : `${(bytes / 1e6).toFixed(1)} MB`);
const here = () => runPath(get("session"), get("run"));

/** What a select offers for an option: [value, words]. @returns {[string, string][]} */
function offered(option, form) {
  if (option.name === "track") return [["best", `best (${listing.best})`], ...listing.tracks.map((name) => /** @type {[string, string]} */ ([name, name === "raw" ? "raw (as searched)" : name]))];
  if (option.name === "camera") return [["", "all cameras"], ...listing.cameras.map((name) => /** @type {[string, string]} */ ([name, name]))];
  if (option.name === "calibration") return [["", "usual"], ...(choices.calibrations[`.${form.name}`] ?? []).map((name) => /** @type {[string, string]} */ ([name, WORDS[name] ?? name]))];
  return option.choices.map((value) => [value, value === "auto" ? `auto (${form[option.name]})` : WORDS[value] ?? value]);
}

/** One option's field; what it holds goes to `changed` where it is not the default. */
function optionField(option, form) {
  const label = option.label[0].toUpperCase() + option.label.slice(1);
  const keep = (value) => { if (value === option.default || value === "") delete changed[option.name]; else changed[option.name] = value; };
  const chosen = changed[option.name];
  if (option.kind === "bool") return check(label, { checked: Boolean(chosen), onchange: ({ target }) => keep(target.checked) }, option.help);
  if (option.kind === "str") return field(label, select(offered(option, form), chosen ?? option.default, { ariaLabel: label, onchange: ({ target }) => keep(target.value) }), { title: option.help });
  const made = number(chosen ?? "", {
    ariaLabel: label, min: option.low, max: option.high, step: option.kind === "int" ? 1 : "any", placeholder: EMPTY[option.name] ?? String(option.default),
    onchange: ({ target }) => keep(target.value === "" ? "" : Number(target.value)),
  });
  return field(option.unit ? `${label} (${option.unit})` : label, made, { title: option.help });
}

/** Choose a format, from here or elsewhere on the page. */
export function chooseFormat(name) {
  format = name;
  localStorage.setItem("export-format", format);
  failed = null;
  if (choices && listing) draw();
}

function formatList() {
  return element("div", { className: "formats", role: "radiogroup", ariaLabel: "Format" }, choices.formats.map((form) => element("button", {
    type: "button", className: "format", title: form.opens, role: "radio", ariaChecked: String(form.name === format), dataset: { key: form.name }, onclick: () => chooseFormat(form.name),
  }, element("b", {}, `.${form.name}`), form.title)));
}

async function begin() {
  const { takes } = choices.formats.find((one) => one.name === format);
  failed = null;
  try {
    going = await post(`${here()}/exports`, { format, options: Object.fromEntries(Object.entries(changed).filter(([name]) => takes.includes(name))) });
  } catch (error) { failed = error; }
  draw();
}

/** The line over the options: the button, or how far it is; and what went wrong. */
function exportActions() {
  const line = (...children) => element("div", { className: "export-actions" }, ...children);
  if (!going) return line(button("Export", begin, "primary"), failure(failed));
  return line(bar(going.total ? going.done / going.total : 0), element("span", { className: "hint export-step", role: "status" }, dotted(standing(going, "beginning"), timeLeft(going.seconds_left))),
    button("Cancel", () => remove(`/api/exports/${going.identifier}`).catch(complain), "quiet small"));
}

function optionsForm() {
  const form = choices.formats.find((one) => one.name === format);
  return element("div", { className: "export-form" }, hint(form.opens), form.takes.includes("track") && listing.note && hint(listing.note), exportActions(),
    element("div", { className: "export-options" }, choices.options.filter((option) => form.takes.includes(option.name)).map((option) => optionField(option, form))));
}

function fileLine(made) {
  const address = `${here()}/exports/${encodeURIComponent(made.file)}`;
  const link = element("a", { href: address, download: made.file, title: "Download", innerHTML: DOWNLOAD }, element("span", {}, made.file));
  const drop = button("×", () => remove(address).then(refresh).catch(complain), "icon quiet", { ariaLabel: `Delete ${made.file}`, title: "Delete this file (the run stays)" });
  const facts = (className, words) => element("p", { className }, words);
  return element("li", {}, element("div", {}, link, facts("facts", dotted(megabytes(made.bytes), made.track && `track ${made.track}`, made.frames && `${made.frames} frames`, made.checked)),
    made.notes.map((note) => facts("facts note", note)), made.stale && facts("stale-file", `Out of date: ${made.stale}. Export it again.`)), drop);
}

function fileList() {
  if (!listing.exports.length) return element("div", { className: "export-files" }, element("p", { className: "empty" }, "No files yet. Each is read back and checked before it is listed here."));
  return element("ul", { className: "export-files" }, listing.exports.map(fileLine));
}

function draw() {
  if (!get("run")) return fill(panel, element("p", { className: "empty" }, "Open a run to export it."));
  if (!choices || !listing) return;
  if (!choices.formats.some((one) => one.name === format)) format = choices.formats[0].name;
  const scrolled = panel.querySelector(".formats")?.scrollTop ?? 0;
  fill(panel, formatList(), optionsForm(), fileList());
  panel.querySelector(".formats").scrollTop = scrolled;
}

async function refresh() {
  if (panel.hidden || !get("run")) return draw();
  const address = here();
  try {
    choices ??= await fetchJson("/api/exports/choices");
    const found = await fetchJson(`${address}/exports`);
    if (address !== here()) return;
    listing = found;
    going = found.running[0] ?? null;
  } catch (error) { complain(error); }
  draw();
}

/** An export of this run got further, or ended. */
function hear(job) {
  if (isGoing(job)) {
    if (going && going.identifier !== job.identifier) return;
    going = job;
    panel.querySelector(".export-actions")?.replaceWith(exportActions());
    return;
  }
  going = null;
  if (job.state === "failed") failed = job;
  refresh();
}

/** Wire the panel. */
export function startExporting() {
  watch(["session", "run"], () => { going = failed = null; changed = {}; refresh(); });
  document.addEventListener("panel", refresh);
  onEvent("export", (job, isHere) => { if (isHere) hear(job); });
}
