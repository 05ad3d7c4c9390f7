// The same points of the floor clicked in two views or more.

import {
  button,
  element,
  failure,
  fill,
  hint,
  optional,
  picture as pictureOf,
} from "./elements.js";

const FEWEST = 3;

/**
 * Pixels of the stored picture under a point of the upright image: shares x, y (0..1) from its top
 * left corner.
 */
function storedPixel(camera, x, y) {
  const turned = [
    [x, y],
    [y, 1 - x],
    [1 - x, 1 - y],
    [1 - y, x],
  ][camera.quarter_turns % 4];
  return [turned[0] * camera.width - 0.5, turned[1] * camera.height - 0.5];
}

/** And back: shares in the upright image of a stored pixel. */
export function shownAt(camera, [u, v]) {
  const [a, b] = [(u + 0.5) / camera.width, (v + 0.5) / camera.height];
  return [
    [a, b],
    [1 - b, a],
    [1 - a, 1 - b],
    [b, 1 - a],
  ][camera.quarter_turns % 4];
}

/** Let a person click in `aside`; returns what ends that. */
export function clickFloor(aside, { cameras, picture, send, stop }) {
  const points = [{ pixels: {} }];
  let chosen = 0;
  const list = element("div", { className: "point-list" });
  const wrong = optional();
  const complete = () => points.filter((point) => Object.keys(point.pixels).length > 1);

  const done = button(
    "Set the floor",
    async () => {
      fill(wrong);
      try {
        await send(complete());
      } catch (error) {
        fill(wrong, failure(error));
      }
    },
    "primary",
  );

  const views = cameras.map((camera) => {
    const image = element("img", {
      src: picture(camera.name),
      alt: `Picture of ${camera.name}`,
      draggable: false,
    });
    const marks = element("div", { className: "marks" });
    const box = element("div", { className: "clickable" }, image, marks);
    box.onclick = (event) => {
      const shape = image.getBoundingClientRect();
      const [x, y] = [
        (event.clientX - shape.left) / shape.width,
        (event.clientY - shape.top) / shape.height,
      ];
      if (x < 0 || y < 0 || x > 1 || y > 1) return;
      points[chosen].pixels[camera.name] = storedPixel(camera, x, y);
      draw();
    };
    return { camera, marks, figure: pictureOf(box, camera.name) };
  });

  function draw() {
    const last = points.at(-1);
    if (last && Object.keys(last.pixels).length > 1 && points.length < 32)
      points.push({ pixels: {} });
    for (const { camera, marks } of views) {
      marks.replaceChildren(
        ...points.flatMap((point, index) => {
          if (!point.pixels[camera.name]) return [];
          const [x, y] = shownAt(camera, point.pixels[camera.name]);
          return [
            element(
              "i",
              {
                className: index === chosen ? "mark chosen" : "mark",
                style: `left: ${100 * x}%; top: ${100 * y}%`,
              },
              index + 1,
            ),
          ];
        }),
      );
    }
    fill(
      list,
      points.map((point, index) => {
        const seen = Object.keys(point.pixels).length;
        return button(
          `${index + 1} · ${seen > 1 ? `${seen} views` : seen ? "one view" : "new"}`,
          () => {
            chosen = index;
            draw();
          },
          "toggle small",
          { ariaPressed: String(index === chosen) },
        );
      }),
    );
    done.disabled = complete().length < FEWEST;
    done.title = done.disabled
      ? `Three points in two views each are needed (there are ${complete().length}).`
      : "";
  }

  fill(
    aside,
    element(
      "div",
      { className: "calibrated" },
      element("div", { className: "aside-actions" }, done, button("Cancel", stop, "quiet")),
      hint(
        "Click a point of the floor in one view and the same point in another; then choose the next number. The first becomes the origin, the second lies on X. Points far apart are best.",
      ),
      list,
      wrong,
      element(
        "div",
        { className: "pictures click-views" },
        views.map((one) => one.figure),
      ),
    ),
  );
  draw();
  return () => fill(aside);
}
