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

function alpha(layers, stored) {
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
  const charts = [["chart-alpha", alpha], ["chart-beta", beta], ["chart-time", time]].map(([id, make]) => [new Chart(id, { empty: "No layers yet." }), make]);
  watch(["detail", "whatIf", "layerCount"], () => {
    const [detail, whatIf] = [get("detail")?.layers, get("whatIf")];
    const layers = whatIf ?? detail;
    const stored = whatIf && detail?.length ? detail : null;
    for (const [chart, make] of charts) chart.draw(() => (layers?.length ? make(layers, stored) : null));
  });
}
