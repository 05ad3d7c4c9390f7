// Step Footage: what the cameras recorded, how it is turned, and whether it is in step.

import { button, element } from "./elements.js";
import { complain, say } from "./messages.js";
import { adder } from "./way_adding.js";
import { synchroniser } from "./way_synchrony.js";

const THUMB_HEIGHT = 420;
const FRAME_MILLISECONDS = 120;

export function mount(place, way) {
  const { fetchJson, patch, sessionPath } = way.api;
  const here = sessionPath(way.session);
  const list = element("section", { className: "footage-cameras" });
  const step = element("section", { className: "footage-step" });
  const add = element("details", { className: "footage-add" });
  const doubts = element("div", {});
  const state = { told: null, frame: 0, age: 0, wait: 0 };
  const sync = synchroniser(step, way, { offered: applyOffsets });
  place.append(list, doubts, step, add);

  const adding = adder(add, way, async (told) => {
    state.age += 1;
    for (const note of told.notes) say(note);
    await draw(told.warnings);
    await way.refresh();
  });

  async function change(wish) {
    try {
      state.told = await patch(`${here}/footage`, wish);
      for (const note of state.told.notes) say(note, { kind: state.told.stale_runs.length ? "warning" : "info" });
      state.age += 1;
    } catch (error) { complain(error); }
    drawAll();
    await way.refresh();
  }

  async function applyOffsets(offsets) { await change({ offsets }); }

  function facts(camera) {
    const more = [camera.has_masks && "masks", camera.has_background && "background"].filter(Boolean);
    return [`${camera.width}×${camera.height}`, `${camera.frame_count} frames`, camera.kind, ...more].join(" · ");
  }

  function drawList() {
    const { cameras, fps, frame_count: count } = state.told;
    if (!cameras.length) return list.replaceChildren();
    const rows = cameras.map((camera) => element("tr", {}, element("td", { textContent: camera.name }), element("td", { textContent: `${camera.width}×${camera.height}` }),
      element("td", { textContent: camera.frame_count }), element("td", { textContent: camera.turned ? `${camera.turned}°` : "–" })));
    list.replaceChildren(element("p", { className: "hint", textContent: `${count} frames at ${Number(fps.toFixed(3))} a second are in all cameras.` }),
      element("div", { className: "scrolls" }, element("table", { className: "figures" }, element("thead", {}, element("tr", {}, ...["camera", "size", "frames", "turned"].map((head) => element("th", { textContent: head })))), element("tbody", {}, ...rows))));
  }

  const pictureOf = (camera) => `${here}/footage/${encodeURIComponent(camera.name)}/${Math.min(state.frame, state.told.frame_count - 1)}.jpg?height=${THUMB_HEIGHT}&age=${state.age}`;

  function drawPictures() {
    const { cameras, frame_count: count } = state.told;
    if (!cameras.length) {
      way.aside.replaceChildren(element("div", { className: "aside-empty" }, element("p", { textContent: "The pictures of your cameras will be here." }),
        element("p", { className: "hint", textContent: "Two cameras at least, better four: around the person, each seeing head and feet all the time." })));
      return;
    }
    const figures = cameras.map((camera) => {
      const image = element("img", { src: pictureOf(camera), alt: `Camera ${camera.name}` });
      image.onerror = () => { image.alt = `The footage of ${camera.name} cannot be read.`; };
      const turn = button("↻ Turn", () => change({ rotations: { [camera.name]: (camera.turned + 90) % 360 } }), "small");
      turn.setAttribute("aria-label", `Turn ${camera.name} by 90 degrees clockwise`);
      const figure = element("figure", { className: "picture" }, image, element("figcaption", {}, element("div", { className: "step-actions" }, element("b", { textContent: camera.name }), element("span", { className: "spring" }), turn), facts(camera)));
      figure.dataset.camera = camera.name;
      return figure;
    });
    const slider = element("input", { type: "range", min: 0, max: count - 1, value: state.frame, ariaLabel: "Frame" });
    const label = element("output", { textContent: `frame ${state.frame}` });
    slider.oninput = () => {
      state.frame = Number(slider.value);
      label.textContent = `frame ${state.frame}`;
      clearTimeout(state.wait);
      state.wait = setTimeout(() => {
        for (const figure of way.aside.querySelectorAll("figure")) figure.querySelector("img").src = pictureOf(cameras.find((one) => one.name === figure.dataset.camera));
      }, FRAME_MILLISECONDS);
    };
    way.aside.replaceChildren(element("div", { className: "pictures-bar" }, slider, label, element("span", { className: "hint", textContent: "The same moment in every camera?" })), element("div", { className: "pictures" }, ...figures));
  }

  function drawAll() {
    state.frame = Math.min(state.frame, Math.max(0, state.told.frame_count - 1));
    drawList();
    drawPictures();
    sync.draw(state.told);
    const there = state.told.cameras.length > 0;
    adding.draw(there, there && way.step?.state === "done");
  }

  async function draw(warnings) {
    state.told = await fetchJson(`${here}/footage`);
    doubts.replaceChildren(...warnings.map((words) => element("p", { className: "notice", textContent: words })));
    drawAll();
  }

  draw(way.detail.warnings ?? []).catch(complain);
  return () => { clearTimeout(state.wait); sync.stop(); adding.stop(); };
}
