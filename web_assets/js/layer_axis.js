// Layers on the axes of the views: counted within their search, whose name stands beside them where
// a frame has several (a run's first frame has).

import { layerWords, searchName } from "./studio/shown_layers.js";
import { categories } from "./view_sheet.js";

/**
 * How a frame's layers are counted.
 * @typedef {{ searchLayers: number, searches: number }} Counted
 */

/** How the layers of an answer are counted: an answer for a frame says it. @returns {Counted} */
export const countedIn = (/** @type {any} */ answer, /** @type {number} */ usual) => ({
  searchLayers: answer?.search_layers || usual,
  searches: answer?.searches || 1,
});

/** A layer's number in its search, from 1, as on its tile. */
export const layerNumber = (layer, /** @type {Counted} */ { searchLayers }) =>
  String((layer % searchLayers) + 1);

/** A layer in words: "layer 4", and which search it is of where the frame has several. */
export const layerInSearch = (layer, /** @type {Counted} */ at) =>
  `layer ${layerNumber(layer, at)}${at.searches > 1 ? ` of the ${searchName(Math.floor(layer / at.searchLayers))}` : ""}`;

/**
 * A layer in words, with how many there are: "layer 4 of 10". Beside a trial, which may have more or
 * fewer layers than what is stored, without: "layer 4".
 * @param {number} layer
 * @param {Counted & { tried?: any }} at
 */
export const layerOfSides = (layer, at) =>
  at.tried ? layerInSearch(layer, at) : layerWords(layer, at);

/**
 * An axis of layers. A value is a layer's number, counted through from 1 (`layerValue`); beside the
 * numbers the sheet writes the names of the searches.
 * @param {number[]} layers counted through from 0
 * @param {Counted} at
 */
export function layerAxis(layers, at, /** @type {Record<string, any>} */ more = {}) {
  const { axisLabel = {}, ...rest } = more;
  const named = at.searches > 1;
  return categories(layers.map(layerValue), named || more.position === "top" ? "" : "layer", {
    axisLabel: { formatter: (value) => layerNumber(Number(value) - 1, at), ...axisLabel },
    ...(named ? { groups: searchesOf(layers, at) } : {}),
    ...rest,
  });
}

/** What a layer is called on its axis. */
export const layerValue = (layer) => String(layer + 1);

/** The searches on an axis, each with its first and last place there. */
function searchesOf(layers, { searchLayers }) {
  /** @type {{ name: string, short: string, first: number, last: number }[]} */
  const groups = [];
  layers.forEach((layer, place) => {
    const search = Math.floor(layer / searchLayers);
    const name = searchName(search);
    const group = groups.find((one) => one.name === name);
    if (group) group.last = place;
    else groups.push({ name, short: name.split(" ")[0], first: place, last: place });
  });
  return groups;
}

/**
 * The answers for what is stored and what was tried with their layers on one axis, search beside
 * search: where one has more layers in a search than the other, those after it move on.
 * @param {any} stored tables by name, and how their layers are counted
 * @param {any} tried null for nothing
 * @returns {{ stored: any, tried: any, counted: Counted, there: (layer: number | null) => number |
 *   null, back: (layer: number) => number }} there, back: a layer of the shown frame (what was
 *   tried, if anything) on that axis, and back; of a place that its search does not reach the
 *   search's last layer
 */
export function onOneAxis(stored, tried) {
  const sides = [stored, ...(tried ? [tried] : [])];
  const searchLayers = Math.max(...sides.map((one) => one.counted.searchLayers));
  const searches = Math.max(...sides.map((one) => one.counted.searches));
  const own = (tried ?? stored).counted.searchLayers;
  // Of a single search a layer stays where it is, also one that only the longer side has.
  const moved = (layer, from) =>
    Number.isInteger(layer) && searches > 1
      ? Math.floor(layer / from) * searchLayers + (layer % from)
      : layer;
  const put = ({ tables, counted: { searchLayers: from } }) =>
    from === searchLayers
      ? tables
      : Object.fromEntries(
          Object.entries(tables).map(([name, rows]) => [
            name,
            rows.map((row) => ("layer" in row ? { ...row, layer: moved(row.layer, from) } : row)),
          ]),
        );
  return {
    stored: put(stored),
    tried: tried && put(tried),
    counted: { searchLayers, searches },
    there: (layer) => moved(layer, own),
    back: (layer) =>
      Math.floor(layer / searchLayers) * own + Math.min(layer % searchLayers, own - 1),
  };
}
