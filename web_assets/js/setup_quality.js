// How far the views' masks agree in the hull: a bar a camera with words, and the camera to look at
// first.

import { sessionPath } from "./api.js";
import { findingList } from "./calibration_drawing.js";
import { button, element, hint, notice, percent, shape } from "./elements.js";

/** @import { Schemas } from "./api_types" */

const USABLE = 0.9;

/**
 * A camera's agreement in per cent, so fine that what is below the mark never reads like the mark.
 */
export const agreementOf = ({ agreement, usable }) =>
  usable || agreement === null
    ? percent(agreement)
    : `${(Math.floor(1000 * agreement) / 10).toFixed(1)} %`;

function agreementBar(line) {
  const kind = line.usable
    ? "good"
    : line.agreement !== null && line.agreement >= 0.8
      ? "warn"
      : "bad";
  return element(
    "div",
    {
      className: `agree-bar ${kind}`,
      role: "meter",
      title: `In the hull: ${percent(line.covered)} of the mask. In the mask: ${percent(line.inside)} of the hull.`,
      ariaValueNow: line.agreement ?? 0,
      ariaValueMin: 0,
      ariaValueMax: 1,
      ariaLabel: `Agreement of ${line.camera}`,
    },
    element("i", { style: `width: ${Math.round(100 * (line.agreement ?? 0))}%` }),
    element("b", { style: `left: ${100 * USABLE}%` }),
  );
}

/** What is said of a quality (`GET S/masks/quality`), null where it was not measured since the studio was opened (then what
 * is known in words, `measured`, is said); `paint(camera)` opens the brush; `source` : of the
 * masks.
 * @param {import("./setup.js").Setup} setup */
export function qualityList(setup, quality, paint, measured = "", source = "") {
  if (!quality && measured)
    return [hint(`When it was last measured, ${measured}. Measure again to see every camera.`)];
  if (!quality)
    return [
      hint(
        "Not measured yet. No ground truth is needed: the masks of all views must agree in the visual hull.",
      ),
    ];
  const rows = quality.cameras.map((line) =>
    element(
      "li",
      {},
      element("span", {}, line.camera),
      agreementBar(line),
      element("span", { className: "figure" }, agreementOf(line)),
      line.note && hint(line.note),
    ),
  );
  const worst = quality.cameras.find((line) => line.camera === quality.worst);
  const doubts =
    quality.doubts.length > 0 &&
    element(
      "div",
      {},
      notice("The silhouettes contradict the calibration:"),
      findingList({ findings: quality.doubts }),
    );
  const verdict = worst
    ? element(
        "div",
        { className: "notice" },
        element("p", {}, remedy(worst, source)),
        button(`Exclude regions of ${worst.camera}…`, () => paint(worst.camera), "small"),
      )
    : !doubts &&
      !quality.unconfirmed &&
      hint(`Every view agrees with the others; ${quality.frames.length} frames were compared.`);
  return [
    element("ul", { className: "agree" }, rows),
    verdict,
    doubts,
    unconfirmed(setup, quality),
  ];
}

const sentence = (words) => `${words[0].toUpperCase()}${words.slice(1)}.`;

/**
 * Why agreement does not prove the masks, what may help, and where, camera by camera; nothing where
 * something else does.
 */
function unconfirmed(setup, { contrast, unconfirmed: why }) {
  if (!contrast?.low)
    return why && notice(`The views agree, but ${why}: look at the masks yourself.`);
  const seen = contrast.views.filter((view) => view.outlines.length);
  return element(
    "section",
    { className: "alike" },
    notice(sentence(contrast.words), " ", contrast.remedy),
    element(
      "div",
      { className: "alike-pictures" },
      seen.map((view) => alikePicture(setup, view)),
    ),
  );
}

/**
 * A camera's picture with what might as well be background outlined.
 * @param {Schemas["ViewContrast"]} view
 */
function alikePicture(setup, view) {
  const lens = setup.detail.cameras.find((one) => one.name === view.camera);
  const lines = view.outlines.map((outline) =>
    shape("polygon", { points: outline.map((point) => point.join(",")).join(" ") }),
  );
  const words = `${view.camera}, frame ${view.frame}: ${percent(view.share)} like the background`;
  return element(
    "figure",
    {},
    element(
      "div",
      {},
      element("img", {
        src: `${sessionPath(setup.session)}/footage/${encodeURIComponent(view.camera)}/${view.frame}.jpg?height=420`,
        alt: words,
      }),
      shape(
        "svg",
        { viewBox: `0 0 ${lens.width} ${lens.height}`, "aria-hidden": "true" },
        ...lines,
      ),
    ),
    element("figcaption", {}, words),
  );
}

/**
 * How the sources compare (job `choice`): agreement and edges by camera, the used ones marked.
 * @param {Schemas["SourceChoiceAnswer"]} choice
 */
export function sourceTable(choice) {
  const cameras = Object.keys(choice.by_camera);
  const row = (line, name) =>
    element(
      "tr",
      {},
      element("th", { scope: "row" }, name),
      cameras.map((camera) =>
        element(
          "td",
          {
            className: choice.by_camera[camera] === line.source ? "figure used" : "figure",
            title: `Agreement of the views ${percent(line.agreements[camera])}, edge along the border ${percent(line.borders[camera])}`,
          },
          `${percent(line.agreements[camera])} · ${percent(line.borders[camera])}`,
        ),
      ),
      element("td", { className: "figure", title: line.note }, percent(line.worst)),
    );
  const mixed = new Set(Object.values(choice.by_camera)).size > 1;
  return element(
    "table",
    { className: "plain source-table" },
    element(
      "caption",
      {},
      "Agreement of the views · edge along the masks' border, by source; the used ones stand out. The score is the least product of the two",
    ),
    element(
      "thead",
      {},
      element(
        "tr",
        {},
        ["Source", ...cameras, "Score"].map((words) => element("th", { scope: "col" }, words)),
      ),
    ),
    element(
      "tbody",
      {},
      choice.tried.map((line) => row(line, line.source)),
      mixed && row(choice.mixed, "together"),
    ),
  );
}

/** Sources whose masks have no knobs, and what puts them right. */
const BY_HAND = {
  strokes: "Paint strokes in the first frame in which its mask is wrong.",
  person: "Paint strokes, or give a picture of its empty room.",
  best: "Paint strokes for it, and try again.",
};

function remedy(line, source) {
  const below =
    line.agreement !== null &&
    line.agreement < USABLE &&
    ` It agrees with the other views by ${agreementOf(line)}; ${percent(USABLE)} is the mark.`;
  const first = `Check ${line.camera} first.${below || ""}`;
  if (BY_HAND[source]) return `${first} ${BY_HAND[source]}`;
  if (line.agreement === null)
    return `${first} Its mask is empty: lower “mask threshold”, or give a picture of its empty room.`;
  if (line.denied > 0.05)
    return `${first} Its mask has holes that carve the subject in all views: lower “mask threshold”, or switch “shadow test” off.`;
  if (line.covered !== null && line.covered < USABLE)
    return `${first} It holds something that no other view has: a bystander, a reflection, a shadow. Exclude the region, or raise “mask threshold”.`;
  return `${first} It lacks parts of the subject: lower “mask threshold”, or raise “close gaps”.`;
}
