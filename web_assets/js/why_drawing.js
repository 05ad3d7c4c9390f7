// Limbs over the frames, and how near the particles of each layer came: what the words on why a frame failed rest on.

import { figure as figureWords, token } from "./chart_looks.js";
import { limbLook } from "./limb_looks.js";
import { byLayer, categories, distinct, extent, grouped, numbers, tipOf } from "./view_sheet.js";

const ROW = 17;

/** Limbs over the frames, and how near the particles of each layer came to the reference pose. */
export function drawLimbs(sheet, /** @type {any} */ { limbs: rows, nearest }, at, room) {
  const frames = distinct(rows.map((row) => row.frame));
  const names = distinct(rows.map((row) => row.limb));
  const measured = rows.some((row) => row.error !== null);
  const key = measured ? "error" : "disagreement";
  const unitWords = measured ? "error, mm" : "share of its area that silhouettes and body do not agree about";
  const [low, high] = extent([...rows, ...(at.tried?.limbs ?? [])].map((row) => row[key]));
  const height = Math.max(names.length * ROW, room - 60);
  const [one, two] = sheet.columns(2, { gutters: [112, 84], shares: [1.7, 1], right: 18 });
  if (rows.length) {
    const plot = sheet.plot({ ...one, top: 0, height }, { title: "Limbs over the frames", unit: `${unitWords}${at.tried ? "; ◤ stored, ◢ tried" : ""}`, x: categories(frames.map(String), "frame"), y: categories(names, "", { inverse: true, axisLabel: { interval: 0, width: 104, overflow: "truncate" } }) });
    const rowOf = new Map(rows.map((row) => [`${row.frame}/${row.limb}`, row]));
    const cellsOf = (list) => list.map((row) => [frames.indexOf(row.frame), names.indexOf(row.limb), row[key] ?? "-"]);
    sheet.splitHeat(plot, {
      cells: cellsOf(rows), tried: at.tried && cellsOf(at.tried.limbs), low: Math.min(0, low), high, framed: false, ends: [figureWords(high), "0"], key: { left: one.left + one.width + 8, top: 40 },
      click: ({ value }) => ({ frame: frames[value[0]], limb: names[value[1]] }),
      tip: ({ value }) => { const row = rowOf.get(`${frames[value[0]]}/${names[value[1]]}`); return tipOf(`${row.limb}, frame ${row.frame}`, [["error", row.error === null ? "–" : `${figureWords(row.error)} mm`], ["disagreement with the silhouettes", row.disagreement === null ? "–" : `${figureWords(100 * row.disagreement)} %`], ["lost", row.lost ? `yes, by the ${row.lost_by}` : "no"]]); },
    });
    sheet.chosen(plot, { column: frames.indexOf(at.frame) < 0 ? null : String(at.frame), row: at.limb && names.includes(at.limb) ? names.indexOf(at.limb) : null });
  } else sheet.words("There are no numbers by limb of this run.", one.left, 40, one.width);
  if (nearest.length) {
    const layers = distinct([...nearest, ...(at.tried?.nearest ?? [])].map((row) => row.layer)).sort((a, b) => a - b);
    const own = [...grouped(nearest, "limb")];
    const shown = at.limb && own.some(([limb]) => limb === at.limb) ? own.filter(([limb]) => limb === at.limb) : own.filter(([, list]) => list.some((row) => row.nearest > row.reach)).slice(0, 5);
    const drawnOnes = shown.length ? shown : own.slice(0, 3);
    const plot = sheet.plot({ ...two, top: 0, height }, { title: "Nearest particle", unit: "to the reference pose, mm; dashed: the layer's noise", names: drawnOnes.map(([limb]) => limb), x: categories(layers.map((layer) => String(layer + 1)), "layer"), y: numbers("", { scale: false, min: 0 }) });
    const limbs = own.map(([limb]) => limb);
    drawnOnes.forEach(([limb, list]) => {
      const { colour, symbol } = limbLook(limb, limbs);
      const click = ({ dataIndex }) => ({ layer: list[dataIndex].layer, limb });
      sheet.line(plot, limb, list.map((row) => row.nearest), colour, { symbol, click, tip: ({ dataIndex }) => tipOf(`${limb}, layer ${list[dataIndex].layer + 1}`, [["nearest particle", `${figureWords(list[dataIndex].nearest)} mm`], ["median particle", `${figureWords(list[dataIndex].median)} mm`], ["noise of the layer", `${figureWords(list[dataIndex].reach)} mm`], ["reference inside the cloud", list[dataIndex].inside ? "yes" : "no"]]) });
      const found = at.tried?.nearest.filter((row) => row.limb === limb) ?? [];
      if (found.length) sheet.line(plot, `${limb}, tried`, byLayer(found, layers, "nearest"), token("tried"), { symbol, tip: ({ dataIndex }) => tipOf(`${limb}, layer ${dataIndex + 1}, tried`, [["nearest particle", `${figureWords(byLayer(found, layers, "nearest")[dataIndex])} mm`]]) });
      sheet.line(plot, `${limb}: noise`, list.map((row) => row.reach), colour, { dashed: true, symbols: false, tooltip: { show: false } });
    });
    sheet.chosen(plot, { column: at.layer === null ? null : String(at.layer + 1) });
  } else sheet.words("There is no reference pose to measure the particles against.", two.left, 40, two.width);
  const limb = at.limb ?? rows.filter((row) => row.frame === at.frame).reduce((worst, row) => ((row[key] ?? -1) > (worst?.[key] ?? -1) ? row : worst), null)?.limb;
  const now = rows.find((row) => row.frame === at.frame && row.limb === limb);
  return now ? `${now.limb}, frame ${now.frame}: ${now.error === null ? "" : `error ${figureWords(now.error)} mm, `}${now.disagreement === null ? "" : `disagreement with the silhouettes ${figureWords(100 * now.disagreement)} %, `}${now.lost ? `lost by the ${now.lost_by}` : "not lost"}.` : "";
}
