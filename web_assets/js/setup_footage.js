// Step Footage: what the cameras recorded, how it is turned, and whether it is in step.

import { fetchJson, patch, sessionPath } from "./api.js";
import {
  button,
  dotted,
  element,
  fill,
  hint,
  notice,
  optional,
  spring,
  table,
} from "./elements.js";
import { complain, say } from "./messages.js";
import { adder } from "./setup_adding.js";
import { synchroniser } from "./setup_synchrony.js";

const THUMB_HEIGHT = 420;
const FRAME_MILLISECONDS = 120;

/** @param {string} session */
export const load = (session) => fetchJson(`${sessionPath(session)}/footage`);

/** @type {import("./setup.js").Mount<typeof load>} */
export function mount(place, setup, loaded) {
  const here = sessionPath(setup.session);
  const list = element("section", { className: "footage-cameras" });
  const step = element("section", { className: "footage-step" });
  const add = element("details", { className: "footage-add" });
  const warnings = optional();
  let footage = loaded;
  let shown = 0; // the frame that is looked at
  let age = 0; // rises when the pictures changed
  let wait = 0;
  const sync = synchroniser(step, setup, (offsets) => change({ offsets }));
  place.append(list, warnings, step, add);

  const adding = adder(add, setup, async (job) => {
    age += 1;
    for (const note of job.notes) say(note);
    footage = await load(setup.session);
    show(job.warnings);
    await setup.refresh();
  });

  async function change(changes) {
    try {
      footage = await patch(`${here}/footage`, changes);
      for (const note of footage.notes)
        say(note, { kind: footage.stale_runs.length ? "warning" : "info" });
      age += 1;
    } catch (error) {
      complain(error);
    }
    draw();
    await setup.refresh();
  }

  function drawList() {
    const { cameras, fps, frame_count: count } = footage;
    fill(
      list,
      cameras.length > 0 && [
        hint(`${count} frames at ${Number(fps.toFixed(3))} a second are in all cameras.`),
        element(
          "div",
          { className: "scrolls" },
          table(
            ["camera", "size", "frames", "turned"],
            cameras.map((camera) => [
              camera.name,
              `${camera.width}×${camera.height}`,
              camera.frame_count,
              camera.turned ? `${camera.turned}°` : "–",
            ]),
          ),
        ),
      ],
    );
  }

  const pictureOf = (camera) =>
    `${here}/footage/${encodeURIComponent(camera.name)}/${Math.min(shown, footage.frame_count - 1)}.jpg?height=${THUMB_HEIGHT}&age=${age}`;

  function drawPictures() {
    const { cameras, frame_count: count } = footage;
    if (!cameras.length)
      return fill(
        setup.aside,
        element(
          "div",
          { className: "aside-empty" },
          element("p", {}, "The pictures of your cameras will be here."),
          hint(
            "Two cameras at least, better four: around the subject, each seeing all of it all the time.",
          ),
        ),
      );
    const images = cameras.map((camera) =>
      element("img", {
        src: pictureOf(camera),
        alt: `Camera ${camera.name}`,
        onerror: ({ target }) => {
          target.alt = `The footage of ${camera.name} cannot be read.`;
        },
      }),
    );
    const figures = cameras.map((camera, at) =>
      element(
        "figure",
        { className: "picture", dataset: { camera: camera.name } },
        images[at],
        element(
          "figcaption",
          {},
          element(
            "div",
            { className: "step-actions" },
            element("b", {}, camera.name),
            spring(),
            button(
              "↻ Turn",
              () => change({ rotations: { [camera.name]: (camera.turned + 90) % 360 } }),
              "small",
              { ariaLabel: `Turn ${camera.name} by 90 degrees clockwise` },
            ),
          ),
          dotted(
            `${camera.width}×${camera.height}`,
            `${camera.frame_count} frames`,
            camera.kind,
            camera.has_masks && "masks",
            camera.has_background && "background",
          ),
        ),
      ),
    );
    const label = element("output", {}, `frame ${shown}`);
    const slider = element("input", {
      type: "range",
      min: 0,
      max: count - 1,
      value: shown,
      ariaLabel: "Frame",
    });
    slider.oninput = () => {
      shown = Number(slider.value);
      label.textContent = `frame ${shown}`;
      clearTimeout(wait);
      wait = setTimeout(() => {
        for (const [at, camera] of cameras.entries()) images[at].src = pictureOf(camera);
      }, FRAME_MILLISECONDS);
    };
    fill(
      setup.aside,
      element(
        "div",
        { className: "pictures-bar" },
        slider,
        label,
        element("span", { className: "hint" }, "The same moment in every camera?"),
      ),
      element("div", { className: "pictures" }, figures),
    );
  }

  function draw() {
    shown = Math.min(shown, Math.max(0, footage.frame_count - 1));
    drawList();
    drawPictures();
    sync.draw(footage);
    adding.draw(footage.cameras.length > 0);
  }

  function show(words) {
    fill(
      warnings,
      words.map((each) => notice(each)),
    );
    draw();
  }

  const takeDropped = ({ detail }) => adding.take(detail);
  document.addEventListener("footage", /** @type {any} */ (takeDropped));
  show(setup.detail.warnings ?? []);
  if (setup.asked.dropped) adding.take(setup.asked.dropped).catch(complain);
  return () => {
    document.removeEventListener("footage", /** @type {any} */ (takeDropped));
    clearTimeout(wait);
    sync.stop();
    adding.stop();
  };
}
