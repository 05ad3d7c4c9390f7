// A brush over a camera's picture: what is painted does not count, or hides the subject. Mouse, pen
// or keyboard; kept as a PNG of the footage's own size and orientation.

import { fault, putBytes, sessionPath } from "./api.js";
import { element, penOf } from "./elements.js";
import { complain } from "./messages.js";
import { drawLine, paintingOf, Sheet, Size } from "./setup_painting.js";
import { html, signal, useLayoutEffect, useRef, useState } from "./studio/component.js";
import { Action, Toggle } from "./studio/parts.js";

const UNDONE = 30;
const KEYS =
  "Keys: arrows move, space paints, x paints or erases, " +
  "[ and ] change the size, ctrl z undoes, enter keeps, escape leaves.";
/** What can be painted, in words. */
const REGIONS = {
  exclusions: { title: "Excluded regions", help: "Paint what is not the subject." },
  in_front: {
    title: "Things in front",
    help: "Paint what stands between the camera and the subject: a table, a pole.",
  },
};
/** @typedef {keyof typeof REGIONS} Region */

const placeOf = (
  /** @type {string} */ session,
  /** @type {Region} */ kind,
  /** @type {string} */ camera,
) => `${sessionPath(session)}/${kind}/${encodeURIComponent(camera)}`;

/**
 * What is painted of a camera already, as a picture: read before a stroke can be made, since one
 * that came after would undo what was painted meanwhile.
 * @param {string} session
 * @param {Region} kind
 * @param {string} camera
 */
export async function loadRegion(session, kind, camera) {
  const answer = await fetch(placeOf(session, kind, camera));
  if (!answer.ok)
    throw fault(`What is painted on ${camera} could not be read.`, "Open the brush again.");
  return createImageBitmap(await answer.blob());
}

/**
 * A picture turned clockwise by quarter turns.
 * @param {HTMLCanvasElement | ImageBitmap} source
 * @param {number} by
 * @param {number[]} size
 * @returns {[HTMLCanvasElement, CanvasRenderingContext2D]}
 */
function turned(source, by, [width, height]) {
  const out = element("canvas", { width, height });
  const drawn = penOf(out);
  drawn.translate(width / 2, height / 2);
  drawn.rotate((by * Math.PI) / 2);
  drawn.drawImage(source, -source.width / 2, -source.height / 2);
  return [out, drawn];
}

/**
 * @typedef {{ setup: import("./setup.js").Setup, frame: number, kind: Region,
 *   lens: import("./setup_painting.js").Lens, before: ImageBitmap | null,
 *   done: (isSaved: boolean) => any }} Properties
 *   `before`: what is painted already; `done`: called when it is left
 */

/** What is painted, and what can be done. @param {Properties} properties */
function brushOf({ setup, kind, lens, before, done }) {
  const colour = getComputedStyle(document.documentElement).getPropertyValue("--accent").trim();
  const isErasing = signal(false);
  /** What undo brings back. */
  const undone = signal(/** @type {ImageData[]} */ ([]));
  /** @type {CanvasRenderingContext2D} */
  let pen;
  /** Where the stroke is. @type {number[] | null} */
  let last = null;

  const all = () => pen.getImageData(0, 0, painting.width, painting.height);
  function remember() {
    undone.value = [...undone.value, all()].slice(-UNDONE);
  }

  /** @param {number[]} at */
  function dab(at) {
    pen.globalCompositeOperation = isErasing.value ? "destination-out" : "source-over";
    drawLine(pen, [last ?? at, at], colour, painting.size.value);
    last = at;
  }

  function takeBack() {
    const picture = undone.value.at(-1);
    if (picture) pen.putImageData(picture, 0, 0);
    undone.value = undone.value.slice(0, -1);
  }

  function exchange() {
    isErasing.value = !isErasing.value;
  }

  async function save() {
    const [width, height] = painting.stored;
    const [out, drawn] = turned(pen.canvas, -painting.turns, painting.stored);
    drawn.setTransform(1, 0, 0, 1, 0, 0);
    drawn.globalCompositeOperation = "source-in";
    drawn.fillStyle = "#fff";
    drawn.fillRect(0, 0, width, height);
    const isPainted = drawn
      .getImageData(0, 0, width, height)
      .data.some((value, index) => index % 4 === 3 && value > 127);
    const content = isPainted
      ? await new Promise((resolve) => out.toBlob(resolve, "image/png"))
      : "";
    try {
      await putBytes(placeOf(setup.session, kind, lens.name), content);
      await done(true);
    } catch (error) {
      complain(error);
    }
  }

  const painting = paintingOf(setup, lens, {
    part: 16,
    least: 2,
    most: 4,
    centre: 0,
    slowness: 4,
    begin: (at) => {
      remember();
      last = null;
      dab(at);
    },
    to: dab,
    end: () => {
      last = null;
    },
    keys: { x: exchange, z: takeBack, Enter: save, Escape: () => done(false) },
  });

  return {
    painting,
    isErasing,
    undone,
    takeBack,
    exchange,
    save,
    clear: () => {
      remember();
      pen.clearRect(0, 0, painting.width, painting.height);
    },
    /** Begin on a canvas. @param {HTMLCanvasElement} canvas */
    start: (canvas) => {
      pen = penOf(canvas, { willReadFrequently: true });
      canvas.focus();
      if (!before) return;
      const { turns, width, height } = painting;
      const read = turned(before, turns, [width, height])[1].getImageData(0, 0, width, height);
      for (let k = 0; k < read.data.length; k += 4) read.data[k + 3] = read.data[k] > 127 ? 255 : 0;
      pen.putImageData(read, 0, 0);
      pen.globalCompositeOperation = "source-in";
      pen.fillStyle = colour;
      pen.fillRect(0, 0, width, height);
    },
  };
}

/** Edit a region of a camera. @param {Properties} properties */
export function Brush(properties) {
  const { lens, kind, frame, done } = properties;
  const { title, help } = REGIONS[kind];
  const [model] = useState(() => brushOf(properties));
  const canvas = useRef(/** @type {any} */ (null));
  useLayoutEffect(() => model.start(canvas.current), []);
  const isErasing = model.isErasing.value;
  return html`
    <div class="mask-bar">
      <b>${lens.name}</b><span class="hint">${title.toLowerCase()}</span>
      <${Size} painting=${model.painting} />
      <${Toggle} isOn=${isErasing} act=${model.exchange}>Erase</${Toggle}>
      <${Action} kind="small" act=${model.takeBack} disabled=${!model.undone.value.length}>
        Undo
      </${Action}>
      <${Action} kind="quiet small" act=${model.clear}>Clear all</${Action}>
      <span class="spring"></span>
      <${Action} kind="quiet" act=${() => done(false)}>Leave</${Action}>
      <${Action} kind="primary" act=${model.save}>Keep</${Action}>
    </div>
    <${Sheet}
      painting=${model.painting}
      address=${model.painting.picture(frame, "show=mask&")}
      label=${`${title} of ${lens.name}. ${help} ${KEYS}`}
      canvas=${canvas}
      ring=${{ class: isErasing ? "erasing" : "" }}
    />
    <p class="hint brush-help">${help} ${KEYS}</p>
  `;
}
