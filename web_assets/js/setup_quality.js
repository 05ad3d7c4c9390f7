// How far the views' masks agree in the hull: a bar a camera with words, and the camera to look at
// first.

import { sessionPath } from "./api.js";
import { Findings } from "./calibration_drawing.js";
import { percent } from "./elements.js";
import { html } from "./studio/component.js";
import { Action } from "./studio/parts.js";

/** @import { Schemas } from "./api_types" */
/** @typedef {Schemas["MaskQuality"]} Quality */
/** @typedef {Quality["cameras"][number]} Line */

const USABLE = 0.9;

/**
 * A camera's agreement in per cent, so fine that what is below the mark never reads like the mark.
 * @param {Line} line
 */
export const agreementOf = ({ agreement, usable }) =>
  usable || agreement === null
    ? percent(agreement)
    : `${(Math.floor(1000 * agreement) / 10).toFixed(1)} %`;

/** @param {{ line: Line }} properties */
function AgreementBar({ line }) {
  const share = line.agreement ?? 0;
  const kind = line.usable ? "good" : share >= 0.8 ? "warn" : "bad";
  return html`<div
    class=${`agree-bar ${kind}`}
    role="meter"
    title=${`In the hull: ${percent(line.covered)} of the mask. In the mask: ${percent(line.inside)} of the hull.`}
    aria-valuenow=${share}
    aria-valuemin="0"
    aria-valuemax="1"
    aria-label=${`Agreement of ${line.camera}`}
  >
    <i style=${{ width: `${Math.round(100 * share)}%` }}></i>
    <b style=${{ left: `${100 * USABLE}%` }}></b>
  </div>`;
}

/**
 * What is said of a quality (`GET S/masks/quality`), null where it was not measured since the
 * studio was opened (then what is known in words, `measured`, is said); `paint(camera)` opens the
 * brush; `source`: of the masks.
 * @param {{ setup: import("./setup.js").Setup, quality: Quality | null, measured: string,
 *   source: string, paint: (camera: string) => void }} properties
 */
export function QualityList({ setup, quality, measured, source, paint }) {
  if (!quality)
    return html`<p class="hint">
      ${
        measured
          ? `When it was last measured, ${measured}. Measure again to see every camera.`
          : "Not measured yet. No ground truth is needed: the masks of all views must agree in the visual hull."
      }
    </p>`;
  const worst = quality.cameras.find((line) => line.camera === quality.worst);
  const isDoubted = quality.doubts.length > 0;
  return html`
    <ul class="agree">
      ${quality.cameras.map(
        (line) => html`<li key=${line.camera}>
          <span>${line.camera}</span><${AgreementBar} line=${line} />
          <span class="figure">${agreementOf(line)}</span>
          ${line.note && html`<p class="hint">${line.note}</p>`}
        </li>`,
      )}
    </ul>
    ${
      worst
        ? html`<div class="notice">
            <p>${remedy(worst, source)}</p>
            <${Action} kind="small" act=${() => paint(worst.camera)}>
              ${`Exclude regions of ${worst.camera}…`}
            </${Action}>
          </div>`
        : !isDoubted &&
          !quality.unconfirmed &&
          html`<p class="hint">
            Every view agrees with the others; ${quality.frames.length} frames were compared.
          </p>`
    }
    ${
      isDoubted &&
      html`<div>
        <p class="notice">The silhouettes contradict the calibration:</p>
        <${Findings} findings=${quality.doubts} />
      </div>`
    }
    <${Unconfirmed} setup=${setup} quality=${quality} />
  `;
}

const sentence = (/** @type {string} */ words) => `${words[0].toUpperCase()}${words.slice(1)}.`;

/**
 * Why agreement does not prove the masks, what may help, and where, camera by camera; nothing where
 * something else does.
 * @param {{ setup: import("./setup.js").Setup, quality: Quality }} properties
 */
function Unconfirmed({ setup, quality: { contrast, unconfirmed: why } }) {
  if (!contrast?.low)
    return (
      why && html`<p class="notice">The views agree, but ${why}: look at the masks yourself.</p>`
    );
  return html`<section class="alike">
    <p class="notice">${sentence(contrast.words)} ${contrast.remedy}</p>
    <div class="alike-pictures">
      ${contrast.views
        .filter((view) => view.outlines.length)
        .map((view) => html`<${AlikePicture} key=${view.camera} setup=${setup} view=${view} />`)}
    </div>
  </section>`;
}

/**
 * A camera's picture with what might as well be background outlined.
 * @param {{ setup: import("./setup.js").Setup, view: Schemas["ViewContrast"] }} properties
 */
function AlikePicture({ setup, view }) {
  const lens = setup.detail.cameras.find((one) => one.name === view.camera);
  const words = `${view.camera}, frame ${view.frame}: ${percent(view.share)} like the background`;
  const file = `${encodeURIComponent(view.camera)}/${view.frame}.jpg`;
  const source = `${sessionPath(setup.session)}/footage/${file}?height=420`;
  return html`<figure>
    <div>
      <img src=${source} alt=${words} />
      ${
        lens &&
        html`<svg viewBox=${`0 0 ${lens.width} ${lens.height}`} aria-hidden="true">
          ${view.outlines.map(
            (outline) =>
              html`<polygon points=${outline.map((point) => point.join(",")).join(" ")} />`,
          )}
        </svg>`
      }
    </div>
    <figcaption>${words}</figcaption>
  </figure>`;
}

/**
 * How the sources compare (job `choice`): agreement and edges by camera, the used ones marked.
 * @param {{ choice: Schemas["SourceChoice"] }} properties
 */
export function SourceTable({ choice }) {
  const cameras = Object.keys(choice.by_camera);
  const isMixed = new Set(Object.values(choice.by_camera)).size > 1;
  const row = (/** @type {Schemas["SourceTried"]} */ line, /** @type {string} */ name) =>
    html`<tr key=${name}>
      <th scope="row">${name}</th>
      ${cameras.map(
        (camera) => html`<td
          class=${choice.by_camera[camera] === line.source ? "figure used" : "figure"}
          title=${
            `Agreement of the views ${percent(line.agreements[camera])}, ` +
            `edge along the border ${percent(line.borders[camera])}`
          }
        >
          ${percent(line.agreements[camera])} · ${percent(line.borders[camera])}
        </td>`,
      )}
      <td class="figure" title=${line.note}>${percent(line.worst)}</td>
    </tr>`;
  return html`<table class="plain source-table">
    <caption>
      Agreement of the views · edge along the masks' border, by source; the used ones stand out. The
      score is the least product of the two
    </caption>
    <thead>
      <tr>
        ${["Source", ...cameras, "Score"].map((words) => html`<th scope="col">${words}</th>`)}
      </tr>
    </thead>
    <tbody>
      ${choice.tried.map((line) => row(line, line.source))}
      ${isMixed && row(choice.mixed, "together")}
    </tbody>
  </table>`;
}

/** What puts masks right that have no knobs, or that each camera has from another source. */
const BY_HAND = {
  strokes: "Paint strokes in the first frame in which its mask is wrong.",
  person: "Paint strokes, or give a picture of its empty room.",
  best: "Paint strokes for it, and try again.",
};

/** @param {Line} line @param {string} source */
function remedy(line, source) {
  const below =
    line.agreement !== null && line.agreement < USABLE
      ? ` It agrees with the other views by ${agreementOf(line)}; ${percent(USABLE)} is the mark.`
      : "";
  const first = `Check ${line.camera} first.${below}`;
  if (BY_HAND[source]) return `${first} ${BY_HAND[source]}`;
  if (line.agreement === null)
    return `${first} Its mask is empty: lower “mask threshold”, or give a picture without the subject.`;
  if ((line.denied ?? 0) > 0.05)
    return (
      `${first} Its mask has holes that carve the subject in all views: lower “mask threshold”, ` +
      "or switch “shadow test” off."
    );
  if (line.covered !== null && line.covered < USABLE)
    return (
      `${first} It holds something that no other view has: a bystander, a reflection, a shadow. ` +
      "Exclude the region, or raise “mask threshold”."
    );
  return `${first} It lacks parts of the subject: lower “mask threshold”, or raise “close gaps”.`;
}
