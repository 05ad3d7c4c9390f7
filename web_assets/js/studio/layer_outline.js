// A layer's cloud as a small drawing: where hands, feet and head of its particles lie, about the
// mean body.

import { html } from "./component.js";

/**
 * Standard deviations that an ellipse reaches at least; so much of the figure's height at most the
 * largest of a frame.
 */
const REACH = 1.5;
const LARGEST = 0.2;
const MARGIN = 0.04;

/** @typedef {{ ellipses: number[][], figure: number[][] }} Outline */

/** Half axes and angle (degrees) of a covariance. */
function axesOf(xx, xy, yy) {
  const middle = (xx + yy) / 2;
  const away = Math.hypot((xx - yy) / 2, xy);
  const angle = (Math.atan2(2 * xy, xx - yy) * 90) / Math.PI;
  return [Math.sqrt(middle + away), Math.sqrt(Math.max(0, middle - away)), angle];
}

/**
 * How the outlines of a frame's layers are drawn, all alike; null without any. `box`: the part of
 * the picture that holds them, as an SVG's viewBox. `reach`: standard deviations of an ellipse's
 * half axes, more than they are where the cloud is too small to be seen beside its body.
 * @param {(Outline | null | undefined)[]} outlines
 */
export function scaleOf(outlines) {
  const known = outlines.filter((outline) => outline?.ellipses.length);
  if (!known.length) return null;
  const ends = known.flatMap((outline) => outline?.figure ?? []);
  const heights = ends.flatMap(([, y0, , y1]) => [y0, y1]);
  const height = Math.max(...heights) - Math.min(...heights);
  const ellipses = known.flatMap((outline) => outline?.ellipses ?? []);
  const largest = Math.sqrt(Math.max(...ellipses.map(([, , xx, , yy]) => Math.max(xx, yy))));
  const reach = Math.max(REACH, largest > 0 ? (LARGEST * height) / largest : 0);
  const xs = ends.flatMap(([x0, , x1]) => [x0, x1]);
  const ys = [...heights];
  for (const [x, y, xx, , yy] of ellipses) {
    const [wide, high] = [reach * Math.sqrt(xx), reach * Math.sqrt(yy)];
    xs.push(x - wide, x + wide);
    ys.push(y - high, y + high);
  }
  const [left, top] = [Math.min(...xs), Math.min(...ys)];
  const [width, tall] = [Math.max(...xs) - left || 1, Math.max(...ys) - top || 1];
  const margin = MARGIN * Math.max(width, tall);
  const box = [left - margin, top - margin, width + 2 * margin, tall + 2 * margin].join(" ");
  return { box, reach };
}

/**
 * The outline of one layer.
 * @param {{ outline?: Outline | null, scale: ReturnType<typeof scaleOf>, colour: string }}
 *   properties
 */
export function LayerOutline({ outline, scale, colour }) {
  if (!outline || !scale) return html`<svg class="layer-outline" aria-hidden="true"></svg>`;
  const body = outline.figure.map(([x0, y0, x1, y1]) => `M${x0} ${y0}L${x1} ${y1}`).join("");
  return html`<svg class="layer-outline" viewBox=${scale.box} aria-hidden="true" style=${{ color: colour }}>
    <path class="layer-figure" d=${body} />
    ${outline.ellipses.map(([x, y, ...covariance], at) => {
      const [long, short, angle] = axesOf(covariance[0], covariance[1], covariance[2]);
      return html`<ellipse
        key=${at}
        cx=${x}
        cy=${y}
        rx=${scale.reach * long}
        ry=${scale.reach * short}
        transform=${`rotate(${angle} ${x} ${y})`}
      />`;
    })}
  </svg>`;
}
