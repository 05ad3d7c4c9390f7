// A calibration drawn: the cameras from above, findings, residuals.

import { dotted } from "./elements.js";
import { html } from "./studio/component.js";
import { seriesColour, token } from "./theme.js";

const [WIDTH, HEIGHT, MARGIN] = [620, 320, 46];
const PERSON_MM = 250;
const ROOM_MM = 1500; // cameras that stand closer together look at something smaller than a person
const STEPS = [100, 250, 500, 1000, 2000, 5000, 10000, 20000, 50000];
const ARROW = 16;
const side = (across) => (Math.abs(across) < 0.4 ? "middle" : across < 0 ? "start" : "end");

/** A number with digits after the point; "–" for none. */
export const plainNumbers = (value, digits = 1) =>
  value === null || value === undefined ? "–" : value.toFixed(digits);

/**
 * Where the parts of the drawing are: a scale with all cameras and the origin in it, and how far
 * apart the grid's lines are.
 */
function planOf({ cameras }) {
  const across = cameras.map((camera) => camera.position[0]).concat(0);
  const along = cameras.map((camera) => camera.position[1]).concat(0);
  const [left, right, low, high] = [
    Math.min(...across),
    Math.max(...across),
    Math.min(...along),
    Math.max(...along),
  ];
  const scale = Math.min(
    (WIDTH - 2 * MARGIN) / Math.max(right - left, 1e-3),
    (HEIGHT - 2 * MARGIN) / Math.max(high - low, 1e-3),
  );
  return {
    scale,
    step: STEPS.find((one) => one * scale >= 40) ?? STEPS[STEPS.length - 1],
    isRoom: Math.max(right - left, high - low) >= ROOM_MM,
    at: (/** @type {number} */ x, /** @type {number} */ y) => [
      WIDTH / 2 + (x - (left + right) / 2) * scale,
      HEIGHT / 2 - (y - (low + high) / 2) * scale,
    ],
  };
}

/** @param {{ plan: ReturnType<typeof planOf> }} properties */
const Grid = ({ plan: { step, at } }) =>
  Array.from({ length: 121 }, (_, k) => at((k - 60) * step, (k - 60) * step)).map(
    ([x, y]) => html`
      ${x >= 0 && x <= WIDTH && html`<line x1=${x} x2=${x} y1="0" y2=${HEIGHT} class="grid" />`}
      ${y >= 0 && y <= HEIGHT && html`<line x1="0" x2=${WIDTH} y1=${y} y2=${y} class="grid" />`}
    `,
  );

const Axis = ({ from: [x, y], dx, dy, name }) => html`
  <line x1=${x} y1=${y} x2=${x + dx} y2=${y + dy} class=${`axis ${name.toLowerCase()}`} />
  <text x=${x + dx * 1.35 - 3} y=${y + dy * 1.35 + 4} class="name">${name}</text>
`;

/** A camera from above: what it sees, how high it stands. */
function Camera({ plan, camera, colour }) {
  const [x, y] = plan.at(camera.position[0], camera.position[1]);
  const [fx, fy] = [camera.forward[0], -camera.forward[1]];
  const flat = Math.hypot(fx, fy);
  const [ux, uy] = flat > 0.05 ? [fx / flat, fy / flat] : [0, 0];
  const half = Math.atan(camera.width / 2 / camera.focal_px[0]);
  const ray = (/** @type {number} */ turn) => {
    const [c, s] = [Math.cos(turn), Math.sin(turn)];
    return `${x + 34 * (ux * c - uy * s)},${y + 34 * (ux * s + uy * c)}`;
  };
  const high = `${(camera.position[2] / 1000).toFixed(2)} m`;
  const [tx, ty, anchor] = [x - ux * 10, y - uy * ARROW, side(ux)];
  return html`
    <polygon
      points=${`${x},${y} ${ray(-half)} ${ray(half)}`}
      fill=${colour}
      fill-opacity="0.28"
      stroke=${colour}
    >
      <title>${camera.name}: ${high} over the floor</title>
    </polygon>
    <circle cx=${x} cy=${y} r="4" fill=${colour} />
    <text x=${tx} y=${ty} text-anchor=${anchor} class="name">${camera.name}</text>
    <text x=${tx} y=${ty + 12} text-anchor=${anchor} class="quiet">${high} high</text>
  `;
}

const Person = ({ at: [x, y], scale }) => html`
  <ellipse
    cx=${x}
    cy=${y}
    rx=${Math.max(PERSON_MM * scale, 2)}
    ry=${Math.max(0.55 * PERSON_MM * scale, 1.2)}
    class="person"
  >
    <title>A person for scale: shoulders 0.5 m wide</title>
  </ellipse>
  <circle cx=${x} cy=${y} r=${Math.max(0.36 * PERSON_MM * scale, 1)} class="person" />
`;

/**
 * The cameras seen from above: where they look, how high they stand, the axes, a person for scale
 * where one is tracked and there is room.
 * @param {{ rig: any, isPerson: boolean }} properties
 */
export function RigFromAbove({ rig, isPerson }) {
  const plan = planOf(rig);
  const { scale, step } = plan;
  const hasScale = isPerson && plan.isRoom;
  const origin = plan.at(0, 0);
  return html`<figure class="picture rig-picture">
    <svg
      viewBox=${`0 0 ${WIDTH} ${HEIGHT}`}
      class="rig"
      role="img"
      aria-label=${`${rig.cameras.length} cameras from above`}
    >
      <${Grid} plan=${plan} />
      ${hasScale && html`<${Person} at=${origin} scale=${scale} />`}
      <${Axis} from=${origin} dx=${30} dy=${0} name="X" />
      <${Axis} from=${origin} dx=${0} dy=${-30} name="Y" />
      ${rig.cameras.map(
        (camera, at) =>
          html`<${Camera} plan=${plan} camera=${camera} colour=${seriesColour(at)} />`,
      )}
      <line x1="14" x2=${14 + step * scale} y1=${HEIGHT - 12} y2=${HEIGHT - 12} class="bar" />
      <text x="14" y=${HEIGHT - 18} class="quiet">
        ${step >= 1000 ? `${step / 1000} m` : `${step} mm`}
      </text>
    </svg>
    <figcaption>
      <b>From above</b>
      ${dotted(
        rig.floor && `Floor: ${rig.floor}`,
        hasScale && "the shape at the origin is a person's shoulders and head",
      )}
    </figcaption>
  </figure>`;
}

/**
 * The findings on a calibration, blocking ones first, each with its remedy.
 * @param {{ findings: any[] }} properties
 */
export const Findings = ({ findings }) =>
  findings.length
    ? html`<ul class="findings">
        ${findings.map(
          ({ severity, code, message, remedy }) => html`<li class=${severity} data-code=${code}>
            <b>${severity === "blocks" ? "Wrong" : "Doubtful"}</b>
            <p>${message}</p>
            <p class="remedy">${remedy}</p>
          </li>`,
        )}
      </ul>`
    : html`<p class="all-well">✓ No fault found in this calibration.</p>`;

/** A bar a picture: pixels that its corners are off; those left out are red. */
export function Residuals({ lens: { name, pictures } }) {
  const most = Math.max(...pictures.map((one) => one.rms_px ?? 0), 0.2);
  return html`<svg
    viewBox=${`0 0 ${Math.max(pictures.length * 8, 80)} 38`}
    class="residuals"
    role="img"
    aria-label=${`${name}: residuals of ${pictures.length} pictures, the largest ${plainNumbers(most, 2)} px`}
    preserveAspectRatio="xMinYMax meet"
  >
    ${pictures.map(({ picture, rms_px: off, dropped }, at) => {
      const tall = off === null ? 34 : Math.max(2, (34 * off) / most);
      const fill = token(dropped ? "bad" : "accent");
      return html`<rect x=${at * 8} y=${36 - tall} width="6" height=${tall} fill=${fill}>
        <title>
          ${`${picture}: ${plainNumbers(off, 2)} px${dropped ? `, left out (${dropped})` : ""}`}
        </title>
      </rect>`;
    })}
  </svg>`;
}
