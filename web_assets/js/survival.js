// What each layer did: survival wanted and reached, the exponent that brought it about, and its time. While a re-annealed
// frame is shown, the stored answer's curves stay beside it.

import { Chart, axis, figure, legend, title, tooltip } from "./charts.js";
import { get, watch } from "./state.js";
import { layerColour, token } from "./theme.js";

const FEWEST_ROWS = 2;

const names = (layers) => Array.from({ length: Math.max(layers.length, get("layerCount") ?? 0, FEWEST_ROWS) }, (_, at) => String(at + 1));

const layerAxis = (layers) => axis({ type: "category", data: names(layers), name: "layer", nameLocation: "middle", nameGap: 20 });

function line(name, layers, key, colour, { dashed = false, stepped = false } = {}) {
  return {
    name, type: "line", step: stepped ? "middle" : false, data: layers.map((layer) => layer[key]), symbol: "circle", symbolSize: dashed ? 4 : 6,
    lineStyle: { color: colour, type: dashed ? "dashed" : "solid", width: dashed ? 1.5 : 2 }, itemStyle: { color: colour },
  };
}

// A swarm draws nobody by weight: it has neither rate nor exponent, but a fitness that rises and a cloud that settles.
const weighs = (layers) => layers.some((layer) => layer.alpha_reached !== null);

const middle = (layer) => layer.log_weight_quantiles?.[2] ?? null;

function fitness(layers, stored) {
  const best = (all) => all.map((layer) => ({ ...layer, middle: middle(layer) }));
  const beside = stored ? [line("stored", stored, "best_log_weight", token("ghost"), { dashed: true })] : [];
  return {
    title: title("Fitness", "of the swarm in each iteration"),
    legend: legend(["best", "median", ...(stored ? ["stored"] : [])]),
    tooltip: tooltip({ trigger: "axis", valueFormatter: figure }),
    grid: { left: 56, right: 16, top: 52, bottom: 34 },
    xAxis: layerAxis(layers),
    yAxis: axis({ type: "value", scale: true, axisLabel: { formatter: figure } }),
    series: [line("best", layers, "best_log_weight", token("accent")), line("median", best(layers), "middle", token("text-quiet"), { dashed: true }), ...beside],
  };
}

/** Root mean square over the parameters that move of a deviation beside its largest in the frame. */
function spreads(layers) {
  const most = layers[0].variance_weighed.map((_, at) => Math.max(...layers.map((layer) => layer.variance_weighed[at])));
  return layers.map((layer) => {
    const shares = layer.variance_weighed.map((value, at) => value / most[at]).filter((share) => share > 0);
    return { spread: shares.length ? Math.sqrt(shares.reduce((sum, share) => sum + share, 0) / shares.length) : null };
  });
}

function spread(layers, stored) {
  const beside = stored ? [line("stored", spreads(stored), "spread", token("ghost"), { dashed: true })] : [];
  return {
    title: title("Spread of the swarm", "share of its largest, over what moves"),
    legend: legend(stored ? ["spread", "stored"] : []),
    tooltip: tooltip({ trigger: "axis", valueFormatter: figure }),
    grid: { left: 56, right: 16, top: 52, bottom: 34 },
    xAxis: layerAxis(layers),
    yAxis: axis({ type: "log", axisLabel: { formatter: figure } }),
    series: [line("spread", spreads(layers), "spread", token("layer-7")), ...beside],
  };
}

function alpha(layers, stored) {
  if (!weighs(layers)) return fitness(layers, stored);
  const beside = stored ? [line("stored", stored, "alpha_reached", token("ghost"), { dashed: true })] : [];
  return {
    title: title("Survival rate α", "Eq. 12"),
    legend: legend(["wanted", "reached", ...(stored ? ["stored"] : [])]),
    tooltip: tooltip({ trigger: "axis", valueFormatter: figure }),
    grid: { left: 44, right: 16, top: 52, bottom: 34 },
    xAxis: layerAxis(layers),
    yAxis: axis({ type: "value", min: 0, max: 1 }),
    series: [line("wanted", layers, "alpha_wanted", token("text-quiet"), { dashed: true, stepped: true }), line("reached", layers, "alpha_reached", token("accent")), ...beside],
  };
}

function beta(layers, stored) {
  if (!weighs(layers)) return spread(layers, stored);
  const beside = stored ? [line("stored", stored, "beta", token("ghost"), { dashed: true })] : [];
  return {
    title: title("Exponent β", "weights are raised to it, Eq. 3"),
    legend: legend(stored ? ["β", "stored"] : []),
    tooltip: tooltip({ trigger: "axis", valueFormatter: figure }),
    grid: { left: 56, right: 16, top: 52, bottom: 34 },
    xAxis: layerAxis(layers),
    yAxis: axis({ type: "log", axisLabel: { formatter: figure } }),
    series: [line("β", layers, "beta", token("layer-7")), ...beside],
  };
}

function time(layers, stored) {
  const sum = layers.reduce((total, layer) => total + layer.milliseconds, 0);
  const beside = stored ? [line("stored", stored, "milliseconds", token("ghost"), { dashed: true })] : [];
  return {
    title: title("Time per layer", `ms, ${figure(sum)} in all`),
    legend: legend(stored ? ["stored"] : []),
    tooltip: tooltip({ trigger: "axis", valueFormatter: (value) => `${figure(value)} ms` }),
    grid: { left: 44, right: 16, top: 52, bottom: 34 },
    xAxis: layerAxis(layers),
    yAxis: axis({ type: "value", min: 0 }),
    series: [
      { name: "this", type: "bar", barMaxWidth: 28, data: layers.map((layer, at) => ({ value: layer.milliseconds, itemStyle: { color: layerColour(at, layers.length) } })) },
      ...beside,
    ],
  };
}

/** Wire the three charts to the state. */
export function startSurvival() {
  const tab = document.querySelector("[data-panel=survival]");
  const charts = [["chart-alpha", alpha], ["chart-beta", beta], ["chart-time", time]].map(([id, make]) => [new Chart(id, { empty: "No layers yet." }), make]);
  watch(["detail", "whatIf", "layerCount"], () => {
    const [detail, whatIf] = [get("detail")?.layers, get("whatIf")];
    const layers = whatIf ?? detail;
    const stored = whatIf && detail?.length ? detail : null;
    tab.textContent = layers?.length && !weighs(layers) ? "Fitness & spread" : "Survival & β";
    for (const [chart, make] of charts) chart.draw(() => (layers?.length ? make(layers, stored) : null));
  });
}
