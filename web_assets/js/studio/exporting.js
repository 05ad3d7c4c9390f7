// The run's export: format, options, progress, and the files to download. Without a run it says so.

import { fetchJson, post, remove, runPath } from "../api.js";
import { dotted } from "../elements.js";
import { findJob, isGoing, standing, timeLeft } from "../jobs.js";
import { onEvent } from "../live.js";
import { complain } from "../messages.js";
import { get, watch } from "../state.js";
import { follow, html, signal, useRef } from "./component.js";
import { Check, Failure, Select } from "./parts.js";

/** @import { Schemas } from "../api_types" */
/** @typedef {any} Option one of `ExportChoices.options` */

const WORDS = {
  auto: "auto",
  own: "the body's own",
  halpe26: "HALPE-26",
  mixamo: "Mixamo",
  opensim: "OpenSim",
  tpose: "T-pose",
  neutral: "neutral pose",
  gap: "become gaps",
  keep: "keep the held pose",
  y: "y",
  z: "z",
  pose2sim: "Pose2Sim",
  aniposelib: "anipose",
  opencv: "OpenCV",
};
/** What makes a better track, and its name. */
const MAKES = { refine: "refined", smooth: "smoothed" };
const EMPTY = { first: "first", last: "end", fps: "as tracked", height: "as recorded" };

const choices = signal(/** @type {Schemas["ExportChoices"] | null} */ (null));
/** The files of the run that is open, and what can be exported of it. */
const listing = signal(/** @type {Schemas["ExportList"] | null} */ (null));
const format = signal(localStorage.getItem("export-format") || "bvh");
/** The export that is being made. */
const going = signal(/** @type {any} */ (null));
/** The better track of this run that is being made. */
const making = signal(/** @type {any} */ (null));
/** What went wrong last. */
const failed = signal(/** @type {any} */ (null));
let changed = /** @type {Record<string, any>} */ ({}); // options that are not at their defaults

const megabytes = (bytes) =>
  bytes < 1e5 ? `${(bytes / 1e3).toFixed(1)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
const here = () => runPath(get("session"), get("run"));

/** Choose a format, from here or elsewhere on the page. */
export function chooseFormat(name) {
  localStorage.setItem("export-format", name);
  failed.value = null;
  format.value = name;
}

/** What a select offers for an option: [value, words]. @returns {[string, string][]} */
function offered(option, form, list, calibrations) {
  const own = (name) => [name, WORDS[name] ?? name];
  switch (option.name) {
    case "track":
      return [
        ["best", `best (${list.best})`],
        ...list.tracks.map((name) => [name, name === "raw" ? "raw (as searched)" : name]),
      ];
    case "camera":
      return [["", "all cameras"], ...list.cameras.map((name) => [name, name])];
    case "calibration":
      return [["", "usual"], ...(calibrations[`.${form.name}`] ?? []).map(own)];
    default:
      return option.choices.map((value) =>
        value === "auto" ? [value, `auto (${form[option.name]})`] : own(value),
      );
  }
}

/** One option's field; what it holds goes to `changed` where it is not the default. */
function OptionField({ option, form, list, calibrations }) {
  const label = option.label[0].toUpperCase() + option.label.slice(1);
  const keep = (value) => {
    if (value === option.default || value === "") delete changed[option.name];
    else changed[option.name] = value;
  };
  const chosen = changed[option.name];
  if (option.kind === "bool") {
    return html`<${Check} checked=${Boolean(chosen)} take=${keep} title=${option.help}>
      ${label}
    </${Check}>`;
  }
  if (option.kind === "str") {
    const usual = chosen ?? option.default;
    return html`<${Select}
      label=${label}
      title=${option.help}
      options=${offered(option, form, list, calibrations)}
      value=${usual}
      take=${keep}
    />`;
  }
  const keepNumber = ({ currentTarget: { value } }) => keep(value === "" ? "" : Number(value));
  return html`<label title=${option.help}>
    ${option.unit ? `${label} (${option.unit})` : label}
    <input
      type="number"
      aria-label=${label}
      min=${option.low}
      max=${option.high}
      step=${option.kind === "int" ? 1 : "any"}
      placeholder=${EMPTY[option.name] ?? String(option.default)}
      defaultValue=${chosen ?? ""}
      onChange=${keepNumber}
    />
  </label>`;
}

/** @param {{ formats: any[] }} properties */
const Formats = ({ formats }) => html`<div class="formats" role="radiogroup" aria-label="Format">
  ${formats.map(
    ({ name, title, opens }) =>
      html`<button
        key=${name}
        type="button"
        class="format"
        title=${opens}
        role="radio"
        aria-checked=${String(name === format.value)}
        onClick=${() => chooseFormat(name)}
      >
        <b>.${name}</b>${title}
      </button>`,
  )}
</div>`;

/** The line over the options: the button, or how far it is; and what went wrong. */
function Actions({ form }) {
  const isSent = useRef(false);
  const begin = async () => {
    if (isSent.current) return;
    isSent.current = true;
    failed.value = null;
    const options = Object.entries(changed).filter(([name]) => form.takes.includes(name));
    try {
      going.value = await post(`${here()}/exports`, {
        format: form.name,
        options: Object.fromEntries(options),
      });
    } catch (error) {
      failed.value = error;
    }
    isSent.current = false;
  };
  const job = going.value;
  if (!job) {
    return html`<div class="export-actions">
      <button type="button" class="primary" onClick=${begin}>Export</button>
      <${Failure} error=${failed.value} />
    </div>`;
  }
  const cancel = () => remove(`/api/exports/${job.identifier}`).catch(complain);
  const share = job.total ? job.done / job.total : 0;
  return html`<div class="export-actions">
    <div class="progress"><i style=${{ width: `${Math.round(100 * share)}%` }}></i></div>
    <span class="hint export-step" role="status">
      ${dotted(standing(job, "beginning"), timeLeft(job.seconds_left))}
    </span>
    <button type="button" class="quiet small" onClick=${cancel}>Cancel</button>
  </div>`;
}

/** What "best" does not hold yet. @param {{ list: Schemas["ExportList"] }} properties */
const Making = ({ list }) =>
  making.value &&
  html`<p class="notice" role="status">
    Track "${MAKES[making.value.verb]}" of this run is still being made
    (${dotted(standing(making.value, "beginning"), timeLeft(making.value.seconds_left))}). Until it
    is there, "best" is "${list.best}".
  </p>`;

/**
 * @param {{ form: any, known: Schemas["ExportChoices"], list: Schemas["ExportList"] }} properties
 */
const Options = ({ form, known, list }) => html`<div class="export-form">
  <p class="hint">${form.opens}</p>
  ${form.takes.includes("track") && list.note && html`<p class="hint">${list.note}</p>`}
  ${form.takes.includes("track") && html`<${Making} list=${list} />`}
  <${Actions} form=${form} />
  <div class="export-options" key=${form.name}>
    ${known.options
      .filter((option) => form.takes.includes(option.name))
      .map(
        (option) =>
          html`<${OptionField}
            key=${option.name}
            option=${option}
            form=${form}
            list=${list}
            calibrations=${known.calibrations}
          />`,
      )}
  </div>
</div>`;

function FileLine({ made }) {
  const { file, bytes, track, frames, checked, notes, stale } = made;
  /** @type {`/api/sessions/${string}/runs/${string}/exports/${string}`} */
  const address = `${here()}/exports/${encodeURIComponent(file)}`;
  const facts = [
    megabytes(bytes),
    track && `track ${track}`,
    frames && `${frames} frames`,
    checked,
  ];
  return html`<li>
    <div>
      <a href=${address} download=${file} title="Download">
        <svg viewBox="0 0 16 16">
          <path d="M7.2 2h1.6v6l2.1-2.1 1.1 1.1L8 11 4 7l1.1-1.1L7.2 8zM3 12.4h10V14H3z" />
        </svg>
        <span>${file}</span>
      </a>
      <p class="facts">${dotted(...facts)}</p>
      ${notes.map((note) => html`<p class="facts note" key=${note}>${note}</p>`)}
      ${stale && html`<p class="stale-file">Out of date: ${stale}. Export it again.</p>`}
    </div>
    <button
      type="button"
      class="icon quiet"
      aria-label=${`Delete ${file}`}
      title="Delete this file (the run stays)"
      onClick=${() => remove(address).then(refresh).catch(complain)}
    >
      ×
    </button>
  </li>`;
}

/** @param {{ files: any[] }} properties */
function Files({ files }) {
  if (!files.length) {
    return html`<div class="export-files">
      <p class="empty">No files yet. Each is read back and checked before it is listed here.</p>
    </div>`;
  }
  return html`<ul class="export-files">
    ${files.map((made) => html`<${FileLine} key=${made.file} made=${made} />`)}
  </ul>`;
}

/** The panel. */
export function Exporting() {
  const [known, list] = [choices.value, listing.value];
  if (!follow("run")) return html`<p class="empty">Open a run to export it.</p>`;
  if (!known || !list) return html`<p class="empty">Its files are listed…</p>`;
  const form = known.formats.find((one) => one.name === format.value) ?? known.formats[0];
  return html`
    <${Formats} formats=${known.formats} />
    <${Options} form=${form} known=${known} list=${list} />
    <${Files} files=${list.exports} />
  `;
}

/** Whether a job makes a better track. */
const isMaking = (job) => job?.verb in MAKES && isGoing(job);

async function refresh() {
  if (get("panel") !== "export" || !get("run")) return;
  const address = here();
  try {
    choices.value ??= await fetchJson("/api/exports/choices");
    const [session, run] = [get("session"), get("run")];
    const [found, made] = await Promise.all([
      fetchJson(`${address}/exports`),
      findJob({ session, kind: "track" }, (line) => line.run === run && isMaking(line)),
    ]);
    if (address !== here()) return;
    listing.value = found;
    making.value = isMaking(made) ? made : null;
    going.value = found.running[0] ?? null;
  } catch (error) {
    complain(error);
  }
}

/** An export of this run got further, or ended. */
function hear(job) {
  if (isGoing(job)) {
    if (!going.value || going.value.identifier === job.identifier) going.value = job;
    return;
  }
  going.value = null;
  if (job.state === "failed") failed.value = job;
  refresh();
}

/** Follow the run that is open. */
export function startExporting() {
  let shown = "";
  watch(["session", "run", "panel"], () => {
    const run = `${get("session")}/${get("run")}`;
    if (run !== shown) {
      shown = run;
      changed = {};
      listing.value = going.value = making.value = failed.value = null;
    }
    refresh();
  });
  onEvent("export", (job, isHere) => {
    if (isHere) hear(job);
  });
  onEvent("track", (job, isHere) => {
    if (!isHere || !(job.verb in MAKES)) return;
    if (isMaking(job)) making.value = job;
    else refresh();
  });
}
