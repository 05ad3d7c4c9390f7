// A camera's picture, upright, to paint over with mouse, pen or keyboard: what brush and strokes
// have in common.

import { sessionPath } from "./api.js";
import { element } from "./elements.js";

const PICTURE_HEIGHT = 1080;

/** Width and height of a camera's picture, upright. @returns {[number, number]} */
export function upright({
  picture_width: width,
  picture_height: height,
  quarter_turns: turns = 0,
}) {
  return turns % 2 ? [height, width] : [width, height];
}

/**
 * The picture of `lens` (name, picture_width, picture_height, quarter_turns) under a canvas. Places
 * are pixels of the upright picture, whose first pixel has its middle at `-centre + 0.5`; an arrow
 * key goes a `slowness`-th of the brush. `begin(at)`, `to(at, isKey)` and `end()` paint a stroke,
 * `dress(ring)` shows on the brush what it paints, `keys` are other keys' doings.
 * @param {import("./setup.js").Setup} setup
 * @param {{ name: string, picture_width: number, picture_height: number, quarter_turns?: number }}
 *   lens
 * @param {{ label: string, className?: string, size: number, least: number, most: number, centre:
 *   number, slowness: number, layers?: HTMLElement[], begin: (at: number[]) => void, to: (at:
 *   number[], isKey: boolean) => void, end: () => void, dress: (ring: HTMLElement) => void, keys:
 *   Record<string, (event: KeyboardEvent) => void> }} brush
 */
export function painting(setup, lens, brush) {
  const turns = (((lens.quarter_turns ?? 0) % 4) + 4) % 4;
  const stored = [lens.picture_width, lens.picture_height];
  const [width, height] = upright(lens);
  const most = [width - 2 * brush.centre, height - 2 * brush.centre];
  const canvas = element("canvas", {
    width,
    height,
    tabIndex: 0,
    className: `brush-canvas ${brush.className ?? ""}`,
    role: "application",
    ariaLabel: brush.label,
  });
  const ring = element("div", { className: "brush-ring" });
  const photo = element("img", {
    alt: `Picture of ${lens.name}`,
    className: "brush-photo",
    draggable: false,
  });
  const sheet = element(
    "div",
    { className: "brush-sheet" },
    photo,
    ...(brush.layers ?? []),
    canvas,
    ring,
  );
  sheet.style.aspectRatio = `${width} / ${height}`;
  sheet.style.setProperty("--sheet-ratio", String(width / height));
  const size = element("input", {
    type: "range",
    min: brush.least,
    max: brush.most,
    value: brush.size,
    ariaLabel: "Size of the brush",
  });
  const state = { size: brush.size, at: [width / 2, height / 2], drawing: false, holding: false };

  function drawRing() {
    const scale = canvas.clientWidth / width;
    ring.style.width = ring.style.height = `${state.size * scale}px`;
    ring.style.left = `${state.at[0] * scale}px`;
    ring.style.top = `${state.at[1] * scale}px`;
    brush.dress(ring);
  }
  size.oninput = () => {
    state.size = Number(size.value);
    drawRing();
  };
  const resize = (wanted) => {
    size.value = wanted;
    size.dispatchEvent(new Event("input"));
  };

  const point = (event) => {
    const box = canvas.getBoundingClientRect();
    return [
      ((event.clientX - box.left) / box.width) * width - brush.centre,
      ((event.clientY - box.top) / box.height) * height - brush.centre,
    ];
  };
  canvas.onpointerdown = (event) => {
    if (event.button !== 0) return;
    release();
    canvas.setPointerCapture(event.pointerId);
    canvas.focus();
    state.drawing = true;
    state.at = point(event);
    brush.begin(state.at);
    drawRing();
  };
  canvas.onpointermove = (event) => {
    state.at = point(event);
    if (state.drawing) brush.to(state.at, false);
    drawRing();
  };
  canvas.onpointerup = canvas.onpointercancel = () => {
    if (state.drawing) brush.end();
    state.drawing = false;
  };

  function release() {
    if (!state.holding) return;
    state.holding = false;
    brush.end();
  }
  canvas.onkeydown = (event) => {
    const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[
      event.key
    ];
    const far = Math.max(1, (state.size * (event.shiftKey ? 4 : 1)) / brush.slowness);
    if (by) {
      state.at = state.at.map((value, axis) =>
        Math.min(most[axis], Math.max(0, value + by[axis] * far)),
      );
      if (state.holding) brush.to(state.at, true);
    } else if (event.key === " ") {
      if (!event.repeat && !state.holding) {
        state.holding = true;
        brush.begin(state.at);
      }
    } else if (event.key === "[") resize(0.8 * state.size);
    else if (event.key === "]") resize(Math.max(state.size + 1, 1.25 * state.size));
    else if (event.key in brush.keys && (event.key !== "z" || event.ctrlKey || event.metaKey))
      brush.keys[event.key](event);
    else return;
    event.preventDefault();
    drawRing();
  };
  canvas.onkeyup = (event) => {
    if (event.key === " ") release();
  };
  canvas.onblur = release;

  /**
   * Show a frame's picture.
   * @param {number} frame
   * @param {string} [show] of its address: "show=mask&"
   */
  function showFrame(frame, show = "") {
    photo.src = `${sessionPath(setup.session)}/frames/${frame}/views/${encodeURIComponent(lens.name)}.jpg?${show}height=${turns % 2 ? stored[1] : Math.min(PICTURE_HEIGHT, stored[1])}`;
  }
  return {
    turns,
    stored,
    width,
    height,
    canvas,
    sheet,
    state,
    drawRing,
    showFrame,
    sized: element("label", { className: "check" }, "size", size),
  };
}
