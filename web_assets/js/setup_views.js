// All cameras' pictures of one frame beside the step, with what a run found drawn over them; or the
// scene instead.

import { post, runPath } from "./api.js";
import { openPicture } from "./studio/dialogs.js";
import { check, element, fill, picture, showPicture, spring } from "./elements.js";
import { complain } from "./messages.js";
import { loadScene } from "./scene_window.js";
import { studioPath } from "./sessions.js";

const HEIGHT = 420;
const LARGE = 1080;

/**
 * The wall in `setup.aside`. show({run, frame, track, show}) draws; empty(words) says why there is
 * nothing.
 * @param {import("./setup.js").Setup} setup
 */
export function viewWall(setup) {
  let shown = null; // what is shown: run, frame, track, show
  let stopped = false;
  const label = element("output", {});
  const slot = element("div", { className: "wall-tools" });
  const wantsScene = check("3-D scene", { onchange: draw });
  const open = element(
    "a",
    {
      className: "link-button",
      title: "This run and frame in the studio, where its search can be looked into",
    },
    "Open in the studio",
  );
  const bar = element(
    "div",
    { className: "pictures-bar" },
    slot,
    label,
    spring(),
    open,
    wantsScene,
  );
  const views = setup.detail.cameras.map(({ name }) => {
    const image = element("img", {
      alt: `View of ${name}`,
      onclick: () => openPicture(name, () => address(name, LARGE)),
    });
    const note = element("span", {});
    return { name, image, note, figure: picture(image, name, note) };
  });
  const wall = element(
    "div",
    { className: "pictures" },
    views.map((view) => view.figure),
  );

  const address = (camera, height) =>
    `${runPath(setup.session, shown.run)}/frames/${shown.frame}/views/${encodeURIComponent(camera)}.jpg?show=${shown.show}&height=${height}${shown.track ? `&track=${shown.track}` : ""}`;

  function draw() {
    if (!shown || stopped) return;
    const { run, frame, track } = shown;
    label.textContent = `frame ${frame}`;
    open.href = studioPath(setup.session, run, {
      frame,
      panel: "why",
      ...(track ? { track } : {}),
    });
    if (!bar.isConnected) fill(setup.aside, bar);
    if (wantsScene.querySelector("input")?.checked) {
      wall.remove();
      if (!setup.aside.querySelector("iframe"))
        setup.aside.append(
          loadScene(element("iframe", { title: "3-D scene", className: "below-bar" })),
        );
      post("/api/scene/show", {
        session: setup.session,
        run,
        frame,
        ...(track ? { options: { track } } : {}),
      }).catch(complain);
      return;
    }
    setup.aside.querySelector("iframe")?.remove();
    if (!wall.isConnected) setup.aside.append(wall);
    for (const { image, name } of views) showPicture(image, address(name, HEIGHT));
  }

  return {
    tools: slot,
    /** What stands under a camera's picture. */
    note(camera, words, className = "") {
      const view = views.find((one) => one.name === camera);
      if (view) Object.assign(view.note, { textContent: words, className });
    },
    show(wanted) {
      shown = wanted;
      draw();
    },
    empty(words) {
      shown = null;
      fill(setup.aside, element("div", { className: "aside-empty" }, element("p", {}, words)));
    },
    stop() {
      stopped = true;
    },
  };
}
