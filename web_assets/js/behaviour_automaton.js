// Which cluster follows which, as dots and lines.

import { look, tooltip, typeSize } from "./chart_looks.js";
import { onTheme, token } from "./theme.js";

const LARGEST = 34;
const SMALLEST = 8;
const SHOWN_LINES = 400;

/**
 * Draw the graph into an element; choose is called with a cluster. Returns a function that takes it
 * away.
 */
export function drawAutomaton(box, { clusters, transitions }, echarts, choose) {
  const chart = echarts.init(box, null, { renderer: "canvas" });
  const most = Math.max(...clusters.map((cluster) => cluster.share));
  const strongest = [...transitions]
    .sort((one, two) => two.probability - one.probability)
    .slice(0, SHOWN_LINES);
  const draw = () =>
    chart.setOption(
      {
        ...look(),
        tooltip: tooltip({
          formatter: ({ dataType, data }) =>
            dataType === "edge"
              ? `${data.source} → ${data.target}: ${Math.round(100 * data.value)} %`
              : `cluster ${data.name}: ${(100 * data.value).toFixed(1)} % of the time`,
        }),
        series: [
          {
            type: "graph",
            layout: "circular",
            circular: { rotateLabel: false },
            roam: false,
            top: 24,
            bottom: 24,
            label: {
              show: clusters.length <= 48,
              color: token("text"),
              fontSize: typeSize(10),
              position: "inside",
            },
            itemStyle: {
              color: token("accent-soft"),
              borderColor: token("accent"),
              borderWidth: 1,
            },
            emphasis: { focus: "adjacency", label: { show: true } },
            edgeSymbol: ["none", "arrow"],
            edgeSymbolSize: 5,
            data: clusters.map(({ cluster, share }) => ({
              name: String(cluster),
              value: share,
              symbolSize: SMALLEST + (LARGEST - SMALLEST) * Math.sqrt(share / most),
            })),
            links: strongest.map(({ source, target, probability }) => ({
              source: String(source),
              target: String(target),
              value: probability,
              lineStyle: {
                width: 0.5 + 3 * probability,
                opacity: 0.15 + 0.75 * probability,
                color: token("text-quiet"),
                curveness: 0.16,
              },
            })),
          },
        ],
      },
      { notMerge: true },
    );
  draw();
  chart.on("click", ({ dataType, data }) => {
    if (dataType === "node") choose(Number(data.name));
  });
  onTheme(() => {
    if (!chart.isDisposed()) draw();
  });
  const sized = new ResizeObserver(() => chart.resize());
  sized.observe(box);
  return () => {
    sized.disconnect();
    chart.dispose();
  };
}
