// A race drawn: the silhouette of a problem in one camera, or its body in space, and every racer's heaviest pose after
// so many evaluations. Used by the race's own page (studio/results/arena/race_files.py) and by the studio's.

import { BodyDrawing } from "./body_drawing.js";
import { seriesToken } from "./chart_looks.js";
import { element, field, fill, hint, select, shape } from "./elements.js";

/** @typedef {{ lines: number[][], limbs: number[][][], left: number | null }} Drawn */

const WIDE = 2.5; // pixels of a racer's lines
const FAINT = 0.35; // how solid the heaviest known pose stands among the racers' lines

/** Fill a place with the pictures of a race (`drawn` of race.json), one problem at a time. */
export function drawRace(place, problems) {
  const drawable = problems.filter((problem) => problem.counts.length);
  place.classList.add("race");
  if (!drawable.length) return fill(place, hint("No racer's pose was kept."));
  const names = [...new Set(drawable.flatMap((problem) => Object.keys(problem.racers)))];
  const tokens = new Map(names.map((name, at) => [name, seriesToken(at)]));
  const hidden = new Set();
  const space = spaceDrawing();
  let isInSpace = false;
  let problem = drawable[0];
  let at = problem.counts.length - 1;

  const turn = (name) => {
    if (!hidden.delete(name)) hidden.add(name);
    draw();
  };

  function draw() {
    at = Math.min(at, problem.counts.length - 1);
    const count = problem.counts[at];
    const inSpace = isInSpace && Boolean(problem.best_limbs);
    const slider = element("input", {
      type: "range",
      min: "0",
      max: String(problem.counts.length - 1),
      value: String(at),
      ariaLabel: "Evaluations",
      ariaValueText: String(count),
      oninput: ({ target }) => {
        at = Number(target.value);
        draw();
      },
    });
    fill(
      place,
      element("h2", {}, "Who is where"),
      element(
        "div",
        { className: "race-choice" },
        field(
          "Problem",
          select(
            drawable.map((one) => [one.name, `${one.name} (${one.kind})`]),
            problem.name,
            {
              ariaLabel: "Problem",
              onchange: ({ target }) => {
                problem = drawable.find((one) => one.name === target.value);
                draw();
              },
            },
          ),
        ),
        // A race that was kept before 28 November 2026 has no limbs.
        problem.best_limbs &&
          field(
            "Seen",
            select(
              [
                ["picture", `by camera ${problem.camera}`],
                ["space", "in space, from any side"],
              ],
              isInSpace ? "space" : "picture",
              {
                ariaLabel: "Seen",
                onchange: ({ target }) => {
                  isInSpace = target.value === "space";
                  draw();
                },
              },
            ),
          ),
        field(`After ${count} evaluations`, slider),
      ),
      element(
        "div",
        { className: "race-picture" },
        inSpace
          ? space.drawn(problem, count, shown(problem, hidden), tokens)
          : picture(problem, count, tokens, hidden),
        standing(problem, count, tokens, hidden, turn),
      ),
      hint(
        inSpace
          ? `${problem.about}: the heaviest known pose (the body) and each racer's heaviest with seed 0. Drag to turn, or use the arrow keys.`
          : `${problem.about}, camera ${problem.camera}: the silhouette, the start pose (dashed), the heaviest known pose (wide), and each racer's heaviest with seed 0.`,
      ),
    );
  }

  draw();
}

const shown = (problem, hidden) =>
  Object.entries(problem.racers).filter(([name]) => !hidden.has(name));

/** The race in space: one canvas, which keeps its view while counts and racers change. */
function spaceDrawing() {
  let drawing = null;
  let of = null;
  return {
    drawn(problem, count, racers, tokens) {
      if (of !== problem) {
        drawing?.close();
        const canvas = element("canvas", { className: "race-space" });
        canvas.setAttribute("role", "img");
        drawing = new BodyDrawing(canvas, problem.shapes, problem.best_limbs);
        drawing.over([], FAINT);
        of = problem;
      }
      const { canvas } = drawing;
      canvas.ariaLabel = label(racers, count);
      drawing.lines = racers.flatMap(([name, known]) =>
        (known[count]?.limbs ?? []).map(([from, to]) => [from, to, tokens.get(name), WIDE]),
      );
      drawing.show(problem.best_limbs);
      return canvas;
    },
  };
}

const label = (racers, count) =>
  `Poses of ${racers.map(([name]) => name).join(", ")} after ${count} evaluations`;

const lines = (segments, attributes) =>
  shape("path", {
    fill: "none",
    "stroke-linecap": "round",
    "vector-effect": "non-scaling-stroke",
    d: segments.map(([x, y, toX, toY]) => `M${x} ${y}L${toX} ${toY}`).join(""),
    ...attributes,
  });

function picture(problem, count, tokens, hidden) {
  const racers = shown(problem, hidden);
  return shape(
    "svg",
    {
      viewBox: box(problem),
      role: "img",
      "aria-label": label(racers, count),
    },
    shape("path", {
      class: "race-silhouette",
      d: problem.outline.map((line) => `M${line.map(([x, y]) => `${x} ${y}`).join("L")}Z`).join(""),
    }),
    lines(problem.best, { class: "race-best" }),
    lines(problem.start, { class: "race-start" }),
    ...racers
      .filter(([, drawn]) => drawn[count])
      .map(([name, drawn]) =>
        lines(drawn[count].lines, {
          class: "race-pose",
          style: `stroke: var(--${tokens.get(name)})`,
        }),
      ),
  );
}

/** What is seen of the picture: everything that is drawn, with some room. */
function box(problem) {
  const points = [
    ...problem.outline.flat(),
    ...[...problem.best, ...problem.start].flatMap(([x, y, toX, toY]) => [
      [x, y],
      [toX, toY],
    ]),
  ];
  const [xs, ys] = [0, 1].map((axis) => points.map((point) => point[axis]));
  const room = 0.05 * Math.max(problem.width, problem.height);
  const [left, top] = [Math.min(...xs) - room, Math.min(...ys) - room];
  return `${left} ${top} ${Math.max(...xs) + room - left} ${Math.max(...ys) + room - top}`;
}

/** The racers in the order of the race, each with the share of the way that is left. */
function standing(problem, count, tokens, hidden, turn) {
  const known = Object.entries(problem.racers).map(([name, drawn]) => ({
    name,
    left: drawn[count]?.left ?? null,
  }));
  known.sort((one, other) => (one.left ?? Infinity) - (other.left ?? Infinity));
  return element(
    "ol",
    { className: "race-standing" },
    ...known.map(({ name, left }) => {
      const mark = element("i", {});
      mark.style.setProperty("--swatch", `var(--${tokens.get(name)})`);
      return element(
        "li",
        {},
        element(
          "button",
          {
            type: "button",
            ariaPressed: String(!hidden.has(name)),
            title: "Show or hide",
            onclick: () => turn(name),
          },
          mark,
          name,
          element(
            "span",
            {},
            left === null ? "nothing yet" : `${(100 * left).toFixed(left < 0.1 ? 1 : 0)} % left`,
          ),
        ),
      );
    }),
  );
}
