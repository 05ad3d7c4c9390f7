// Limbs over the frames, and how near the particles of each layer came: what the words on why a
// frame failed rest on.

import { figure as figureWords, token } from "./chart_looks.js";
import { layerAxis, layerInSearch } from "./layer_axis.js";
import { limbLook } from "./limb_looks.js";
import {
  byLayer,
  categories,
  distinct,
  grouped,
  KEY,
  layersOfAll,
  numbers,
  tipOf,
} from "./view_sheet.js";

const ROW = 17;

/** Why a limb counts as lost. */
const lostWords = ({ lost_by: by, error }, limit) =>
  error !== null && by.includes("truth")
    ? `lost by the ${by}: a marker is more than ${limit} off`
    : `lost by the ${by}`;

/** Limbs over the frames, and how near the particles of each layer came to the reference pose. */
export function drawLimbs(sheet, /** @type {any} */ { limbs: rows, scale, nearest }, at, room) {
  const frames = distinct(rows.map((row) => row.frame));
  const names = distinct(rows.map((row) => row.limb));
  const measured = rows.some((row) => row.error !== null);
  const key = measured ? "error" : "disagreement";
  const unitWords = measured
    ? "mean error"
    : "share of its area that silhouettes and body do not agree about";
  // The same colours in every frame, stored and tried, from the first frame of a run on.
  const { low, lost, high } = scale.find((row) => row.quantity === key);
  const inUnit = (value) =>
    measured ? `${figureWords(value)} mm` : `${figureWords(100 * value)} %`;
  const height = Math.max(names.length * ROW, room - 60);
  const [one, two] = sheet.columns(2, {
    height,
    least: [names.length * ROW, 0],
    gutters: [112, 84],
    shares: [1.7, 1],
    right: 18,
  });
  if (rows.length) {
    const plot = sheet.plot(
      { ...one, width: one.width - (one.isBelow ? 60 : 0) },
      {
        title: "Limbs over the frames",
        unit: `${unitWords}; lost ${measured ? `where a marker is ${inUnit(lost)} off` : `from ${inUnit(lost)}`}${at.tried ? "; ◤ stored, ◢ tried" : ""}`,
        x: categories(frames.map(String), "frame"),
        y: categories(names, "", {
          inverse: true,
          axisLabel: { interval: 0, width: 104, overflow: "truncate" },
        }),
      },
    );
    const rowOf = new Map(rows.map((row) => [`${row.frame}/${row.limb}`, row]));
    const cellsOf = (list) =>
      list.map((row) => [frames.indexOf(row.frame), names.indexOf(row.limb), row[key] ?? "-"]);
    sheet.splitHeat(plot, {
      cells: cellsOf(rows),
      tried: at.tried && cellsOf(at.tried.limbs),
      low,
      high,
      framed: false,
      ends: [`≥ ${inUnit(high)}`, inUnit(low)],
      key: KEY,
      click: ({ value }) => ({ frame: frames[value[0]], limb: names[value[1]] }),
      tip: ({ value }) => {
        const row = rowOf.get(`${frames[value[0]]}/${names[value[1]]}`);
        return tipOf(`${row.limb}, frame ${row.frame}`, [
          ["error", row.error === null ? "–" : `${figureWords(row.error)} mm`],
          [
            "disagreement with the silhouettes",
            row.disagreement === null ? "–" : `${figureWords(100 * row.disagreement)} %`,
          ],
          ["lost", row.lost ? `yes, by the ${row.lost_by}` : "no"],
        ]);
      },
    });
    sheet.chosen(plot, {
      column: frames.indexOf(at.frame) < 0 ? null : String(at.frame),
      row: at.limb && names.includes(at.limb) ? names.indexOf(at.limb) : null,
    });
  } else sheet.words("There are no numbers by limb of this run.", one);
  if (nearest.length) {
    const layers = layersOfAll(
      [{ tables: { nearest: [...nearest, ...(at.tried?.nearest ?? [])] } }],
      "nearest",
    );
    const own = [...grouped(nearest, "limb")];
    const shown =
      at.limb && own.some(([limb]) => limb === at.limb)
        ? own.filter(([limb]) => limb === at.limb)
        : own.filter(([, list]) => list.some((row) => row.nearest > row.reach)).slice(0, 5);
    const drawnOnes = shown.length ? shown : own.slice(0, 3);
    const plot = sheet.plot(two, {
      title: "Nearest particle",
      unit: "to the reference pose, mm; dashed: the layer's noise",
      names: drawnOnes.map(([limb]) => limb),
      x: layerAxis(layers, at),
      y: numbers("", { scale: false, min: 0 }),
    });
    const limbs = own.map(([limb]) => limb);
    drawnOnes.forEach(([limb, list]) => {
      const { colour, symbol } = limbLook(limb, limbs);
      const click = ({ dataIndex }) => ({ layer: dataIndex, limb });
      const rowAt = (layer) => list.find((row) => row.layer === layer);
      sheet.line(plot, limb, byLayer(list, layers, "nearest"), colour, {
        symbol,
        click,
        tip: ({ dataIndex }) =>
          tipOf(`${limb}, ${layerInSearch(dataIndex, at)}`, [
            ["nearest particle", `${figureWords(rowAt(dataIndex)?.nearest)} mm`],
            ["median particle", `${figureWords(rowAt(dataIndex)?.median)} mm`],
            ["noise of the layer", `${figureWords(rowAt(dataIndex)?.reach)} mm`],
            ["reference inside the cloud", rowAt(dataIndex)?.inside ? "yes" : "no"],
          ]),
      });
      const found = at.tried?.nearest.filter((row) => row.limb === limb) ?? [];
      if (found.length)
        sheet.line(plot, `${limb}, tried`, byLayer(found, layers, "nearest"), token("tried"), {
          symbol,
          tip: ({ dataIndex }) =>
            tipOf(`${limb}, ${layerInSearch(dataIndex, at)}, tried`, [
              [
                "nearest particle",
                `${figureWords(byLayer(found, layers, "nearest")[dataIndex])} mm`,
              ],
            ]),
        });
      sheet.line(plot, `${limb}: noise`, byLayer(list, layers, "reach"), colour, {
        dashed: true,
        symbols: false,
        tooltip: { show: false },
      });
    });
    sheet.chosen(plot, { column: at.layer });
  } else sheet.words("There is no reference pose to measure the particles against.", two);
  const limb =
    at.limb ??
    rows
      .filter((row) => row.frame === at.frame)
      .reduce((worst, row) => ((row[key] ?? -1) > (worst?.[key] ?? -1) ? row : worst), null)?.limb;
  const now = rows.find((row) => row.frame === at.frame && row.limb === limb);
  return now
    ? `${now.limb}, frame ${now.frame}: ${now.error === null ? "" : `mean error ${figureWords(now.error)} mm, `}${now.disagreement === null ? "" : `disagreement with the silhouettes ${figureWords(100 * now.disagreement)} %, `}${now.lost ? lostWords(now, inUnit(lost)) : "not lost"}.`
    : "";
}
