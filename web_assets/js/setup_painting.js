// A camera's picture, upright, to paint over with mouse, pen or keyboard: what brush and strokes
// have in common.

import { sessionPath } from "./api.js";
import { html, into, signal, useState } from "./studio/component.js";

const PICTURE_HEIGHT = 1080;
/** @type {Record<string, [number, number]>} */
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** @typedef {{ name: string, picture_width: number, picture_height: number, quarter_turns?: number }} Lens */

/**
 * A brush on the upright picture of `lens`: where it is and how large, and what moves it. Places
 * are pixels of that picture, whose first pixel has its middle at `-centre + 0.5`; an arrow key
 * goes a `slowness`-th of the brush. `begin(at)`, `to(at, isKey)` and `end()` paint a stroke; the
 * brush is at first a `part`-th of the picture wide, and between `least` and a `most`-th of it;
 * `keys` are other keys' doings.
 * @param {import("./setup.js").Setup} setup
 * @param {Lens} lens
 * @param {{ part: number, least: number, most: number, centre: number, slowness: number,
 *   begin: (at: number[]) => void, to: (at: number[], isKey: boolean) => void, end: () => void,
 *   keys: Record<string, () => void> }} brush
 */
export function paintingOf(setup, lens, brush) {
  const turns = (((lens.quarter_turns ?? 0) % 4) + 4) % 4;
  const stored = [lens.picture_width, lens.picture_height];
  const [width, height] = turns % 2 ? [stored[1], stored[0]] : stored;
  const end = [width - 2 * brush.centre, height - 2 * brush.centre];
  const most = Math.round(width / brush.most);
  const size = signal(Math.max(brush.least, Math.round(width / brush.part)));
  const at = signal([width / 2, height / 2]);
  let isDrawing = false;
  let isHolding = false; // the space bar

  const resize = (/** @type {number} */ wanted) => {
    size.value = Math.min(most, Math.max(brush.least, Math.round(wanted)));
  };
  function release() {
    if (isHolding) brush.end();
    isHolding = false;
  }
  function lift() {
    if (isDrawing) brush.end();
    isDrawing = false;
  }
  /** @param {PointerEvent} event */
  function follow({ clientX, clientY, currentTarget }) {
    const box = /** @type {HTMLElement} */ (currentTarget).getBoundingClientRect();
    at.value = [
      ((clientX - box.left) / box.width) * width - brush.centre,
      ((clientY - box.top) / box.height) * height - brush.centre,
    ];
  }

  /** Whether a key was the brush's. @param {KeyboardEvent} event */
  function take({ key, shiftKey, ctrlKey, metaKey, repeat }) {
    if (key in ARROWS) {
      const far = Math.max(1, (size.value * (shiftKey ? 4 : 1)) / brush.slowness);
      at.value = at.value.map((value, axis) =>
        Math.min(end[axis], Math.max(0, value + ARROWS[key][axis] * far)),
      );
      if (isHolding) brush.to(at.value, true);
    } else if (key === " ") {
      if (!repeat && !isHolding) {
        isHolding = true;
        brush.begin(at.value);
      }
    } else if (key === "[") resize(0.8 * size.value);
    else if (key === "]") resize(Math.max(size.value + 1, 1.25 * size.value));
    else if (key in brush.keys && (key !== "z" || ctrlKey || metaKey)) brush.keys[key]();
    else return false;
    return true;
  }

  return {
    lens,
    turns,
    stored,
    width,
    height,
    size,
    least: brush.least,
    most,
    at,
    /**
     * The address of a frame's picture; of the footage itself where it is stored upright and
     * nothing is shown over it: what makes masks need not be ready for that.
     * @param {number} frame
     * @param {string} [show]
     */
    picture: (frame, show = "") => {
      const here = sessionPath(setup.session);
      const name = encodeURIComponent(lens.name);
      const height = `height=${turns % 2 ? stored[1] : Math.min(PICTURE_HEIGHT, stored[1])}`;
      return turns || show
        ? `${here}/frames/${frame}/views/${name}.jpg?${show}${height}`
        : `${here}/footage/${name}/${frame}.jpg?${height}`;
    },
    /** What the canvas hears. */
    heard: {
      onPointerDown: (/** @type {PointerEvent} */ event) => {
        if (event.button !== 0) return;
        const canvas = /** @type {HTMLElement} */ (event.currentTarget);
        release();
        canvas.setPointerCapture(event.pointerId);
        canvas.focus();
        isDrawing = true;
        follow(event);
        brush.begin(at.value);
      },
      onPointerMove: (/** @type {PointerEvent} */ event) => {
        follow(event);
        if (isDrawing) brush.to(at.value, false);
      },
      onPointerUp: lift,
      onPointerCancel: lift,
      onKeyDown: (/** @type {KeyboardEvent} */ event) => {
        if (take(event)) event.preventDefault();
      },
      onKeyUp: ({ key }) => key === " " && release(),
      onBlur: release,
    },
  };
}

/** @typedef {ReturnType<typeof paintingOf>} Painting */

/**
 * Draw a round line through places of the canvas.
 * @param {CanvasRenderingContext2D} pen
 * @param {number[][]} places
 * @param {string} colour
 * @param {number} width
 */
export function drawLine(pen, places, colour, width) {
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.lineCap = pen.lineJoin = "round";
  pen.beginPath();
  pen.moveTo(places[0][0], places[0][1]);
  for (const [x, y] of places) pen.lineTo(x + 0.01, y);
  pen.stroke();
}

/** @param {{ painting: Painting }} properties */
export const Size = ({ painting }) => html`<label class="check">
  size
  <input
    type="range"
    min=${painting.least}
    max=${painting.most}
    value=${painting.size.value}
    aria-label="Size of the brush"
    onInput=${({ target }) => into(painting.size)(Number(target.value))}
  />
</label>`;

/**
 * The picture at an address under the canvas, which `canvas` refers to; `ring`: the brush's looks,
 * `children`: what lies between picture and canvas, `more`: the sheet's own properties.
 * @param {{ painting: Painting, address: string, label: string, canvas: { current: any },
 *   kind?: string, ring: Record<string, any>, isWaiting?: boolean, children?: any }} properties
 */
export function Sheet({ painting, address, label, canvas, kind = "", ring, isWaiting, children }) {
  const { width, height, lens } = painting;
  const [x, y] = painting.at.value;
  const share = (/** @type {number} */ part, /** @type {number} */ whole) =>
    `${(100 * part) / whole}%`;
  const place = { left: share(x, width), top: share(y, height) };
  const [seen, setSeen] = useState({ address: "", isWrong: false });
  const isLoading = seen.address !== address;
  const words = isLoading
    ? "loading the picture…"
    : seen.isWrong
      ? "This picture cannot be read."
      : isWaiting && "cutting the mask…";
  return html`<div class="brush-room">
    <div
      class=${isWaiting ? "brush-sheet waiting" : "brush-sheet"}
      style=${{ aspectRatio: `${width} / ${height}`, "--sheet-ratio": String(width / height) }}
    >
      <img
        alt=${`Picture of ${lens.name}`}
        class="brush-photo"
        draggable=${false}
        src=${address}
        onLoad=${() => setSeen({ address, isWrong: false })}
        onError=${() => setSeen({ address, isWrong: true })}
      />
      ${children}
      <canvas
        ref=${canvas}
        width=${width}
        height=${height}
        tabindex="0"
        class=${`brush-canvas ${kind}`}
        role="application"
        aria-label=${label}
        ...${painting.heard}
      ></canvas>
      <div
        class=${`brush-ring ${ring.class ?? ""}`}
        style=${{ ...place, width: share(painting.size.value, width), ...ring.style }}
      ></div>
      <p class="brush-words" role="status">${words}</p>
    </div>
  </div>`;
}
