// A brush over a camera's picture: what is painted does not count. Mouse, pen or keyboard; kept as a PNG of the
// footage's own size and orientation.

import { fault, putBytes, sessionPath } from "./api.js";
import { button, element, fill, spring } from "./elements.js";
import { complain } from "./messages.js";

const UNDONE = 30;
const PICTURE_HEIGHT = 1080;
const HELP = "Paint what is not the subject. Keys: arrows move, space paints, x paints or erases, [ and ] change the size, ctrl z undoes, enter keeps, escape leaves.";

/** Edit what is excluded of `lens` (name, picture_width, picture_height, quarter_turns, frame, excluded: whether there is
 * something already, shown before a stroke can be made: one that came after would undo what was painted meanwhile);
 * `done(saved)` when left. */
export async function brush(setup, lens, done) {
  const place = `${sessionPath(setup.session)}/exclusions/${encodeURIComponent(lens.name)}`;
  const turns = ((lens.quarter_turns % 4) + 4) % 4;
  const stored = [lens.picture_width, lens.picture_height];
  const [width, height] = turns % 2 ? [stored[1], stored[0]] : stored;
  const canvas = element("canvas", { width, height, tabIndex: 0, className: "brush-canvas", role: "application", ariaLabel: `Excluded regions of ${lens.name}. ${HELP}` });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  /** @type {{ size: number, erasing: boolean, holding: boolean, at: number[], last: number[], undo: ImageData[] }} */
  const state = { holding: false, size: Math.round(width / 16), erasing: false, at: [width / 2, height / 2], last: null, undo: [] };
  const colour = getComputedStyle(document.documentElement).getPropertyValue("--accent").trim();
  const ring = element("div", { className: "brush-ring" });

  const photo = element("img", { alt: `Picture of ${lens.name}`, className: "brush-photo", draggable: false,
    src: `${sessionPath(setup.session)}/frames/${lens.frame}/views/${encodeURIComponent(lens.name)}.jpg?show=mask&height=${turns % 2 ? stored[1] : Math.min(PICTURE_HEIGHT, stored[1])}` });
  const sheet = element("div", { className: "brush-sheet" }, photo, canvas, ring);
  sheet.style.aspectRatio = `${width} / ${height}`;
  sheet.style.setProperty("--sheet-ratio", String(width / height));

  function dab(from, to) {
    context.globalCompositeOperation = state.erasing ? "destination-out" : "source-over";
    context.strokeStyle = colour;
    context.lineWidth = state.size;
    context.lineCap = context.lineJoin = "round";
    context.beginPath();
    context.moveTo(from[0], from[1]);
    context.lineTo(to[0] + 0.01, to[1]);
    context.stroke();
  }

  function remember() {
    state.undo.push(context.getImageData(0, 0, width, height));
    if (state.undo.length > UNDONE) state.undo.shift();
    undo.disabled = false;
  }

  function takeBack() {
    const before = state.undo.pop();
    if (before) context.putImageData(before, 0, 0);
    undo.disabled = !state.undo.length;
  }

  function drawRing() {
    const scale = canvas.clientWidth / width;
    ring.style.width = ring.style.height = `${state.size * scale}px`;
    ring.style.left = `${state.at[0] * scale}px`;
    ring.style.top = `${state.at[1] * scale}px`;
    ring.classList.toggle("erasing", state.erasing);
  }

  const point = (event) => {
    const box = canvas.getBoundingClientRect();
    return [((event.clientX - box.left) / box.width) * width, ((event.clientY - box.top) / box.height) * height];
  };
  canvas.onpointerdown = (event) => {
    if (event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    canvas.focus();
    remember();
    state.last = state.at = point(event);
    dab(state.last, state.last);
    drawRing();
  };
  canvas.onpointermove = (event) => {
    state.at = point(event);
    if (state.last) { dab(state.last, state.at); state.last = state.at; }
    drawRing();
  };
  canvas.onpointerup = canvas.onpointercancel = () => { state.last = null; };

  const size = element("input", { type: "range", min: 2, max: Math.round(width / 4), value: state.size, ariaLabel: "Size of the brush" });
  size.oninput = () => { state.size = Number(size.value); drawRing(); };
  const resize = (wanted) => { size.value = wanted; size.dispatchEvent(new Event("input")); };
  const erase = button("Erase", () => setErasing(!state.erasing), "toggle small");
  function setErasing(wanted) {
    state.erasing = wanted;
    erase.ariaPressed = String(wanted);
    drawRing();
  }
  const undo = button("Undo", takeBack, "small");
  const clear = button("Clear all", () => { remember(); context.clearRect(0, 0, width, height); }, "quiet small");
  const keep = button("Keep", save, "primary");
  const leave = button("Leave", () => done(false), "quiet");

  /** A picture turned clockwise by quarter turns. @returns {[HTMLCanvasElement, CanvasRenderingContext2D]} */
  function turned(source, by, size) {
    const out = element("canvas", { width: size[0], height: size[1] });
    const drawn = out.getContext("2d");
    drawn.translate(size[0] / 2, size[1] / 2);
    drawn.rotate((by * Math.PI) / 2);
    drawn.drawImage(source, -source.width / 2, -source.height / 2);
    return [out, drawn];
  }

  async function save() {
    const [out, drawn] = turned(canvas, -turns, stored);
    drawn.setTransform(1, 0, 0, 1, 0, 0);
    drawn.globalCompositeOperation = "source-in";
    drawn.fillStyle = "#fff";
    drawn.fillRect(0, 0, stored[0], stored[1]);
    const painted = drawn.getImageData(0, 0, stored[0], stored[1]).data.some((value, index) => index % 4 === 3 && value > 127);
    const content = painted ? await new Promise((resolve) => out.toBlob(resolve, "image/png")) : "";
    try {
      await putBytes(place, content);
      await done(true);
    } catch (error) { complain(error); }
  }

  /** Show what is excluded now. */
  async function load() {
    const answer = await fetch(place);
    if (!answer.ok) throw fault(`The excluded regions of ${lens.name} could not be read.`, "Open the brush again.");
    const picture = await createImageBitmap(await answer.blob());
    const [out] = turned(picture, turns, [width, height]);
    const read = out.getContext("2d").getImageData(0, 0, width, height);
    for (let k = 0; k < read.data.length; k += 4) read.data[k + 3] = read.data[k] > 127 ? 255 : 0;
    context.putImageData(read, 0, 0);
    context.globalCompositeOperation = "source-in";
    context.fillStyle = colour;
    context.fillRect(0, 0, width, height);
  }

  canvas.onkeydown = (event) => {
    const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    const far = Math.max(1, state.size / (event.shiftKey ? 1 : 4));
    if (by) {
      const to = [Math.min(width, Math.max(0, state.at[0] + by[0] * far)), Math.min(height, Math.max(0, state.at[1] + by[1] * far))];
      if (state.holding) dab(state.at, to);
      state.at = to;
    } else if (event.key === " ") {
      if (!event.repeat && !state.holding) { remember(); state.holding = true; dab(state.at, state.at); }
    } else if (event.key === "[") { resize(0.8 * state.size); }
    else if (event.key === "]") { resize(Math.max(state.size + 1, 1.25 * state.size)); }
    else if (event.key === "x") setErasing(!state.erasing);
    else if (event.key === "z" && (event.ctrlKey || event.metaKey)) takeBack();
    else if (event.key === "Enter") save();
    else if (event.key === "Escape") done(false);
    else return;
    event.preventDefault();
    drawRing();
  };
  canvas.onkeyup = (event) => { if (event.key === " ") state.holding = false; };
  canvas.onblur = () => { state.holding = false; };

  undo.disabled = true;
  setErasing(false);
  const tools = element("div", { className: "mask-bar" }, element("b", {}, lens.name), element("label", { className: "check" }, "size", size), erase, undo, clear, spring(), leave, keep);
  try {
    if (lens.excluded) await load();
  } catch (error) {
    complain(error);
    await done(false);
    return;
  }
  fill(setup.aside, tools, element("div", { className: "brush-room" }, sheet), element("p", { className: "hint brush-help" }, HELP));
  canvas.focus();
  drawRing();
}
