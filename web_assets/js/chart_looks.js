// How every chart looks here, on the pages and in the report: type, colours of tokens.css, numbers.

const FAMILY = "Inter, system-ui, sans-serif";
const SERIES = 8;

const root = document.documentElement;

/** A token's colour in the theme in use. */
export const token = (name) => getComputedStyle(root).getPropertyValue(`--${name}`).trim();

/**
 * Type of a chart, pixels, in step with the page's own (page.css), which grows on large screens.
 */
export const typeSize = (pixels) =>
  Math.round(pixels * Math.max(1, parseFloat(token("size-text")) / 13 || 1));

/** The name of the colour of what is compared, by its place in the list. */
export const seriesToken = (index) => `series-${index % SERIES}`;

/** Three significant figures, all of those before the point. */
export function figure(value) {
  if (typeof value !== "number" || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size >= 1e7 || (size > 0 && size < 1e-3)) return value.toExponential(1);
  return size >= 100 ? String(Math.round(value)) : String(Number(value.toPrecision(3)));
}

/** Type, background and tooltip. */
export const look = () => ({
  animation: false,
  backgroundColor: "transparent",
  textStyle: { fontFamily: FAMILY, fontSize: typeSize(11), color: token("text") },
  tooltip: tooltip(),
});

/** The tooltip's look, with a chart's own formatter. */
export const tooltip = (more = {}) => ({
  backgroundColor: token("surface-raised"),
  borderColor: token("line-strong"),
  confine: true,
  textStyle: { color: token("text"), fontFamily: FAMILY, fontSize: typeSize(12) },
  ...more,
});

/** A title at the chart's top left, with its unit in a quieter tone. */
export const title = (text, unit = "") => ({
  left: 12,
  top: 8,
  text: unit ? `{a|${text}} {b|${unit}}` : `{a|${text}}`,
  textStyle: {
    fontWeight: "normal",
    rich: {
      a: { color: token("text"), fontWeight: 600, fontSize: typeSize(12), fontFamily: FAMILY },
      b: {
        color: token("text-quiet"),
        fontWeight: 450,
        fontSize: typeSize(11),
        fontFamily: FAMILY,
        padding: [0, 0, 0, 4],
      },
    },
  },
});

/** An axis in the page's tones. @param {Record<string, any>} more */
export const axis = ({ axisLabel = {}, ...more }) => ({
  axisLine: { lineStyle: { color: token("line-strong") } },
  axisTick: { show: false },
  splitLine: { lineStyle: { color: token("line") } },
  nameTextStyle: { color: token("text-quiet"), fontSize: typeSize(11) },
  ...more,
  axisLabel: { color: token("text-quiet"), fontSize: typeSize(11), ...axisLabel },
});

/** The legend in the top right corner. */
export const legend = (data) => ({
  right: 12,
  top: 6,
  itemWidth: 12,
  itemHeight: 8,
  data,
  textStyle: { color: token("text-quiet"), fontSize: typeSize(11) },
});
