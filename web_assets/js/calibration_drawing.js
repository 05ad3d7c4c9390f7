// A calibration drawn: the cameras from above, findings, residuals.

import { dotted, element, shape } from "./elements.js";
import { seriesColour, token } from "./theme.js";

const PERSON_MM = 250;
const ROOM_MM = 1500; // cameras that stand closer together look at something smaller than a person
const STEPS = [100, 250, 500, 1000, 2000, 5000, 10000, 20000, 50000];
const ARROW = 16;
const side = (across) => (Math.abs(across) < 0.4 ? "middle" : across < 0 ? "start" : "end");

/** A number with digits after the point; "–" for none. */
export const plainNumbers = (value, digits = 1) =>
  value === null || value === undefined ? "–" : value.toFixed(digits);

/**
 * The cameras seen from above: where they look, how high they stand, the axes, a person for scale
 * where there is room for one.
 */
export function rigFromAbove(rig) {
  const [width, height, margin] = [620, 320, 46];
  const across = rig.cameras.map((camera) => camera.position[0]).concat(0);
  const along = rig.cameras.map((camera) => camera.position[1]).concat(0);
  const [left, right, low, high] = [
    Math.min(...across),
    Math.max(...across),
    Math.min(...along),
    Math.max(...along),
  ];
  const scale = Math.min(
    (width - 2 * margin) / Math.max(right - left, 1e-3),
    (height - 2 * margin) / Math.max(high - low, 1e-3),
  );
  const at = (x, y) => [
    width / 2 + (x - (left + right) / 2) * scale,
    height / 2 - (y - (low + high) / 2) * scale,
  ];
  const step = STEPS.find((one) => one * scale >= 40) ?? STEPS[STEPS.length - 1];
  const lines = [];
  for (let k = -60; k <= 60; k += 1) {
    const [x] = at(k * step, 0);
    const [, y] = at(0, k * step);
    if (x >= 0 && x <= width)
      lines.push(shape("line", { x1: x, x2: x, y1: 0, y2: height, class: "grid" }));
    if (y >= 0 && y <= height)
      lines.push(shape("line", { x1: 0, x2: width, y1: y, y2: y, class: "grid" }));
  }
  const [ox, oy] = at(0, 0);
  const axis = (dx, dy, name, kind) => [
    shape("line", { x1: ox, y1: oy, x2: ox + dx, y2: oy + dy, class: `axis ${kind}` }),
    shape("text", { x: ox + dx * 1.35 - 3, y: oy + dy * 1.35 + 4, class: "name" }, name),
  ];
  const cameras = rig.cameras.flatMap((camera, index) => {
    const [x, y] = at(camera.position[0], camera.position[1]);
    const [fx, fy] = [camera.forward[0], -camera.forward[1]];
    const flat = Math.hypot(fx, fy);
    const [ux, uy] = flat > 0.05 ? [fx / flat, fy / flat] : [0, 0];
    const half = Math.atan(camera.width / 2 / camera.focal_px[0]);
    const ray = (turn) =>
      `${x + 34 * (ux * Math.cos(turn) - uy * Math.sin(turn))},${y + 34 * (ux * Math.sin(turn) + uy * Math.cos(turn))}`;
    const title = shape(
      "title",
      {},
      `${camera.name}: ${(camera.position[2] / 1000).toFixed(2)} m over the floor`,
    );
    return [
      shape(
        "polygon",
        {
          points: `${x},${y} ${ray(-half)} ${ray(half)}`,
          fill: seriesColour(index),
          "fill-opacity": 0.28,
          stroke: seriesColour(index),
        },
        title,
      ),
      shape("circle", { cx: x, cy: y, r: 4, fill: seriesColour(index) }),
      shape(
        "text",
        { x: x - ux * 10, y: y - uy * ARROW, "text-anchor": side(ux), class: "name" },
        camera.name,
      ),
      shape(
        "text",
        { x: x - ux * 10, y: y - uy * ARROW + 12, "text-anchor": side(ux), class: "quiet" },
        `${(camera.position[2] / 1000).toFixed(2)} m high`,
      ),
    ];
  });
  const isRoom = Math.max(right - left, high - low) >= ROOM_MM;
  const person = !isRoom
    ? []
    : [
        shape(
          "ellipse",
          {
            cx: ox,
            cy: oy,
            rx: Math.max(PERSON_MM * scale, 2),
            ry: Math.max(0.55 * PERSON_MM * scale, 1.2),
            class: "person",
          },
          shape("title", {}, "A person for scale: shoulders 0.5 m wide"),
        ),
        shape("circle", {
          cx: ox,
          cy: oy,
          r: Math.max(0.36 * PERSON_MM * scale, 1),
          class: "person",
        }),
      ];
  const bar = [
    shape("line", {
      x1: 14,
      x2: 14 + step * scale,
      y1: height - 12,
      y2: height - 12,
      class: "bar",
    }),
    shape(
      "text",
      { x: 14, y: height - 18, class: "quiet" },
      step >= 1000 ? `${step / 1000} m` : `${step} mm`,
    ),
  ];
  const drawn = shape(
    "svg",
    {
      viewBox: `0 0 ${width} ${height}`,
      class: "rig",
      role: "img",
      "aria-label": `${rig.cameras.length} cameras from above`,
    },
    ...lines,
    ...person,
    ...axis(30, 0, "X", "x"),
    ...axis(0, -30, "Y", "y"),
    ...cameras,
    ...bar,
  );
  return element(
    "figure",
    { className: "picture rig-picture" },
    drawn,
    element(
      "figcaption",
      {},
      element("b", {}, "From above"),
      dotted(
        rig.floor && `Floor: ${rig.floor}`,
        isRoom && "the shape at the origin is a person's shoulders and head",
      ),
    ),
  );
}

/**
 * The findings on a calibration, blocking ones first, each with its remedy.
 * @param {{ findings: any[] }} what
 */
export function findingList({ findings }) {
  if (!findings.length)
    return element("p", { className: "all-well" }, "✓ No fault found in this calibration.");
  return element(
    "ul",
    { className: "findings" },
    findings.map((one) =>
      element(
        "li",
        { className: one.severity, dataset: { code: one.code } },
        element("b", {}, one.severity === "blocks" ? "Wrong" : "Doubtful"),
        element("p", {}, one.message),
        element("p", { className: "remedy" }, one.remedy),
      ),
    ),
  );
}

/** A bar a picture: pixels that its corners are off; those left out are red. */
export function residualBars(lens) {
  const most = Math.max(...lens.pictures.map((one) => one.rms_px ?? 0), 0.2);
  const bars = lens.pictures.map((one, index) => {
    const tall = one.rms_px === null ? 34 : Math.max(2, (34 * one.rms_px) / most);
    const bar = shape("rect", {
      x: index * 8,
      y: 36 - tall,
      width: 6,
      height: tall,
      fill: one.dropped ? token("bad") : token("accent"),
    });
    bar.append(
      shape(
        "title",
        {},
        `${one.picture}: ${plainNumbers(one.rms_px, 2)} px${one.dropped ? `, left out (${one.dropped})` : ""}`,
      ),
    );
    return bar;
  });
  const words = `${lens.name}: residuals of ${lens.pictures.length} pictures, the largest ${plainNumbers(most, 2)} px`;
  return shape(
    "svg",
    {
      viewBox: `0 0 ${Math.max(lens.pictures.length * 8, 80)} 38`,
      class: "residuals",
      role: "img",
      "aria-label": words,
      preserveAspectRatio: "xMinYMax meet",
    },
    ...bars,
  );
}
