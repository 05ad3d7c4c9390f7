// The layers of the shown frame, whatever they are of: a stored frame, one that is searched, one
// annealed again.
//
// A run's first frame is searched several times over: its layers are counted through, and each
// search has a name.

import { get } from "../state.js";

const ORDINALS = ["first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth"];
/** How many tiles are reserved while nothing is known of the run. */
const USUAL = 10;

/**
 * What is known of the shown frame's layers.
 * @typedef {{ layers: any[], count: number, searchLayers: number, searches: number, isTrial:
 *   boolean }} ShownLayers
 */

/**
 * The layers that there are and those that are to come.
 * @param {any[] | null} whatIf of a frame annealed again
 * @param {any} detail of a stored or searched frame
 * @param {number | null} usual layers of a frame with the settings in use
 * @returns {ShownLayers}
 */
export function layersOf(whatIf, detail, usual) {
  const layers = whatIf ?? detail?.layers ?? [];
  const { search_layers: own, searches = 1 } = (whatIf ? whatIf[0] : detail) ?? {};
  const searchLayers = own || usual || layers.length || USUAL;
  const count = Math.max(searchLayers * searches, layers.length);
  return { layers, count, searchLayers, searches, isTrial: whatIf !== null };
}

/** The layers of the frame that is shown now. */
export const shownLayers = () => layersOf(get("whatIf"), get("detail"), get("layerCount"));

/** Which search of a frame, by its number from 0: "first search". */
export const searchName = (search) => `${ORDINALS[search] ?? `${search + 1}th`} search`;

/**
 * A layer in words: "layer 4 of 10", and which search it belongs to where a frame has several.
 * @param {number} layer counted through
 * @param {{ searchLayers: number, searches: number }} counted
 */
export function layerWords(layer, { searchLayers, searches }) {
  const within = `layer ${(layer % searchLayers) + 1} of ${searchLayers}`;
  return searches > 1 ? `${within}, ${searchName(Math.floor(layer / searchLayers))}` : within;
}

/**
 * A chosen layer that is not among those of the shown frame, in words: it is still to come, or what
 * was tried has fewer than the stored frame beside it.
 * @param {number} layer counted through
 * @param {ShownLayers} shown
 */
export function missingLayerWords(layer, shown) {
  if (layer < shown.count) return [layerWords(layer, shown), "still to come"];
  const stored = layersOf(null, get("detail"), null);
  const tried = shown.searches > 1 ? `${shown.searchLayers} a search` : `${shown.layers.length}`;
  return [layerWords(layer, stored), `stored only; tried: ${tried}`];
}

/**
 * How many particles a layer's weights leave: those that survive it (Eq. 12), null where there are
 * no weights.
 */
export function survivorsOf({ alpha_reached: share, effective_share: effective, particles }) {
  const left = share ?? effective;
  return left === null || left === undefined ? null : Math.round(left * particles);
}

/**
 * How much of the first layer's variance a layer still has: the mean over the parameters of its
 * orders of magnitude.
 */
export function varianceShare(first, layer) {
  const ratios = first.variance_weighed
    .map((before, at) => layer.variance_weighed[at] / before)
    .filter((ratio) => ratio > 0 && Number.isFinite(ratio));
  if (!ratios.length) return null;
  return Math.exp(ratios.reduce((sum, ratio) => sum + Math.log(ratio), 0) / ratios.length);
}
