// Strokes inside and outside the subject, painted over a camera's picture in any frame; the mask that they give there
// follows each stroke. Kept with the session; all frames are made of them by "Set up the background".

import { accepted, fetchJson, put, sessionPath } from "./api.js";
import { button, element, fill, spring } from "./elements.js";
import { complain } from "./messages.js";
import { windowName } from "./window.js";

/** @import { Schemas } from "./api_types" */

const PICTURE_HEIGHT = 1080;
const COLOURS = { inside: "#3ddc84", outside: "#ff5a4f" };
const HELP = "Paint over the subject, and over what is not the subject: a few lines each are enough. Keys: arrows move, space paints, x changes between inside and outside, [ and ] change the size, , and . go a frame back and on, ctrl z undoes, enter keeps, escape leaves.";

/**
 * Paint strokes of `lens` (name, picture_width, picture_height, quarter_turns), beginning in `frame`, of `count` frames;
 * `done(saved, frame)` when left.
 * @param {import("./setup.js").Setup} setup
 */
export async function paintStrokes(setup, lens, frame, count, done) {
  const place = `${sessionPath(setup.session)}/strokes`;
  const own = /** @type {`${typeof place}/${string}`} */ (`${place}/${encodeURIComponent(lens.name)}`);
  const turns = (((lens.quarter_turns ?? 0) % 4) + 4) % 4;
  const stored = [lens.picture_width, lens.picture_height];
  const [width, height] = turns % 2 ? [stored[1], stored[0]] : stored;
  const known = await fetchJson(place);
  /** @type {Schemas["StrokeEntry"][]} */
  let strokes = [...(known.cameras.find((one) => one.camera === lens.name)?.strokes ?? [])];
  /** What undo brings back. @type {Schemas["StrokeEntry"][][]} */
  const before = [];
  /** @type {{ kind: "inside" | "outside", size: number, holding: boolean, at: number[], line: number[][] | null }} */
  const state = { kind: "inside", size: Math.max(2, Math.round(width / 90)), holding: false, at: [width / 2, height / 2], line: null };
  let busy = false, again = false, gone = false, shown = "";

  const canvas = element("canvas", { width, height, tabIndex: 0, className: "brush-canvas strokes-canvas", role: "application", ariaLabel: `Strokes of ${lens.name}. ${HELP}` });
  const context = canvas.getContext("2d");
  const ring = element("div", { className: "brush-ring" });
  const photo = element("img", { alt: `Picture of ${lens.name}`, className: "brush-photo", draggable: false });
  const mask = element("img", { alt: `Mask of ${lens.name} by the strokes`, className: "brush-photo strokes-mask", draggable: false, hidden: true });
  const sheet = element("div", { className: "brush-sheet" }, photo, mask, canvas, ring);
  sheet.style.aspectRatio = `${width} / ${height}`;
  sheet.style.setProperty("--sheet-ratio", String(width / height));

  // Strokes are kept in pixels of the stored picture; the canvas shows it upright.
  /** @param {number[]} point */
  const upright = ([x, y]) => [[x, y], [stored[1] - 1 - y, x], [stored[0] - 1 - x, stored[1] - 1 - y], [y, stored[0] - 1 - x]][turns];
  /** @param {number[]} point */
  const asStored = ([x, y]) => [[x, y], [y, stored[1] - 1 - x], [stored[0] - 1 - x, stored[1] - 1 - y], [stored[0] - 1 - y, x]][turns];
  const rounded = (point) => /** @type {[number, number]} */ (point.map((value) => Math.round(10 * value) / 10));

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
    for (const stroke of strokes) if (stroke.frame === frame) drawLine(stroke.points.map(upright), stroke.kind, stroke.width);
    if (state.line) drawLine(state.line, state.kind, state.size);
    undo.disabled = !before.length;
    clear.disabled = !strokes.some((stroke) => stroke.frame === frame);
    const painted = [...new Set(strokes.map((stroke) => stroke.frame))].sort((a, b) => a - b);
    words.textContent = painted.length ? `strokes in frame${painted.length > 1 ? "s" : ""} ${painted.slice(0, 8).join(", ")}${painted.length > 8 ? ", …" : ""}` : "no strokes yet";
  }

  function drawRing() {
    const scale = canvas.clientWidth / width;
    ring.style.width = ring.style.height = `${state.size * scale}px`;
    ring.style.left = `${state.at[0] * scale}px`;
    ring.style.top = `${state.at[1] * scale}px`;
    ring.style.borderColor = COLOURS[state.kind];
  }

  /** Show the mask of this frame by the strokes as they are; one request at a time. */
  async function preview() {
    if (busy) { again = true; return; }
    busy = true;
    again = false;
    const wanted = frame;
    sheet.classList.add("waiting");
    try {
      const answer = await accepted(await fetch(`${own}/preview`, {
        method: "POST", headers: { "content-type": "application/json", "x-studio-window": windowName }, body: JSON.stringify({ frame: wanted, strokes }),
      }));
      const picture = answer.status === 204 ? null : await answer.blob();
      if (gone) return;
      if (shown) URL.revokeObjectURL(shown);
      shown = picture && wanted === frame ? URL.createObjectURL(picture) : "";
      mask.hidden = !shown;
      if (shown) mask.src = shown;
    } catch (error) { complain(error); }
    finally {
      busy = false;
      sheet.classList.toggle("waiting", again);
      if (again && !gone) preview();
    }
  }

  function go(to) {
    frame = Math.min(count - 1, Math.max(0, to));
    slider.value = String(frame);
    output.textContent = `frame ${frame}`;
    photo.src = `${sessionPath(setup.session)}/frames/${frame}/views/${encodeURIComponent(lens.name)}.jpg?height=${turns % 2 ? stored[1] : Math.min(PICTURE_HEIGHT, stored[1])}`;
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
    const { line } = state;
    if (!line) return;
    state.line = null;
    change([...strokes, { frame, kind: state.kind, width: state.size, points: line.map(asStored).map(rounded) }]);
  }

  function takeBack() {
    const last = before.pop();
    if (!last) return;
    strokes = last;
    draw();
    preview();
  }

  const point = (event) => {
    const box = canvas.getBoundingClientRect();
    return [((event.clientX - box.left) / box.width) * width - 0.5, ((event.clientY - box.top) / box.height) * height - 0.5];
  };
  canvas.onpointerdown = (event) => {
    if (event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    canvas.focus();
    state.at = point(event);
    state.line = [state.at];
    draw();
    drawRing();
  };
  canvas.onpointermove = (event) => {
    state.at = point(event);
    const last = state.line?.at(-1);
    if (last && Math.hypot(state.at[0] - last[0], state.at[1] - last[1]) > 0.25 * state.size) { state.line.push(state.at); draw(); }
    drawRing();
  };
  canvas.onpointerup = canvas.onpointercancel = finish;

  const kinds = /** @type {const} */ (["inside", "outside"]).map((kind) => button(kind === "inside" ? "Inside" : "Outside", () => setKind(kind), "toggle small", { ariaPressed: "false" }));
  function setKind(kind) {
    state.kind = kind;
    kinds[0].ariaPressed = String(kind === "inside");
    kinds[1].ariaPressed = String(kind === "outside");
    drawRing();
  }
  const size = element("input", { type: "range", min: 1, max: Math.round(width / 10), value: state.size, ariaLabel: "Size of the brush" });
  size.oninput = () => { state.size = Number(size.value); drawRing(); };
  const resize = (wanted) => { size.value = wanted; size.dispatchEvent(new Event("input")); };
  const undo = button("Undo", takeBack, "small");
  const clear = button("Clear this frame", () => change(strokes.filter((stroke) => stroke.frame !== frame)), "quiet small");
  const keep = button("Keep", save, "primary");
  const leave = button("Leave", () => close(false), "quiet");
  const slider = element("input", { type: "range", min: 0, max: Math.max(0, count - 1), value: frame, ariaLabel: "Frame", oninput: ({ target }) => go(Number(target.value)) });
  const output = element("output", {}, `frame ${frame}`);
  const words = element("span", { className: "hint" });

  async function save() {
    try {
      await put(own, { strokes });
      close(true);
    } catch (error) { complain(error); }
  }

  function close(saved) {
    gone = true;
    if (shown) URL.revokeObjectURL(shown);
    done(saved, frame);
  }

  canvas.onkeydown = (event) => {
    const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    const far = Math.max(1, state.size / (event.shiftKey ? 0.5 : 2));
    if (by) {
      state.at = [Math.min(width - 1, Math.max(0, state.at[0] + by[0] * far)), Math.min(height - 1, Math.max(0, state.at[1] + by[1] * far))];
      if (state.holding) { state.line.push(state.at); draw(); }
    } else if (event.key === " ") {
      if (!event.repeat && !state.holding) { state.holding = true; state.line = [state.at]; draw(); }
    } else if (event.key === "[") resize(0.8 * state.size);
    else if (event.key === "]") resize(Math.max(state.size + 1, 1.25 * state.size));
    else if (event.key === "x") setKind(state.kind === "inside" ? "outside" : "inside");
    else if (event.key === ",") go(frame - 1);
    else if (event.key === ".") go(frame + 1);
    else if (event.key === "z" && (event.ctrlKey || event.metaKey)) takeBack();
    else if (event.key === "Enter") save();
    else if (event.key === "Escape") close(false);
    else return;
    event.preventDefault();
    drawRing();
  };
  canvas.onkeyup = (event) => { if (event.key === " ") { state.holding = false; finish(); } };
  canvas.onblur = () => { if (state.holding) { state.holding = false; finish(); } };

  setKind("inside");
  const tools = element("div", { className: "mask-bar" }, element("b", {}, lens.name), kinds, element("label", { className: "check" }, "size", size), undo, clear, spring(), leave, keep);
  const frames = element("div", { className: "mask-bar strokes-frames" }, slider, output, words);
  fill(setup.aside, tools, element("div", { className: "brush-room" }, sheet), frames, element("p", { className: "hint brush-help" }, HELP));
  canvas.focus();
  go(frame);
  drawRing();
}
