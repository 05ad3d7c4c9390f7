// All cameras' pictures of one frame beside the step, with what a run found drawn over them; or the scene instead.

import { openPicture } from "./dialogs.js";
import { element } from "./elements.js";
import { complain } from "./messages.js";
import { loadScene } from "./scene_window.js";

const HEIGHT = 420;
const LARGE = 1080;

/** The wall in `way.aside`. show({run, frame, track, show}) draws; empty(words) says why there is nothing. */
export function viewWall(way) {
  const { runPath } = way.api;
  const state = { wish: null, scene: false, stopped: false };
  const label = element("output", {});
  const scene = element("input", { type: "checkbox" });
  const slot = element("div", { className: "wall-tools" });
  const bar = element("div", { className: "pictures-bar" }, slot, label, element("span", { className: "spring" }), element("label", { className: "check" }, scene, "3-D scene"));
  const figures = way.detail.cameras.map((camera) => {
    const image = element("img", { alt: `View of ${camera.name}` });
    const note = element("span", {});
    const figure = element("figure", { className: "picture" }, image, element("figcaption", {}, element("b", { textContent: camera.name }), note));
    image.onclick = () => openPicture(camera.name, address(camera.name, LARGE));
    return { camera: camera.name, figure, image, note };
  });
  const wall = element("div", { className: "pictures" }, ...figures.map((one) => one.figure));
  scene.onchange = () => { state.scene = scene.checked; draw(); };

  function address(camera, height) {
    const { run, frame, track, show } = state.wish;
    return `${runPath(way.session, run)}/frames/${frame}/views/${encodeURIComponent(camera)}.jpg?show=${show}&height=${height}${track ? `&track=${track}` : ""}`;
  }

  /** Swap a picture when the next one is decoded; the newest wish wins. */
  function swap(one) {
    const wanted = address(one.camera, HEIGHT);
    if (one.wanted === wanted) return;
    one.wanted = wanted;
    if (one.busy) return;
    one.busy = true;
    const next = new Image();
    const done = () => {
      one.busy = false;
      if (!state.stopped && one.wanted !== wanted) { one.wanted = null; swap(one); }
    };
    next.onload = () => { one.image.src = wanted; done(); };
    next.onerror = done;
    next.src = wanted;
  }

  function draw() {
    if (!state.wish || state.stopped) return;
    label.textContent = `frame ${state.wish.frame}`;
    if (!bar.isConnected) way.aside.replaceChildren(bar);
    if (state.scene) {
      wall.remove();
      if (!way.aside.querySelector("iframe")) way.aside.append(loadScene(element("iframe", { title: "3-D scene", className: "below-bar" })));
      const { run, frame, track } = state.wish;
      way.api.post("/api/scene/show", { session: way.session, run, frame, ...(track ? { options: { track } } : {}) }).catch(complain);
      return;
    }
    way.aside.querySelector("iframe")?.remove();
    if (!wall.isConnected) way.aside.append(wall);
    figures.forEach(swap);
  }

  return {
    tools: slot,
    /** What stands under a camera's picture. */
    note(camera, words, className = "") {
      const one = figures.find((entry) => entry.camera === camera);
      if (one) { one.note.textContent = words; one.note.className = className; }
    },
    show(wish) { state.wish = wish; draw(); },
    empty(words) { state.wish = null; way.aside.replaceChildren(element("div", { className: "aside-empty" }, element("p", { textContent: words }))); },
    stop() { state.stopped = true; },
  };
}
