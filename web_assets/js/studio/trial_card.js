// The card under the knobs: which knobs were moved, what the shown trial changes beside the stored
// result (or another trial), and the tray of all trials of the frame. Bars to the left are better,
// to the right worse, on scales that stay.

import { readOnly } from "../api.js";
import { figure } from "../chart_looks.js";
import { byId } from "../elements.js";
import { besideTrial, shownTrial } from "../selection.js";
import { follow, html, mount } from "./component.js";
import { keepAsNewRun, replaceStored } from "./keeping.js";
import { compareWith, discard, putBack, showTrial } from "./trials.js";
import { isSearching } from "../work_states.js";

/** @import { Schemas } from "../api_types" */

const LEAST_SCALE_MM = 50;
const DOUBLED = Math.log(2);
const SKETCH = 64;

/**
 * A quantity of both results. `share`: how much worse the tried one is, from -1 (better by a whole
 * bar) to 1. `isCost`: more of it is neither better nor worse.
 * @typedef {{ name: string, stored: any, tried: any, unit: string, share: number | null, isCost?:
 *   boolean }} Line
 */

/** @param {any} value */
const isNumber = (value) => typeof value === "number" && Number.isFinite(value);

/** @param {any} stored @param {any} tried @param {number} scale the change that fills a bar */
function worse(stored, tried, scale) {
  if (!isNumber(stored) || !isNumber(tried)) return null;
  return Math.max(-1, Math.min(1, (tried - stored) / scale));
}

/**
 * The same of a cost: a bar is filled by its double or half.
 * @param {any} stored
 * @param {any} tried
 */
function dearer(stored, tried) {
  if (!(stored > 0 && tried > 0)) return null;
  return worse(Math.log(stored), Math.log(tried), DOUBLED);
}

/**
 * What fills a bar of an error, mm: the run's largest error, so that it is the same for every
 * trial.
 */
function errorScale() {
  const frames = follow("summary")?.frames ?? [];
  const errors = frames.map((/** @type {any} */ line) => line.error_mm).filter(isNumber);
  return Math.max(LEAST_SCALE_MM, ...errors);
}

/**
 * The lines of the card: the whole, then the limbs in the body's order.
 * @param {Schemas["FrameNumbers"]} stored
 * @param {Schemas["FrameNumbers"]} tried
 * @param {boolean} inShares whether limbs are measured by shares of their area
 * @param {number} scale of errors, mm
 * @returns {Line[]}
 */
function linesOf(stored, tried, inShares, scale) {
  const error = {
    name: "error",
    stored: stored.error_mm,
    tried: tried.error_mm,
    unit: "mm",
    share: worse(stored.error_mm, tried.error_mm, scale),
  };
  const weight = {
    name: "log weight",
    stored: stored.log_weight,
    tried: tried.log_weight,
    unit: "",
    share: worse(tried.log_weight, stored.log_weight, Math.abs(stored.log_weight ?? 0) || 1),
  };
  /** @param {string} name @param {"evaluations" | "milliseconds"} key @param {string} unit */
  const cost = (name, key, unit) => ({
    name,
    stored: stored[key],
    tried: tried[key],
    unit,
    share: dearer(stored[key], tried[key]),
    isCost: true,
  });
  const limbs = Object.keys(stored.limbs).map((limb) => {
    const [before, after] = [stored.limbs[limb], tried.limbs[limb]];
    if (!inShares) {
      return {
        name: limb,
        stored: before,
        tried: after,
        unit: "mm",
        share: worse(before, after, scale),
      };
    }
    const percent = (/** @type {any} */ share) => (isNumber(share) ? 100 * share : null);
    return {
      name: limb,
      stored: percent(before),
      tried: percent(after),
      unit: "%",
      share: worse(before, after, 1),
    };
  });
  return [
    ...(isNumber(stored.error_mm) ? [error] : []),
    weight,
    cost("evaluations", "evaluations", ""),
    cost("time", "milliseconds", "ms"),
    ...limbs,
  ];
}

/**
 * A line: both values, and the change as a bar from the middle.
 * @param {{ line: Line }} properties
 */
function ChangeLine({ line }) {
  const { name, stored, tried, unit, share, isCost } = line;
  const [less, more] = isCost ? ["less", "more"] : ["better", "worse"];
  const kind = !share ? "same" : share < 0 ? less : more;
  const size = `${50 * Math.abs(share ?? 0)}%`;
  const style = kind === less ? { right: "50%", width: size } : { left: "50%", width: size };
  return html`<tr class=${`change ${kind}`}>
    <th scope="row">${name}</th>
    <td class="value">${figure(stored)}</td>
    <td class="value new">
      ${figure(tried)}${unit && html`<small> ${unit}</small>`}
    </td>
    <td class="change-bar">
      <i style=${style}></i><span class="hidden-words">${kind === "same" ? "as before" : kind}</span>
    </td>
  </tr>`;
}

/** @param {{ tried: Schemas["TrialView"], stored: Schemas["FrameNumbers"] }} properties */
function Changes({ tried, stored }) {
  const inShares = follow("trials").limbs_by === "share";
  const lines = linesOf(stored, tried, inShares, errorScale());
  return html`<table class="outcome" aria-label="Tried against stored">
    <thead>
      <tr>
        <th></th>
        <th class="stored" scope="col">${"name" in stored ? "other" : "stored"}</th>
        <th class="tried" scope="col">tried</th>
        <th class="ends">
          <span class="better">better</span><span class="worse">worse</span>
        </th>
      </tr>
    </thead>
    <tbody>
      ${lines.map((line) => html`<${ChangeLine} key=${line.name} line=${line} />`)}
    </tbody>
  </table>`;
}

/** @param {any} value */
function valueWords(value) {
  if (typeof value === "number") return figure(value);
  if (typeof value === "boolean") return value ? "yes" : "no";
  return String(value || "–");
}

/** @param {{ label: string, unit?: string, stored: any, tried: any }[]} moved */
export const movedWords = (moved) =>
  moved.length
    ? moved.map((knob) => `${knob.label} ${valueWords(knob.tried)}`).join(", ")
    : "the same knobs";

/** A body's limbs as lines in the scene's colours, the stored one in grey behind them. */
function Sketch(
  /** @type {{ sketch: number[][], behind: number[][] | null, sides: string[] }} */ {
    sketch,
    behind,
    sides,
  },
) {
  const ends = [...sketch, ...(behind ?? [])];
  const [across, up] = [
    ends.flatMap((one) => [one[0], one[2]]),
    ends.flatMap((one) => [one[1], one[3]]),
  ];
  const [left, right] = [Math.min(...across), Math.max(...across)];
  const [low, high] = [Math.min(...up), Math.max(...up)];
  const size = Math.max(right - left, high - low) || 1;
  const x = (/** @type {number} */ value) =>
    3 + ((SKETCH - 6) * (value - (left + right - size) / 2)) / size;
  const y = (/** @type {number} */ value) =>
    3 + ((SKETCH - 6) * ((low + high + size) / 2 - value)) / size;
  const lines = (/** @type {number[][]} */ limbs, /** @type {(at: number) => string} */ colour) =>
    limbs.map(
      ([x1, y1, x2, y2], at) =>
        html`<line x1=${x(x1)} y1=${y(y1)} x2=${x(x2)} y2=${y(y2)} stroke=${`var(--${colour(at)})`} />`,
    );
  return html`<svg viewBox=${`0 0 ${SKETCH} ${SKETCH}`} aria-hidden="true">
    ${behind && html`<g class="behind">${lines(behind, () => "ghost")}</g>`}
    <g>${lines(sketch, (at) => `limb-${sides[at]}`)}</g>
  </svg>`;
}

/** One of the tray: a click shows it, its second button compares what is shown with it. */
function Tile(
  /** @type {{ name: string | null, words: string, numbers: Schemas["FrameNumbers"], list: Schemas["TrialList"] }} */ {
    name,
    words,
    numbers,
    list,
  },
) {
  const [shown, against] = [follow("trial"), follow("against")];
  const isShown = name !== null && name === shown;
  const isBeside = Boolean(shown) && name === against;
  const { stored, sides } = list;
  const error = numbers.error_mm;
  const change = worse(stored.error_mm, error, 1);
  const kind = name === null || !change ? "" : change < 0 ? "better" : "worse";
  return html`<li class=${`tile ${isShown ? "shown" : ""} ${isBeside ? "beside" : ""}`}>
    <button
      class="tile-body"
      aria-pressed=${String(isShown)}
      onClick=${() => (name === null ? discard() : showTrial(name))}
      title=${name === null ? "Show what is stored" : `Show this trial: ${words}`}
    >
      <${Sketch} sketch=${numbers.sketch} behind=${name === null ? null : stored.sketch} sides=${sides} />
      <span class="tile-words">${words}</span>
      <span class=${`tile-error ${kind}`}>${isNumber(error) ? `${figure(error)} mm` : figure(numbers.log_weight)}</span>
    </button>
    ${
      shown &&
      !isShown &&
      html`<button
        class="quiet small tile-compare"
        aria-pressed=${String(isBeside)}
        onClick=${() => compareWith(name)}
        title="Put the shown trial beside this one, in scene, charts and numbers"
      >
        ${isBeside ? "beside it" : "compare"}
      </button>`
    }
  </li>`;
}

function Tray() {
  const list = /** @type {Schemas["TrialList"] | null} */ (follow("trials"));
  if (!list?.trials.length) return null;
  return html`<ul class="tray" aria-label="Trials of this frame">
    <${Tile} key="stored" name=${null} words="stored" numbers=${list.stored} list=${list} />
    ${list.trials.map(
      (one) =>
        html`<${Tile} key=${one.name} name=${one.name} words=${movedWords(one.moved)} numbers=${one} list=${list} />`,
    )}
  </ul>`;
}

/**
 * What becomes of the shown trial.
 * @param {{ frame: number, tried: Schemas["TrialView"] | null }} properties
 */
function Keeping({ frame, tried }) {
  // The process has the newest trial's knobs: that one can take the stored frame's place.
  const list = /** @type {Schemas["TrialList"] | null} */ (follow("trials"));
  const isNewest = !tried || list?.trials.at(-1)?.name === tried.name;
  const settings = Object.fromEntries((tried?.moved ?? []).map((knob) => [knob.name, knob.tried]));
  return html`<div class="keeping">
    <button
      class="primary small"
      onClick=${() => keepAsNewRun(frame, settings)}
      title="The frames before this one, then this result and all after it with these knobs, as a run of its own"
    >
      Keep as a new run
    </button>
    ${
      isNewest &&
      html`<button
        class="small"
        onClick=${() => replaceStored(frame)}
        title="This result takes the place of the stored one; the frames after it go"
      >
        Replace…
      </button>`
    }
    <button class="quiet small" onClick=${discard}>Discard</button>
  </div>`;
}

/** The knobs that were moved and that no stored frame uses, with a way back. */
function Moved(/** @type {{ moved: any[] }} */ { moved }) {
  const back = html`<button
    class="quiet small"
    onClick=${putBack}
    title="The knobs go back to the run's own; otherwise the search goes on with them, also after a reload"
  >
    Put back
  </button>`;
  return html`<div class="moved-line">
    <ul class="moved-knobs" aria-label="Knobs that were moved, used by no stored frame">
      ${moved.map(
        ({ label, before, after }) =>
          html`<li key=${label}>${label} <b>${valueWords(before)} → ${valueWords(after)}</b></li>`,
      )}
    </ul>
    ${!readOnly && back}
  </div>`;
}

/** The card, or nothing while nothing was moved and no trial is shown. */
function TrialCard() {
  const frame = follow("whatIf")?.[0].frame;
  follow("trials");
  follow("trial");
  follow("against");
  const work = follow("work");
  const here = work?.session === follow("session") && work?.run === follow("run");
  // While the run is tracked its next layer takes what was moved.
  const isTracked = here && isSearching(work);
  const moved = isTracked ? [] : (follow("moved") ?? []);
  const isTried = frame !== undefined;
  const place = byId("trial");
  place.hidden = !isTried && !moved.length;
  document.body.classList.toggle("trying", !place.hidden);
  if (place.hidden) return null;
  const [tried, stored] = [shownTrial(), besideTrial()];
  const heading = isTried
    ? `Frame ${frame} tried again, not stored`
    : "Moved, used by no stored frame";
  return html`<header>
      <h2>${heading}</h2>
    </header>
    ${isTried && html`<${Keeping} frame=${frame} tried=${tried} />`}
    ${moved.length > 0 && html`<${Moved} moved=${moved} />`}
    ${isTried && tried && stored && html`<${Changes} tried=${tried} stored=${stored} />`}
    <${Tray} />`;
}

/** Put the card into the page. */
export function startTrialCard() {
  mount(byId("trial"), html`<${TrialCard} />`);
}
