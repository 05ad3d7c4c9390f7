// Strokes inside and outside the subject, painted over a camera's picture in any frame; the mask
// that they give there follows each stroke. Kept with the session; all frames are made of them by
// "Set up the background".

import { accepted, put, sessionPath } from "./api.js";
import { penOf } from "./elements.js";
import { complain } from "./messages.js";
import { drawLine, paintingOf, Sheet, Size } from "./setup_painting.js";
import {
  batch,
  html,
  into,
  signal,
  useLayoutEffect,
  useRef,
  useState,
} from "./studio/component.js";
import { Action, Toggle } from "./studio/parts.js";
import { windowName } from "./window.js";

/** @import { Schemas } from "./api_types" */

const COLOURS = { inside: "#3ddc84", outside: "#ff5a4f" };
const HELP =
  "Paint over the subject, and over what is not the subject: a few lines each are enough. Keys: " +
  "arrows move, space paints, x changes between inside and outside, [ and ] change the size, " +
  ", and . go a frame back and on, ctrl z undoes, enter keeps, escape leaves.";
const MOST_FRAMES = 8;

/**
 * A pixel where it is once the picture is turned clockwise by quarter turns.
 * @param {number[]} point
 * @param {number[]} size of the picture
 * @param {number} turns
 * @returns {number[]}
 */
const turned = ([x, y], [width, height], turns) =>
  turns ? turned([height - 1 - y, x], [height, width], turns - 1) : [x, y];

/** @typedef {Schemas["StrokeEntry"]} Stroke */
/**
 * @typedef {{ setup: import("./setup.js").Setup, lens: import("./setup_painting.js").Lens,
 *   frame: number, count: number, before: Stroke[],
 *   done: (isSaved: boolean, frame: number) => any }} Properties
 *   `frame`: to begin in, of `count`; `before`: strokes that are kept already; `done`: called when
 *   it is left
 */

/** What is painted, and what can be done. @param {Properties} properties */
function strokesOf({ setup, lens, frame: first, count, before, done }) {
  const own = /** @type {`/api/sessions/${string}/strokes/${string}`} */ (
    `${sessionPath(setup.session)}/strokes/${encodeURIComponent(lens.name)}`
  );
  const frame = signal(first);
  const strokes = signal(before);
  /** What undo brings back. */
  const undone = signal(/** @type {Stroke[][]} */ ([]));
  const kind = signal(/** @type {"inside" | "outside"} */ ("inside"));
  /** The address of the mask by these strokes in this frame, "" for none. */
  const mask = signal("");
  const isWaiting = signal(false);
  /** @type {CanvasRenderingContext2D} */
  let pen;
  /** The stroke that is being painted. @type {number[][] | null} */
  let line = null;
  let isBusy = false;
  let isAgain = false;
  let isLeft = false;

  const painting = paintingOf(setup, lens, {
    part: 90,
    least: 1,
    most: 10,
    centre: 0.5,
    slowness: 2,
    begin: (at) => {
      line = [at];
      draw();
    },
    to: (at, isKey) => {
      if (!line) return;
      const [x, y] = line[line.length - 1];
      if (!isKey && Math.hypot(at[0] - x, at[1] - y) <= 0.25 * painting.size.value) return;
      line.push(at);
      draw();
    },
    end: () => {
      if (!line) return;
      const points = line.map(asStored).map(rounded);
      line = null;
      const width = painting.size.value;
      change([...strokes.value, { frame: frame.value, kind: kind.value, width, points }]);
    },
    keys: {
      x: () => {
        kind.value = kind.value === "inside" ? "outside" : "inside";
      },
      ",": () => go(frame.value - 1),
      ".": () => go(frame.value + 1),
      z: takeBack,
      Enter: save,
      Escape: () => done(false, frame.value),
    },
  });
  const { stored, turns } = painting;

  // Strokes are kept in pixels of the stored picture; the canvas shows it upright.
  const upright = (/** @type {number[]} */ point) => turned(point, stored, turns);
  const asStored = (/** @type {number[]} */ point) =>
    turned(point, [painting.width, painting.height], 4 - turns);
  const rounded = (/** @type {number[]} */ point) =>
    /** @type {[number, number]} */ (point.map((value) => Math.round(10 * value) / 10));

  function draw() {
    pen.clearRect(0, 0, painting.width, painting.height);
    const show = (/** @type {number[][]} */ points, /** @type {Stroke["kind"]} */ kind, width) =>
      drawLine(
        pen,
        points.map(([x, y]) => [x + 0.5, y + 0.5]),
        COLOURS[kind],
        width,
      );
    for (const stroke of strokes.value)
      if (stroke.frame === frame.value) show(stroke.points.map(upright), stroke.kind, stroke.width);
    if (line) show(line, kind.value, painting.size.value);
  }

  /** @param {string} address */
  function showMask(address) {
    if (mask.value) URL.revokeObjectURL(mask.value);
    mask.value = address;
  }

  /** Show the mask of this frame by the strokes as they are; one request at a time. */
  async function preview() {
    isAgain = isBusy;
    if (isBusy) return;
    isBusy = isWaiting.value = true;
    const wanted = frame.value;
    try {
      const answer = await accepted(
        await fetch(`${own}/preview`, {
          method: "POST",
          headers: { "content-type": "application/json", "x-studio-window": windowName },
          body: JSON.stringify({ frame: wanted, strokes: strokes.value }),
        }),
      );
      const picture = answer.status === 204 ? null : await answer.blob();
      if (isLeft) return;
      showMask(picture && wanted === frame.value ? URL.createObjectURL(picture) : "");
    } catch (error) {
      complain(error);
    } finally {
      isBusy = false;
      isWaiting.value = isAgain;
      if (isAgain && !isLeft) preview();
    }
  }

  /** @param {number} to */
  function go(to) {
    batch(() => {
      frame.value = Math.min(count - 1, Math.max(0, to));
      showMask("");
    });
    draw();
    preview();
  }

  /** @param {Stroke[]} next */
  function set(next) {
    strokes.value = next;
    draw();
    preview();
  }

  /** @param {Stroke[]} next */
  function change(next) {
    undone.value = [...undone.value, strokes.value];
    set(next);
  }

  function takeBack() {
    const last = undone.value.at(-1);
    undone.value = undone.value.slice(0, -1);
    if (last) set(last);
  }

  async function save() {
    try {
      await put(own, { strokes: strokes.value });
      await done(true, frame.value);
    } catch (error) {
      complain(error);
    }
  }

  return {
    painting,
    frame,
    strokes,
    undone,
    kind,
    mask,
    isWaiting,
    go,
    takeBack,
    save,
    clear: () => change(strokes.value.filter((stroke) => stroke.frame !== frame.value)),
    /** Begin on a canvas; what ends it. @param {HTMLCanvasElement} canvas */
    start: (canvas) => {
      pen = penOf(canvas);
      canvas.focus();
      go(first);
      return () => {
        isLeft = true;
        showMask("");
      };
    },
  };
}

/** @param {Stroke[]} strokes */
function framesWords(strokes) {
  const painted = [...new Set(strokes.map((stroke) => stroke.frame))].sort((a, b) => a - b);
  if (!painted.length) return "no strokes yet";
  const more = painted.length > MOST_FRAMES ? ", …" : "";
  const named = painted.slice(0, MOST_FRAMES).join(", ");
  return `strokes in frame${painted.length > 1 ? "s" : ""} ${named}${more}`;
}

/** Paint strokes of a camera. @param {Properties} properties */
export function Strokes(properties) {
  const { lens, count, done } = properties;
  const [model] = useState(() => strokesOf(properties));
  const canvas = useRef(/** @type {any} */ (null));
  useLayoutEffect(() => model.start(canvas.current), []);
  const [frame, kind, strokes] = [model.frame.value, model.kind.value, model.strokes.value];
  return html`
    <div class="mask-bar">
      <b>${lens.name}</b>
      <${Toggle} isOn=${kind === "inside"} act=${() => into(model.kind)("inside")}>Inside</${Toggle}>
      <${Toggle} isOn=${kind === "outside"} act=${() => into(model.kind)("outside")}>Outside</${Toggle}>
      <${Size} painting=${model.painting} />
      <${Action} kind="small" act=${model.takeBack} disabled=${!model.undone.value.length}>
        Undo
      </${Action}>
      <${Action}
        kind="quiet small"
        act=${model.clear}
        disabled=${!strokes.some((stroke) => stroke.frame === frame)}
      >
        Clear this frame
      </${Action}>
      <span class="spring"></span>
      <${Action} kind="quiet" act=${() => done(false, frame)}>Leave</${Action}>
      <${Action} kind="primary" act=${model.save}>Keep</${Action}>
    </div>
    <${Sheet}
      painting=${model.painting}
      address=${model.painting.picture(frame)}
      label=${`Strokes of ${lens.name}. ${HELP}`}
      canvas=${canvas}
      kind="strokes-canvas"
      ring=${{ style: { borderColor: COLOURS[kind] } }}
      isWaiting=${model.isWaiting.value && strokes.length > 0}
    >
      <img
        alt=${`Mask of ${lens.name} by the strokes`}
        class="brush-photo strokes-mask"
        draggable=${false}
        hidden=${!model.mask.value}
        src=${model.mask.value || null}
      />
    </${Sheet}>
    <div class="mask-bar strokes-frames">
      <input
        type="range"
        min="0"
        max=${Math.max(0, count - 1)}
        value=${frame}
        aria-label="Frame"
        onInput=${({ target }) => model.go(Number(target.value))}
      />
      <output>frame ${frame}</output><span class="hint">${framesWords(strokes)}</span>
    </div>
    <p class="hint brush-help">${HELP}</p>
  `;
}
