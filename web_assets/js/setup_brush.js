// A brush over a camera's picture: what is painted does not count. Mouse, pen or keyboard; kept as
// a PNG of the footage's own size and orientation.

import { fault, putBytes, sessionPath } from "./api.js";
import { button, element, fill, penOf, spring } from "./elements.js";
import { complain } from "./messages.js";
import { painting, upright } from "./setup_painting.js";

const UNDONE = 30;
const HELP =
  "Paint what is not the subject. Keys: arrows move, space paints, x paints or erases, [ and ] change the size, ctrl z undoes, enter keeps, escape leaves.";

/** Edit what is excluded of `lens` (name, picture_width, picture_height, quarter_turns, frame, excluded: whether there is
 * something already, shown before a stroke can be made: one that came after would undo what was
 * painted meanwhile); `done(saved)` when left. */
export async function brush(setup, lens, done) {
  const place = `${sessionPath(setup.session)}/exclusions/${encodeURIComponent(lens.name)}`;
  const colour = getComputedStyle(document.documentElement).getPropertyValue("--accent").trim();
  let erasing = false;
  /** Where the stroke is. @type {number[] | null} */
  let last = null;
  /** @type {ImageData[]} */
  const before = [];
  const sheet = painting(setup, lens, {
    label: `Excluded regions of ${lens.name}. ${HELP}`,
    size: Math.round(upright(lens)[0] / 16),
    least: 2,
    most: Math.round(upright(lens)[0] / 4),
    centre: 0,
    slowness: 4,
    begin: (at) => {
      remember();
      dab(at, at);
      last = at;
    },
    to: (at) => {
      dab(last ?? at, at);
      last = at;
    },
    end: () => {
      last = null;
    },
    dress: (ring) => ring.classList.toggle("erasing", erasing),
    keys: { x: () => setErasing(!erasing), z: takeBack, Enter: save, Escape: () => done(false) },
  });
  const { canvas, width, height, turns, stored } = sheet;
  const context = penOf(canvas, { willReadFrequently: true });
  sheet.showFrame(lens.frame, "show=mask&");

  function dab(from, to) {
    context.globalCompositeOperation = erasing ? "destination-out" : "source-over";
    context.strokeStyle = colour;
    context.lineWidth = sheet.state.size;
    context.lineCap = context.lineJoin = "round";
    context.beginPath();
    context.moveTo(from[0], from[1]);
    context.lineTo(to[0] + 0.01, to[1]);
    context.stroke();
  }

  function remember() {
    before.push(context.getImageData(0, 0, width, height));
    if (before.length > UNDONE) before.shift();
    undo.disabled = false;
  }

  function takeBack() {
    const picture = before.pop();
    if (picture) context.putImageData(picture, 0, 0);
    undo.disabled = !before.length;
  }

  const erase = button("Erase", () => setErasing(!erasing), "toggle small");
  function setErasing(wanted) {
    erasing = wanted;
    erase.ariaPressed = String(wanted);
    sheet.drawRing();
  }
  const undo = button("Undo", takeBack, "small");
  const clear = button(
    "Clear all",
    () => {
      remember();
      context.clearRect(0, 0, width, height);
    },
    "quiet small",
  );
  const keep = button("Keep", save, "primary");
  const leave = button("Leave", () => done(false), "quiet");

  /**
   * A picture turned clockwise by quarter turns.
   * @returns {[HTMLCanvasElement, CanvasRenderingContext2D]}
   */
  function turned(source, by, size) {
    const out = element("canvas", { width: size[0], height: size[1] });
    const drawn = penOf(out);
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
    const painted = drawn
      .getImageData(0, 0, stored[0], stored[1])
      .data.some((value, index) => index % 4 === 3 && value > 127);
    const content = painted ? await new Promise((resolve) => out.toBlob(resolve, "image/png")) : "";
    try {
      await putBytes(place, content);
      await done(true);
    } catch (error) {
      complain(error);
    }
  }

  /** Show what is excluded now. */
  async function load() {
    const answer = await fetch(place);
    if (!answer.ok)
      throw fault(
        `The excluded regions of ${lens.name} could not be read.`,
        "Open the brush again.",
      );
    const picture = await createImageBitmap(await answer.blob());
    const [, drawn] = turned(picture, turns, [width, height]);
    const read = drawn.getImageData(0, 0, width, height);
    for (let k = 0; k < read.data.length; k += 4) read.data[k + 3] = read.data[k] > 127 ? 255 : 0;
    context.putImageData(read, 0, 0);
    context.globalCompositeOperation = "source-in";
    context.fillStyle = colour;
    context.fillRect(0, 0, width, height);
  }

  undo.disabled = true;
  setErasing(false);
  const tools = element(
    "div",
    { className: "mask-bar" },
    element("b", {}, lens.name),
    sheet.sized,
    erase,
    undo,
    clear,
    spring(),
    leave,
    keep,
  );
  try {
    if (lens.excluded) await load();
  } catch (error) {
    complain(error);
    await done(false);
    return;
  }
  fill(
    setup.aside,
    tools,
    element("div", { className: "brush-room" }, sheet.sheet),
    element("p", { className: "hint brush-help" }, HELP),
  );
  canvas.focus();
  sheet.drawRing();
}
