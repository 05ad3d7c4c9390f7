// A rig drawn: the room from above with cameras and places, and the body with its joints' errors.

import { dotted } from "./elements.js";
import { html, useRef } from "./studio/component.js";

/** @import { Schemas } from "./api_types" */
/** @typedef {[number, number, number]} Place */

/** The name of the rig as it stands. */
export const PRESENT = "as it is";
const [WIDTH, HEIGHT, MARGIN] = [620, 480, 52];
const RAY = 34;
const STEPS = [100, 250, 500, 1000, 2000, 5000, 10000, 20000];
const HEAT = ["heat-lowest", "heat-low", "heat-middle", "heat-high"];
const MOVES = {
  ArrowLeft: [-1, 0, 0],
  ArrowRight: [1, 0, 0],
  ArrowUp: [0, 1, 0],
  ArrowDown: [0, -1, 0],
  PageUp: [0, 0, 1],
  PageDown: [0, 0, -1],
};
const [STEP_MM, LONG_STEP_MM] = [100, 500];
/** A place that has less of the body in its picture is never chosen. */
const SEEN = 0.5;
const [BODY_WIDTH, BODY_HEIGHT, BODY_MARGIN] = [260, 380, 18];

/** Millimetres as metres. @param {number} mm */
export const metres = (mm) => (mm / 1000).toFixed(2);

/** The colour of a share, 0 to 1. @param {number} share */
function heat(share) {
  const at = Math.min(1, Math.max(0, share)) * (HEAT.length - 1);
  const low = Math.min(Math.floor(at), HEAT.length - 2);
  const rest = Math.round(100 * (at - low));
  return `color-mix(in srgb, var(--${HEAT[low + 1]}) ${rest}%, var(--${HEAT[low]}))`;
}

/** What the colours mean. @param {{ from: string, to: string }} properties */
export const Legend = ({ from, to }) => html`<p class="rig-legend hint">
  ${from}
  <i style=${{ background: `linear-gradient(to right, ${HEAT.map((one) => `var(--${one})`).join(", ")})` }}></i>
  ${to}
</p>`;

/** @param {Place[]} points */
function planOf(points) {
  const range = (/** @type {number} */ axis) => {
    const values = points.map((point) => point[axis]);
    return [Math.min(...values), Math.max(...values)];
  };
  const [[left, right], [low, high]] = [range(0), range(1)];
  const scale = Math.min(
    (WIDTH - 2 * MARGIN) / Math.max(right - left, 1),
    (HEIGHT - 2 * MARGIN) / Math.max(high - low, 1),
  );
  return {
    scale,
    step: STEPS.find((one) => one * scale >= 40) ?? STEPS[STEPS.length - 1],
    at: (/** @type {number[]} */ [x, y]) => [
      WIDTH / 2 + (x - (left + right) / 2) * scale,
      HEIGHT / 2 - (y - (low + high) / 2) * scale,
    ],
    back: (/** @type {number} */ x, /** @type {number} */ y) => [
      (left + right) / 2 + (x - WIDTH / 2) / scale,
      (low + high) / 2 - (y - HEIGHT / 2) / scale,
    ],
  };
}

/** Where it looks from above, and how far to both sides. */
function rays([x, y], ahead, halfAngle) {
  const flat = Math.hypot(ahead[0], ahead[1]);
  if (flat < 0.05) return "";
  const [ux, uy] = [ahead[0] / flat, -ahead[1] / flat];
  const half = (halfAngle * Math.PI) / 180;
  const ray = (/** @type {number} */ turn) => {
    const [c, s] = [Math.cos(turn), Math.sin(turn)];
    return `${x + RAY * (ux * c - uy * s)},${y + RAY * (ux * s + uy * c)}`;
  };
  return `${x},${y} ${ray(-half)} ${ray(half)}`;
}

/** A camera; one that can be moved is dragged, or moved by keys. */
function Camera({ name, place, ahead, halfAngle, plan, kind, put }) {
  const dragged = useRef(false);
  const at = plan.at(place);
  const words = `${name}: x ${metres(place[0])} m, y ${metres(place[1])} m, ${metres(place[2])} m high`;
  const drag = (event) => {
    const picture = event.currentTarget.ownerSVGElement;
    const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(
      picture.getScreenCTM().inverse(),
    );
    put([...plan.back(x, y), place[2]]);
  };
  const acts = put && {
    tabindex: 0,
    role: "button",
    "aria-description":
      "Arrow keys move it, page up and down raise and lower it, shift in longer steps",
    onPointerDown: (event) => {
      dragged.current = true;
      event.currentTarget.setPointerCapture(event.pointerId);
    },
    onPointerMove: (event) => dragged.current && drag(event),
    onPointerUp: () => {
      dragged.current = false;
    },
    onKeyDown: (event) => {
      const move = MOVES[event.key];
      if (!move) return;
      event.preventDefault();
      const step = event.shiftKey ? LONG_STEP_MM : STEP_MM;
      put(
        place.map(
          (/** @type {number} */ one, /** @type {number} */ axis) => one + step * move[axis],
        ),
      );
    },
  };
  return html`<g class=${`rig-camera ${kind}`} aria-label=${words} ...${acts}>
    <title>${words}</title>
    ${ahead && html`<polygon points=${rays(at, ahead, halfAngle)} />`}
    <circle cx=${at[0]} cy=${at[1]} r="7" />
    <text x=${at[0]} y=${at[1] < HEIGHT / 2 ? at[1] - 12 : at[1] + 22} text-anchor="middle">${name}</text>
  </g>`;
}

/** @param {{ spot: Schemas["GridPlace"], size: number, at: number[], share: number, present: number, add: ((place: Place) => void) | null }} properties */
function Spot({ spot, size, at: [x, y], share, present, add }) {
  const words = dotted(
    `x ${metres(spot.place[0])} m, y ${metres(spot.place[1])} m, ${metres(spot.place[2])} m high`,
    `with a camera more here ${spot.predicted.toFixed(1)} mm instead of ${present.toFixed(1)} mm, predicted`,
    `${Math.round(100 * spot.sees)} % of the body in the picture`,
  );
  const half = size / 2;
  return html`<g
    class="rig-spot"
    onClick=${add && (() => add(/** @type {Place} */ (spot.place)))}
  >
    <title>${words}</title>
    <rect x=${x - half} y=${y - half} width=${size} height=${size} rx="3" style=${{ fill: heat(share) }} />
    ${spot.sees < SEEN && html`<path d=${`M${x - 4} ${y - 4}l8 8m0 -8l-8 8`} />`}
    ${spot.order !== null && html`<circle cx=${x} cy=${y} r="9" /><text x=${x} y=${y + 4} text-anchor="middle">${spot.order}</text>`}
  </g>`;
}

/**
 * The room from above: the cameras of a rig, the subject's path, the places of a grid by what a
 * camera more would gain there, and cameras that are being moved.
 * @param {{ of: Schemas["RigStudy"], rig: Schemas["RigErrors"], places: Schemas["GridPlace"][],
 *   most: number, moved: Record<string, Place>, added: Place[],
 *   put: ((name: string, place: Place) => void) | null, add: ((place: Place) => void) | null }} properties
 */
export function Plan({ of, rig, places, most, moved, added, put, add }) {
  // What is moved does not move the plan under it.
  const plan = planOf(
    /** @type {Place[]} */ ([
      ...of.rigs.flatMap((one) => one.cameras.map(({ place }) => place)),
      ...of.path,
      ...of.places.map(({ place }) => place),
    ]),
  );
  const present = of.rigs[0];
  const own = new Set(present.cameras.map(({ name }) => name));
  const left = present.cameras.filter(
    (camera) => !rig.cameras.some(({ name }) => name === camera.name),
  );
  const size = Math.max(8, (of.spacing ?? 0) * plan.scale * 0.82);
  const bar = plan.step * plan.scale;
  return html`<svg
    class="rig-plan"
    viewBox=${`0 0 ${WIDTH} ${HEIGHT}`}
    role="group"
    aria-label=${`The room from above with ${rig.cameras.length} cameras`}
  >
    ${places.map(
      (spot) => html`<${Spot}
        key=${spot.place.join()}
        spot=${spot}
        size=${size}
        at=${plan.at(spot.place)}
        share=${(present.predicted - spot.predicted) / most}
        present=${present.predicted}
        add=${add}
      />`,
    )}
    <polyline class="rig-path" points=${of.path.map((place) => plan.at(place).join()).join(" ")}>
      <title>The subject's path</title>
    </polyline>
    <circle class="rig-subject" cx=${plan.at(of.subject)[0]} cy=${plan.at(of.subject)[1]} r="5">
      <title>Where moved and new cameras look</title>
    </circle>
    ${left.map(
      (camera) => html`<${Camera}
        key=${`left ${camera.name}`}
        name=${camera.name}
        place=${camera.place}
        plan=${plan}
        kind="left-out"
        put=${put && ((place) => put(camera.name, place))}
      />`,
    )}
    ${rig.cameras.map((camera) => {
      const isOwn = own.has(camera.name);
      return html`<${Camera}
        key=${camera.name}
        name=${camera.name}
        place=${camera.place}
        ahead=${camera.ahead}
        halfAngle=${camera.half_angle}
        plan=${plan}
        kind=${isOwn ? "" : "new"}
        put=${put && isOwn && !moved[camera.name] ? (place) => put(camera.name, place) : null}
      />`;
    })}
    ${[
      ...Object.entries(moved),
      ...added.map((place, at) => /** @type {[string, Place]} */ ([String(at), place])),
    ].map(
      ([name, place]) => html`<${Camera}
        key=${`moved ${name}`}
        name=${own.has(name) ? name : `new ${Number(name) + 1}`}
        place=${place}
        plan=${plan}
        kind="moved"
        put=${put && ((to) => put(name, to))}
      />`,
    )}
    <line class="rig-bar" x1="14" x2=${14 + bar} y1=${HEIGHT - 12} y2=${HEIGHT - 12} />
    <text class="rig-quiet" x="14" y=${HEIGHT - 18}>
      ${plan.step >= 1000 ? `${plan.step / 1000} m` : `${plan.step} mm`}
    </text>
  </svg>`;
}

/**
 * The body from its front, each joint in the colour of its error.
 * @param {{ figure: Schemas["BodyFigure"], points: string[], values: number[], most: number }} properties
 */
export function Body({ figure, points, values, most }) {
  const all = [
    ...figure.points,
    ...figure.lines.flatMap(([a, b, c, d]) => [
      [a, b],
      [c, d],
    ]),
  ];
  const range = (/** @type {number} */ axis) => {
    const own = all.map((point) => point[axis]);
    return [Math.min(...own), Math.max(...own)];
  };
  const [[left, right], [low, high]] = [range(0), range(1)];
  const scale = Math.min(
    (BODY_WIDTH - 2 * BODY_MARGIN) / Math.max(right - left, 1),
    (BODY_HEIGHT - 2 * BODY_MARGIN) / Math.max(high - low, 1),
  );
  const x = (/** @type {number} */ value) => BODY_WIDTH / 2 + (value - (left + right) / 2) * scale;
  const y = (/** @type {number} */ value) => BODY_HEIGHT / 2 - (value - (low + high) / 2) * scale;
  return html`<svg
    class="rig-body"
    viewBox=${`0 0 ${BODY_WIDTH} ${BODY_HEIGHT}`}
    role="img"
    aria-label="The body, its joints coloured by their expected error; the table has the numbers"
  >
    ${figure.lines.map(([a, b, c, d]) => html`<line x1=${x(a)} y1=${y(b)} x2=${x(c)} y2=${y(d)} />`)}
    ${figure.points.map(
      ([across, up], at) => html`<circle
        cx=${x(across)}
        cy=${y(up)}
        r="9"
        style=${{ fill: heat(values[at] / most) }}
      >
        <title>${points[at]}: ${values[at].toFixed(1)} mm</title>
      </circle>`,
    )}
  </svg>`;
}
