// The pictures of all views with their masks, in a frame that can be chosen; knobs that are tried show at once.

import { button, element } from "./elements.js";

const HEIGHT = 420;
const SPREAD = 5;

/** Pictures in `way.aside`; `paint(camera)` opens the brush. */
export function maskPictures(way, paint) {
  const state = { frame: 0, settings: {}, told: null, quality: null, views: [], age: 0, playing: false };
  const bar = element("div", { className: "mask-bar" });
  const grid = element("div", { className: "pictures masks" });

  /** Before the first mask the picture alone, as it is recorded: a session's first masks take their time. */
  function first(camera) {
    const lens = way.detail.cameras.find((one) => one.name === camera);
    return lens?.quarter_turns ? "" : `${way.api.sessionPath(way.session)}/footage/${encodeURIComponent(camera)}/${state.frame}.jpg?height=${HEIGHT}`;
  }

  function address(camera) {
    const settings = Object.keys(state.settings).length ? `&settings=${encodeURIComponent(JSON.stringify(state.settings))}` : "";
    const show = state.bare ? "" : "mask";
    return `${way.api.sessionPath(way.session)}/frames/${state.frame}/views/${encodeURIComponent(camera)}.jpg?show=${show}&height=${HEIGHT}&age=${state.age}${settings}`;
  }

  /** One request a picture at a time; what was wished meanwhile is asked for afterwards. */
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

  function draw() { for (const view of state.views) load(view); }

  function caption(view) {
    const line = state.quality?.cameras.find((one) => one.camera === view.camera.name);
    const kind = !line ? "" : line.usable ? "good" : "bad";
    view.caption.replaceChildren(element("div", { className: "head-line" }, element("b", { textContent: view.camera.name }),
      line && element("span", { className: `badge ${kind}`, textContent: line.agreement === null ? "empty" : `${Math.round(100 * line.agreement)} %` }),
      view.camera.excluded && element("span", { className: "hint", textContent: "regions excluded" }), element("span", { className: "spring" }), view.brush));
  }

  function begin(told) {
    state.told = told;
    const last = Math.max(0, told.frame_count - 1);
    state.frame = Math.min(last, Math.floor(told.frame_count / 2));
    const output = element("output", { textContent: `frame ${state.frame}` });
    const slider = element("input", { type: "range", min: 0, max: last, value: state.frame, ariaLabel: "Frame" });
    slider.oninput = () => { state.frame = Number(slider.value); output.textContent = `frame ${state.frame}`; draw(); };
    const step = (by) => { slider.value = state.frame + by; slider.oninput(); };
    const bare = element("input", { type: "checkbox" });
    bare.onchange = () => { state.bare = bare.checked; draw(); };
    const apart = Math.max(1, Math.round(last / SPREAD));
    bar.replaceChildren(button("‹", () => step(-apart), "small"), slider, button("›", () => step(apart), "small"), output, element("label", { className: "check" }, bare, "picture alone"));
    bar.firstChild.setAttribute("aria-label", "Some frames back");
    bar.children[2].setAttribute("aria-label", "Some frames on");
    state.views = told.cameras.map((camera) => {
      const view = { camera, image: element("img", { alt: `Mask of ${camera.name}` }), caption: element("figcaption"), brush: button("Exclude…", () => paint(camera.name), "small") };
      view.brush.setAttribute("aria-label", `Exclude regions of ${camera.name}`);
      view.box = element("figure", { className: "picture" }, view.image, view.caption);
      caption(view);
      return view;
    });
    grid.replaceChildren(...state.views.map((view) => view.box));
    show();
  }

  function show() {
    way.aside.replaceChildren(bar, grid);
    state.age += 1;
    draw();
  }

  return {
    begin, show,
    get frame() { return state.frame; },
    preview(settings) { state.settings = { ...settings }; state.age += 1; draw(); },
    tell(quality) {
      state.quality = quality;
      for (const view of state.views) caption(view);
    },
    mark(cameras) {
      for (const view of state.views) { view.camera = cameras.find((one) => one.name === view.camera.name) ?? view.camera; caption(view); }
    },
    close() { for (const view of state.views) { view.image.onload = view.image.onerror = null; view.image.removeAttribute("src"); } },
  };
}
