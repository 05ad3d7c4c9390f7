// Views of a frame whose layers come with the events while it is searched: the same tables as the
// API's, made of these layers.

import { get } from "../state.js";

const table = (name, title, columns, rows) => ({
  name,
  title,
  columns: columns.map((key) => ({ key, label: key.replaceAll("_", " "), unit: "" })),
  rows,
});

/** Variance: every parameter in every layer, and which layer settled it. */
function variance(layers, parameters) {
  const searchOf = (layer) => 1 + Math.floor(layer.layer / (layer.search_layers || Infinity));
  const rows = parameters.flatMap(({ name, limb, unit }, at) =>
    layers.map((layer) => [
      name,
      limb,
      unit,
      searchOf(layer),
      layer.layer,
      layer.variance_weighed[at],
      layer.variance_resampled[at],
      layer.variance_diffused[at],
    ]),
  );
  const settled = parameters.map(({ name, limb, unit }, at) => {
    const factor = ({ variance_weighed: weighed, variance_resampled: resampled }) =>
      resampled[at] > 0 ? weighed[at] / resampled[at] : 1;
    const most = layers.reduce((best, layer) => (factor(layer) > factor(best) ? layer : best));
    const first = layers[0].variance_weighed[at];
    const last = layers.at(-1).variance_resampled[at];
    return [name, limb, unit, most.layer, first, last, last > 0 ? first / last : null];
  });
  return [
    table(
      "layers",
      "Variance of every parameter in every layer",
      ["parameter", "limb", "unit", "search", "layer", "weighed", "before", "after"],
      rows,
    ),
    table(
      "settled",
      "Layer that settled each parameter",
      ["parameter", "limb", "unit", "layer", "first", "last", "reduction"],
      settled,
    ),
  ];
}

/** Schedule: exponent and survival of every layer. */
const schedule = (layers) => [
  table(
    "layers",
    "Exponent and survival of every layer",
    [
      "layer",
      "beta",
      "alpha_wanted",
      "alpha_reached",
      "effective",
      "particles",
      "best_log_weight",
      "milliseconds",
      "temper",
      "acceptance",
      "log_evidence",
      "alarm",
    ],
    layers.map((layer) => [
      layer.layer,
      layer.beta,
      layer.alpha_wanted,
      layer.alpha_reached,
      layer.effective_share === null ? null : layer.effective_share * layer.particles,
      layer.particles,
      layer.best_log_weight,
      layer.milliseconds,
      layer.temper,
      layer.acceptance,
      layer.log_evidence,
      "",
    ]),
  ),
];

const LIVE = { variance, schedule };

/** A view of the frame in progress; null for those that need its stored result. */
export function liveView(name) {
  const detail = get("detail");
  const isShown = detail?.layers.length && detail.frame === get("frame");
  if (!LIVE[name] || !isShown || !get("parameters")) return null;
  const state = detail.finished ? "" : ` in progress, ${detail.layers.length} layers`;
  const frame = `Session ${get("session")}, run ${get("run")}, frame ${detail.frame}${state}`;
  return {
    caption: `${frame}: ${get("summary")?.describe ?? ""}.`,
    notes: [],
    tables: LIVE[name](detail.layers, get("parameters")),
    search_layers: detail.search_layers,
    searches: detail.searches,
  };
}

/**
 * A view of the trial that is shown, of the layers that came so far; null for those that the studio
 * has to make.
 */
export function triedView(name) {
  const layers = get("whatIf");
  if (!LIVE[name] || !layers?.length || !get("parameters")) return null;
  return {
    caption: `frame ${layers[0].frame} tried again, ${layers.length} layers, not stored.`,
    notes: [],
    tables: LIVE[name](layers, get("parameters")),
    search_layers: layers[0].search_layers,
    searches: layers[0].searches,
  };
}
