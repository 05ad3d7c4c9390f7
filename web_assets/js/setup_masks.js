// The pictures of all views with their masks, in a frame that can be chosen; knobs that are tried
// show at once.

import { sessionPath } from "./api.js";
import { button, check, element, fill, spring } from "./elements.js";
import { agreementOf } from "./setup_quality.js";

const HEIGHT = 420;
const SPREAD = 5;

/**
 * Pictures in `setup.aside`; `paint(camera)` opens the brush, `strokes(camera)` that for strokes.
 * @param {import("./setup.js").Setup} setup
 */
export function maskPictures(setup, paint, strokes) {
  const here = sessionPath(setup.session);
  const state = {
    frame: 0,
    settings: {},
    quality: null,
    views: [],
    age: 0,
    bare: false,
    cutting: false,
  };
  const bar = element("div", { className: "mask-bar" });
  const grid = element("div", { className: "pictures masks" });

  /**
   * Before the first mask the picture alone, as it is recorded: a session's first masks take their
   * time.
   */
  function first(camera) {
    const lens = setup.detail.cameras.find((one) => one.name === camera);
    return lens?.quarter_turns
      ? ""
      : `${here}/footage/${encodeURIComponent(camera)}/${state.frame}.jpg?height=${HEIGHT}`;
  }

  function address(camera) {
    const settings = Object.keys(state.settings).length
      ? `&settings=${encodeURIComponent(JSON.stringify(state.settings))}`
      : "";
    const show = state.bare || state.cutting ? "" : "mask";
    return `${here}/frames/${state.frame}/views/${encodeURIComponent(camera)}.jpg?show=${show}&height=${HEIGHT}&age=${state.age}${settings}`;
  }

  /** One request a picture at a time; later requests follow afterwards. */
  function load(view) {
    const wanted = (view.seen ? "" : first(view.camera.name)) || address(view.camera.name);
    if (view.busy || view.wanted === wanted) return;
    view.wanted = wanted;
    view.busy = true;
    view.box.classList.add("waiting");
    const done = (wrong) => {
      view.busy = false;
      view.box.classList.remove("waiting");
      view.seen = true;
      view.box.classList.toggle("failed", wrong);
      if (grid.isConnected) load(view);
    };
    view.image.onload = () => done(false);
    view.image.onerror = () => done(true);
    view.image.src = wanted;
  }

  function draw() {
    for (const view of state.views) load(view);
  }

  function caption(view) {
    const line = state.quality?.cameras.find((one) => one.camera === view.camera.name);
    fill(
      view.caption,
      element(
        "div",
        { className: "head-line" },
        element("b", {}, view.camera.name),
        line &&
          element(
            "span",
            { className: `badge ${line.usable ? "good" : "bad"}` },
            line.agreement === null ? "empty" : agreementOf(line),
          ),
        view.camera.excluded && element("span", { className: "hint" }, "regions excluded"),
        spring(),
        view.strokes,
        view.brush,
      ),
    );
  }

  function begin({ frame_count: count, cameras }) {
    const last = Math.max(0, count - 1);
    state.frame = Math.min(last, Math.floor(count / 2));
    const output = element("output", {}, `frame ${state.frame}`);
    const slider = element("input", {
      type: "range",
      min: 0,
      max: last,
      value: state.frame,
      ariaLabel: "Frame",
    });
    const go = () => {
      state.frame = Number(slider.value);
      output.textContent = `frame ${state.frame}`;
      draw();
    };
    slider.oninput = go;
    const apart = Math.max(1, Math.round(last / SPREAD));
    const step = (words, by, ariaLabel) =>
      button(
        words,
        () => {
          slider.value = String(state.frame + by);
          go();
        },
        "small",
        { ariaLabel },
      );
    fill(
      bar,
      step("‹", -apart, "Some frames back"),
      slider,
      step("›", apart, "Some frames on"),
      output,
      check("picture alone", {
        onchange: ({ target }) => {
          state.bare = target.checked;
          draw();
        },
      }),
    );
    state.views = cameras.map((camera) => {
      const view = {
        camera,
        image: element("img", { alt: `Mask of ${camera.name}` }),
        caption: element("figcaption"),
        box: null,
        strokes: button("Strokes…", () => strokes(camera.name), "small", {
          ariaLabel: `Paint strokes of ${camera.name}`,
        }),
        brush: button("Exclude…", () => paint(camera.name), "small", {
          ariaLabel: `Exclude regions of ${camera.name}`,
        }),
      };
      view.box = element("figure", { className: "picture" }, view.image, view.caption);
      caption(view);
      return view;
    });
    fill(
      grid,
      state.views.map((view) => view.box),
    );
    show();
  }

  function show() {
    fill(setup.aside, bar, grid);
    state.age += 1;
    draw();
  }

  return {
    begin,
    show,
    get frame() {
      return state.frame;
    },
    go(frame) {
      state.frame = frame;
      const slider = bar.querySelector("input");
      if (slider) {
        slider.value = String(frame);
        bar.querySelector("output").textContent = `frame ${frame}`;
      }
    },
    /** While new masks are cut the old ones are not shown: they would pass for the result. */
    cut(isGoing) {
      if (state.cutting === isGoing) return;
      state.cutting = isGoing;
      state.age += 1;
      grid.classList.toggle("cutting", isGoing);
      draw();
    },
    preview(settings) {
      state.settings = { ...settings };
      state.age += 1;
      draw();
    },
    rate(quality) {
      state.quality = quality;
      for (const view of state.views) caption(view);
    },
    mark(cameras) {
      for (const view of state.views) {
        view.camera = cameras.find((one) => one.name === view.camera.name) ?? view.camera;
        caption(view);
      }
    },
    close() {
      for (const view of state.views) {
        view.image.onload = view.image.onerror = null;
        view.image.removeAttribute("src");
      }
    },
  };
}
