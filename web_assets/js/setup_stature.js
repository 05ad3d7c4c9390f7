// A body as it stands, with the lengths of its limbs: what a height or a fit makes of it. People
// are seen from the front, animals and whatever else is longer than high from the side; all are
// drawn as large as a person.

import { html } from "./studio/component.js";

const COLOURS = {
  left: "var(--limb-left)",
  right: "var(--limb-right)",
  middle: "var(--limb-middle)",
};
const MARGIN = 90;
const LABEL_ROOM = 620;
const LINE = 88;
const PERSON = 1700;
const BULGE = 0.4; // of a radius: how far a limb's end is rounded, so that cones look like limbs

/**
 * A tapered limb seen from the front, as a path. flat: mm, y to the right of the picture, z down.
 */
function outline({ start, end, radii }) {
  const [a, b] = [
    [start[1], -start[2]],
    [end[1], -end[2]],
  ];
  const along = [b[0] - a[0], b[1] - a[1]];
  const length = Math.hypot(...along) || 1;
  const across = [-along[1] / length, along[0] / length];
  const bulge = (point, radius, sign) =>
    point
      .map((value, axis) => (value + sign * BULGE * radius * (along[axis] / length)).toFixed(1))
      .join(" ");
  const at = (point, radius) => [point[0] + across[0] * radius, point[1] + across[1] * radius];
  const [p, q, r, s] = [at(a, radii[0]), at(b, radii[1]), at(b, -radii[1]), at(a, -radii[0])].map(
    (point) => point.map((value) => value.toFixed(1)).join(" "),
  );
  return `M${p}L${q}Q${bulge(b, radii[1], 1)} ${r}L${s}Q${bulge(a, radii[0], -1)} ${p}Z`;
}

/** Labels at the right, one a line, none over another: [y wanted] -> [y]. */
function spread(wanted) {
  const order = wanted.map((y, index) => [y, index]).sort((one, other) => one[0] - other[0]);
  const placed = [];
  let last = -Infinity;
  for (const [y, index] of order) {
    last = Math.max(y, last + LINE);
    placed[index] = last;
  }
  return placed;
}

const length = (limb) => Math.hypot(...limb.end.map((value, axis) => value - limb.start[axis]));

const spanOf = (limbs, axis) => {
  const all = limbs.flatMap((limb) => [limb.start[axis], limb.end[axis]]);
  return Math.max(...all) - Math.min(...all);
};
/** A length in words: metres of a person, millimetres of a mouse. */
const longWords = (mm) => (mm < 500 ? `${Math.round(mm)} mm` : `${(mm / 1000).toFixed(2)} m`);

/**
 * Limbs turned to be seen from where they are longest, in sizes of a person: what the drawing has
 * for a limb of `true` mm.
 */
function turned(limbs, isLong, scale) {
  const turn = ([x, y, z]) => (isLong ? [-y, x, z] : [x, y, z]).map((value) => value / scale);
  return limbs.map((limb) => ({
    ...limb,
    start: turn(limb.start),
    end: turn(limb.end),
    radii: limb.radii.map((radius) => radius / scale),
    long: length(limb),
  }));
}

/** A length in millimetres, and how much it differs from an earlier one. */
function lengthWords(limb, earlier) {
  const change = earlier ? Math.round(limb.long - earlier.long) : 0;
  const sign = change > 0 ? "+" : "−";
  return `${Math.round(limb.long)} mm${change ? `  (${sign}${Math.abs(change)})` : ""}`;
}

/** A limb's length and name beside the body at a height, and a line from its middle to them. */
function Label({ limb, earlier, y, right }) {
  const middle = `${(limb.start[1] + limb.end[1]) / 2},${-(limb.start[2] + limb.end[2]) / 2}`;
  return html`
    <polyline class="leader" fill="none" points=${`${middle} ${right - 30},${y} ${right},${y}`} />
    <text x=${right + 14} y=${y + 9}>${lengthWords(limb, earlier)}</text>
    <text class="name" x=${right + 14} y=${y + 40}>${limb.name.replace(/^left /, "")}</text>
  `;
}

/**
 * A drawing of limbs, with words below; `before`: those drawn dashed beside them, and by how much
 * their lengths differ.
 */
export function Stature({ limbs: given, before: givenBefore = [], words }) {
  const tall = spanOf(given, 2);
  const isLong = spanOf(given, 0) > 1.2 * Math.max(tall, spanOf(given, 1));
  const longest = Math.max(tall, spanOf(given, 0), spanOf(given, 1)) || PERSON;
  const scale = longest < PERSON / 2 || longest > 2 * PERSON ? longest / PERSON : 1;
  const [limbs, before] = [turned(given, isLong, scale), turned(givenBefore, isLong, scale)];
  const drawn = limbs.filter((limb) => length(limb) > 1);
  const all = [...drawn, ...before];
  const xs = all.flatMap((limb) =>
    [limb.start[1], limb.end[1]].flatMap((y) => [y - limb.radii[0], y + limb.radii[0]]),
  );
  const heights = all.flatMap((limb) => [limb.start[2], limb.end[2]]);
  const [top, low] = [Math.max(...heights), Math.min(0, ...heights)];
  const [left, right] = [Math.min(...xs) - MARGIN, Math.max(...xs) + MARGIN];
  const [width, height] = [right - left + LABEL_ROOM * 1.35, top - low + 2 * MARGIN];
  const far = [...drawn].sort(
    (one, other) => Math.min(one.start[0], one.end[0]) - Math.min(other.start[0], other.end[0]),
  );
  const named = drawn.filter((limb) => limb.side !== "right");
  const places = spread(named.map((limb) => -(limb.start[2] + limb.end[2]) / 2));
  return html`<figure class=${before.length ? "stature compared" : "stature"}>
    <svg
      aria-label=${drawn.map((limb) => `${limb.name} ${Math.round(limb.long)} mm`).join(", ")}
      viewBox=${`${left - LABEL_ROOM * 0.35} ${-top - MARGIN} ${width} ${height}`}
      role="img"
    >
      <line class="floor" x1=${left - 100} x2=${right + 60} y1=${-low} y2=${-low} />
      ${far.map(
        (limb) =>
          html`<path
            class="bone"
            d=${outline(limb)}
            fill=${COLOURS[limb.side] ?? COLOURS.middle}
            stroke="var(--scene-background)"
            stroke-width="4"
          />`,
      )}
      ${before
        .filter((limb) => length(limb) > 1)
        .map((limb) => html`<path class="ghost" d=${outline(limb)} />`)}
      ${named.map((limb, at) => {
        const earlier = before.find((one) => one.name === limb.name);
        return html`<${Label} limb=${limb} earlier=${earlier} y=${places[at]} right=${right} />`;
      })}
      <line class="leader" x1=${left - 40} x2=${left - 40} y1=${-low} y2=${-top} />
      <text x=${left - 54} y=${-(top + low) / 2} text-anchor="end">
        ${longWords(scale * (top - low))}
      </text>
    </svg>
    <figcaption>${words}</figcaption>
  </figure>`;
}
