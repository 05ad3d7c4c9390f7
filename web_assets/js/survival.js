// What each layer did: survival wanted and reached, the exponent that brought it about, and its time. While a re-annealed
// frame is shown, the stored result's curves stay beside it.

import { axis, figure, legend, title, tooltip } from "./chart_looks.js";
import { Chart } from "./charts.js";
import { get, watch } from "./state.js";
import { layerColour, token } from "./theme.js";

const FEWEST_ROWS = 2;
const names = (layers) => Array.from({ length: Math.max(layers.length, get("layerCount") ?? 0, FEWEST_ROWS) }, (_, at) => String(at + 1));

/** A curve: `values` has one number a layer. */
const line = (name, values, colour, { dashed = false, stepped = false } = {}) => ({
  name, type: "line", step: stepped ? "middle" : false, data: values, symbol: "circle", symbolSize: dashed ? 4 : 6,
  lineStyle: { color: colour, type: dashed ? "dashed" : "solid", width: dashed ? 1.5 : 2 }, itemStyle: { color: colour },
});

/** A chart over the layers. series: the curves; stored: the numbers of the stored result, beside them; left: room for the numbers. */
const overLayers = (layers, heading, unit, series, stored, yAxis, { left = 56, legended = series, valueFormatter = figure } = {}) => ({
  title: title(heading, unit),
  legend: legend([...(legended.length > 1 || stored ? legended.map((one) => one.name) : []), ...(stored ? ["stored"] : [])]),
  tooltip: tooltip({ trigger: "axis", valueFormatter }),
  grid: { left, right: 16, top: 52, bottom: 34 },
  xAxis: axis({ type: "category", data: names(layers), name: "layer", nameLocation: "middle", nameGap: 20 }),
  yAxis: axis(yAxis),
  series: [...series, ...(stored ? [line("stored", stored, token("ghost"), { dashed: true })] : [])],
});

const of = (layers, key) => layers?.map((layer) => layer[key]);
const LOGARITHMIC = { type: "log", axisLabel: { formatter: figure } };

// A swarm keeps its particles whatever their likelihood: it has neither rate nor exponent, but a fitness that rises and a cloud that settles.
const resamples = (layers) => layers.some((layer) => layer.alpha_reached !== null);

/** Root mean square over the parameters that move of a deviation beside its largest in the frame. */
function spreads(layers) {
  const most = layers[0].variance_weighed.map((_, at) => Math.max(...layers.map((layer) => layer.variance_weighed[at])));
  return layers.map((layer) => {
    const shares = layer.variance_weighed.map((value, at) => value / most[at]).filter((share) => share > 0);
    return shares.length ? Math.sqrt(shares.reduce((sum, share) => sum + share, 0) / shares.length) : null;
  });
}

function alpha(layers, stored) {
  if (!resamples(layers)) {
    const middle = layers.map((layer) => layer.log_weight_quantiles?.[2] ?? null);
    return overLayers(layers, "Fitness", "of the swarm in each iteration", [line("best", of(layers, "best_log_weight"), token("accent")), line("median", middle, token("text-quiet"), { dashed: true })],
      of(stored, "best_log_weight"), { type: "value", scale: true, axisLabel: { formatter: figure } });
  }
  return overLayers(layers, "Survival rate α", "Eq. 12", [line("wanted", of(layers, "alpha_wanted"), token("text-quiet"), { dashed: true, stepped: true }), line("reached", of(layers, "alpha_reached"), token("accent"))],
    of(stored, "alpha_reached"), { type: "value", min: 0, max: 1 }, { left: 44 });
}

function beta(layers, stored) {
  if (!resamples(layers)) return overLayers(layers, "Spread of the swarm", "share of its largest, over what moves", [line("spread", spreads(layers), token("layer-7"))], stored && spreads(stored), LOGARITHMIC);
  return overLayers(layers, "Exponent β", "weights are raised to it, Eq. 3", [line("β", of(layers, "beta"), token("layer-7"))], of(stored, "beta"), LOGARITHMIC);
}

function time(layers, stored) {
  const bars = { name: "this", type: "bar", barMaxWidth: 28, data: layers.map((layer, at) => ({ value: layer.milliseconds, itemStyle: { color: layerColour(at, layers.length) } })) };
  const sum = layers.reduce((total, layer) => total + layer.milliseconds, 0);
  return overLayers(layers, "Time per layer", `ms, ${figure(sum)} in all`, [bars], of(stored, "milliseconds"), { type: "value", min: 0 }, { left: 44, legended: [], valueFormatter: (value) => `${figure(value)} ms` });
}

/** Wire the three charts to the state. */
export function startSurvival() {
  const tab = document.querySelector("[data-panel=survival]");
  const charts = Object.entries({ "chart-alpha": alpha, "chart-beta": beta, "chart-time": time }).map(([id, make]) => ({ chart: new Chart(id, { empty: "No layers yet." }), make }));
  watch(["detail", "whatIf", "layerCount"], () => {
    const [detail, whatIf] = [get("detail")?.layers, get("whatIf")];
    const layers = whatIf ?? detail;
    const stored = whatIf && detail?.length ? detail : null;
    tab.textContent = layers?.length && !resamples(layers) ? "Fitness & spread" : "Survival & β";
    for (const { chart, make } of charts) chart.draw(() => (layers?.length ? make(layers, stored) : null));
  });
}
