// Over the frames: the best weight, and with truth the error.

import { axis, figure, title, tooltip } from "./chart_looks.js";
import { Chart } from "./charts.js";
import { get, watch } from "./state.js";
import { token } from "./theme.js";
import { goTo } from "./timeline.js";

function overFrames(summary, { key, name, unit, colour, note = "" }) {
  const frames = summary.frames.map((entry) => entry.frame);
  const cursor = frames.indexOf(get("frame"));
  return {
    title: title(name, note ? `${unit} · ${note}` : unit),
    tooltip: tooltip({ trigger: "axis", formatter: ([point]) => `frame ${point.axisValue}<br><b>${figure(point.data)}</b> ${unit}` }),
    xAxis: axis({ type: "category", data: frames, name: "frame", nameLocation: "middle", nameGap: 20 }),
    yAxis: axis({ type: "value", scale: key !== "error_mm", min: key === "error_mm" ? 0 : undefined }),
    dataZoom: [{ type: "inside" }],
    series: [{
      type: "line", data: summary.frames.map((entry) => entry[key]), showSymbol: frames.length < 2, lineStyle: { color: colour, width: 1.6 }, itemStyle: { color: colour },
      markLine: cursor < 0 ? undefined : { symbol: "none", silent: true, label: { show: false }, lineStyle: { color: token("text-quiet"), type: "solid" }, data: [{ xAxis: cursor }] },
    }],
  };
}

/** A click anywhere in a chart goes to the frame under it. */
function goesToFrames(chart) {
  chart.getZr().on("click", ({ offsetX, offsetY }) => {
    const at = chart.convertFromPixel({ gridIndex: 0 }, [offsetX, offsetY])?.[0];
    const entry = get("summary")?.frames[Math.round(at)];
    if (entry) goTo(entry.frame);
  });
}

/** Wire the two charts to the state. */
export function startWeights() {
  const weight = new Chart("chart-weight", { empty: "No frames yet.", wire: goesToFrames });
  const error = new Chart("chart-error", { empty: "This session has no truth to measure against.", wire: goesToFrames });
  watch(["summary", "frame"], () => {
    const summary = get("summary");
    const some = summary?.frames.length ? summary : null;
    const [name, unit] = summary?.score ?? [];
    weight.draw(() => some && overFrames(some, { key: "log_weight", name, unit, colour: token("accent") }));
    const measured = some?.frames.some((entry) => entry.error_mm !== null && entry.error_mm !== undefined) ? some : null;
    const note = measured && summary.mean_mm ? `mean ${figure(summary.mean_mm)} mm, worst frame ${figure(summary.worst_mm)} mm, no alignment` : "";
    error.draw(() => measured && overFrames(measured, { key: "error_mm", name: "Error of the markers", unit: "mm", colour: token("layer-7"), note }));
  });
}
