// Strokes inside and outside the subject, painted over a camera's picture in any frame; the mask
// that they give there follows each stroke. Kept with the session; all frames are made of them by
// "Set up the background".

import { accepted, fetchJson, put, sessionPath } from "./api.js";
import { button, element, fill, penOf, spring } from "./elements.js";
import { complain } from "./messages.js";
import { painting, upright } from "./setup_painting.js";
import { windowName } from "./window.js";

/** @import { Schemas } from "./api_types" */

const COLOURS = { inside: "#3ddc84", outside: "#ff5a4f" };
const HELP =
  "Paint over the subject, and over what is not the subject: a few lines each are enough. Keys: arrows move, space paints, x changes between inside and outside, [ and ] change the size, , and . go a frame back and on, ctrl z undoes, enter keeps, escape leaves.";

/**
 * Paint strokes of `lens` (name, picture_width, picture_height, quarter_turns), beginning in
 * `frame`, of `count` frames; `done(saved, frame)` when left.
 * @param {import("./setup.js").Setup} setup
 */
export async function paintStrokes(setup, lens, frame, count, done) {
  const place = `${sessionPath(setup.session)}/strokes`;
  const own = /** @type {`${typeof place}/${string}`} */ (
    `${place}/${encodeURIComponent(lens.name)}`
  );
  const known = await fetchJson(place);
  /** @type {Schemas["StrokeEntry"][]} */
  let strokes = [...(known.cameras.find((one) => one.camera === lens.name)?.strokes ?? [])];
  /** What undo brings back. @type {Schemas["StrokeEntry"][][]} */
  const before = [];
  /** @type {"inside" | "outside"} */
  let kind = "inside";
  /** The stroke that is being painted. @type {number[][] | null} */
  let line = null;
  let busy = false,
    again = false,
    gone = false,
    shown = "";

  const mask = element("img", {
    alt: `Mask of ${lens.name} by the strokes`,
    className: "brush-photo strokes-mask",
    draggable: false,
    hidden: true,
  });
  const { sheet, canvas, width, height, turns, stored, state, drawRing, showFrame, sized } =
    painting(setup, lens, {
      label: `Strokes of ${lens.name}. ${HELP}`,
      className: "strokes-canvas",
      layers: [mask],
      size: Math.max(2, Math.round(upright(lens)[0] / 90)),
      least: 1,
      most: Math.round(upright(lens)[0] / 10),
      centre: 0.5,
      slowness: 2,
      begin: (at) => {
        line = [at];
        draw();
      },
      to: (at, isKey) => {
        if (!line) return;
        const [x, y] = line[line.length - 1];
        if (isKey || Math.hypot(at[0] - x, at[1] - y) > 0.25 * state.size) {
          line.push(at);
          draw();
        }
      },
      end: finish,
      dress: (ring) => {
        ring.style.borderColor = COLOURS[kind];
      },
      keys: {
        x: () => setKind(kind === "inside" ? "outside" : "inside"),
        ",": () => go(frame - 1),
        ".": () => go(frame + 1),
        z: takeBack,
        Enter: save,
        Escape: () => close(false),
      },
    });
  const context = penOf(canvas);

  // Strokes are kept in pixels of the stored picture; the canvas shows it upright.
  /** @param {number[]} point */
  const turned = ([x, y]) =>
    [
      [x, y],
      [stored[1] - 1 - y, x],
      [stored[0] - 1 - x, stored[1] - 1 - y],
      [y, stored[0] - 1 - x],
    ][turns];
  /** @param {number[]} point */
  const asStored = ([x, y]) =>
    [
      [x, y],
      [y, stored[1] - 1 - x],
      [stored[0] - 1 - x, stored[1] - 1 - y],
      [stored[0] - 1 - y, x],
    ][turns];
  const rounded = (point) =>
    /** @type {[number, number]} */ (point.map((value) => Math.round(10 * value) / 10));

  function drawLine(points, kind, size) {
    context.strokeStyle = COLOURS[kind];
    context.lineWidth = size;
    context.lineCap = context.lineJoin = "round";
    context.beginPath();
    context.moveTo(points[0][0] + 0.5, points[0][1] + 0.5);
    for (const [x, y] of points) context.lineTo(x + 0.51, y + 0.5);
    context.stroke();
  }

  function draw() {
    context.clearRect(0, 0, width, height);
    for (const stroke of strokes)
      if (stroke.frame === frame) drawLine(stroke.points.map(turned), stroke.kind, stroke.width);
    if (line) drawLine(line, kind, state.size);
    undo.disabled = !before.length;
    clear.disabled = !strokes.some((stroke) => stroke.frame === frame);
    const painted = [...new Set(strokes.map((stroke) => stroke.frame))].sort((a, b) => a - b);
    words.textContent = painted.length
      ? `strokes in frame${painted.length > 1 ? "s" : ""} ${painted.slice(0, 8).join(", ")}${painted.length > 8 ? ", …" : ""}`
      : "no strokes yet";
  }

  /** Show the mask of this frame by the strokes as they are; one request at a time. */
  async function preview() {
    if (busy) {
      again = true;
      return;
    }
    busy = true;
    again = false;
    const wanted = frame;
    sheet.classList.add("waiting");
    try {
      const answer = await accepted(
        await fetch(`${own}/preview`, {
          method: "POST",
          headers: { "content-type": "application/json", "x-studio-window": windowName },
          body: JSON.stringify({ frame: wanted, strokes }),
        }),
      );
      const picture = answer.status === 204 ? null : await answer.blob();
      if (gone) return;
      if (shown) URL.revokeObjectURL(shown);
      shown = picture && wanted === frame ? URL.createObjectURL(picture) : "";
      mask.hidden = !shown;
      if (shown) mask.src = shown;
    } catch (error) {
      complain(error);
    } finally {
      busy = false;
      sheet.classList.toggle("waiting", again);
      if (again && !gone) preview();
    }
  }

  function go(to) {
    frame = Math.min(count - 1, Math.max(0, to));
    slider.value = String(frame);
    output.textContent = `frame ${frame}`;
    showFrame(frame);
    mask.hidden = true;
    draw();
    preview();
  }

  function change(next) {
    before.push(strokes);
    strokes = next;
    draw();
    preview();
  }

  function finish() {
    if (!line) return;
    const points = line.map(asStored).map(rounded);
    line = null;
    change([...strokes, { frame, kind, width: state.size, points }]);
  }

  function takeBack() {
    const last = before.pop();
    if (!last) return;
    strokes = last;
    draw();
    preview();
  }

  const kinds = /** @type {const} */ (["inside", "outside"]).map((one) =>
    button(one === "inside" ? "Inside" : "Outside", () => setKind(one), "toggle small", {
      ariaPressed: "false",
    }),
  );
  function setKind(wanted) {
    kind = wanted;
    kinds[0].ariaPressed = String(kind === "inside");
    kinds[1].ariaPressed = String(kind === "outside");
    drawRing();
  }
  const undo = button("Undo", takeBack, "small");
  const clear = button(
    "Clear this frame",
    () => change(strokes.filter((stroke) => stroke.frame !== frame)),
    "quiet small",
  );
  const keep = button("Keep", save, "primary");
  const leave = button("Leave", () => close(false), "quiet");
  const slider = element("input", {
    type: "range",
    min: 0,
    max: Math.max(0, count - 1),
    value: frame,
    ariaLabel: "Frame",
    oninput: ({ target }) => go(Number(target.value)),
  });
  const output = element("output", {}, `frame ${frame}`);
  const words = element("span", { className: "hint" });

  async function save() {
    try {
      await put(own, { strokes });
      close(true);
    } catch (error) {
      complain(error);
    }
  }

  function close(saved) {
    gone = true;
    if (shown) URL.revokeObjectURL(shown);
    done(saved, frame);
  }

  setKind("inside");
  const tools = element(
    "div",
    { className: "mask-bar" },
    element("b", {}, lens.name),
    kinds,
    sized,
    undo,
    clear,
    spring(),
    leave,
    keep,
  );
  const frames = element("div", { className: "mask-bar strokes-frames" }, slider, output, words);
  fill(
    setup.aside,
    tools,
    element("div", { className: "brush-room" }, sheet),
    frames,
    element("p", { className: "hint brush-help" }, HELP),
  );
  canvas.focus();
  go(frame);
  drawRing();
}
