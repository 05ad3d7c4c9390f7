// Points clicked in the pictures of several cameras; the same points of the floor in two or more.

import { html, useState } from "./studio/component.js";
import { Action, Failure, Toggle } from "./studio/parts.js";

const FEWEST = 3;
const MOST = 32;

/**
 * Pixels of the stored picture under a point of the upright image: shares x, y (0..1) from its top
 * left corner.
 * @returns {[number, number]}
 */
function storedPixel(camera, x, y) {
  const turned = [
    [x, y],
    [y, 1 - x],
    [1 - x, 1 - y],
    [1 - y, x],
  ][camera.quarter_turns % 4];
  return [turned[0] * camera.width - 0.5, turned[1] * camera.height - 0.5];
}

/** And back: shares in the upright image of a stored pixel. */
function shownAt(camera, [u, v]) {
  const [a, b] = [(u + 0.5) / camera.width, (v + 0.5) / camera.height];
  return [
    [a, b],
    [1 - b, a],
    [1 - a, 1 - b],
    [b, 1 - a],
  ][camera.quarter_turns % 4];
}

/**
 * Cameras' pictures to click on, with what was clicked. `picture(name)`: the address of a camera's;
 * `marks(name)`: pixels of its stored picture and their words; `click(name, pixel)` hears of a
 * click.
 * @param {{ cameras: any[], picture: (camera: string) => string,
 *   marks: (camera: string) => { pixel: [number, number] | undefined, words: any, isChosen: boolean }[],
 *   click: (camera: string, pixel: [number, number]) => void }} properties
 */
export function ClickViews({ cameras, picture, marks, click }) {
  const hear = (/** @type {any} */ camera, /** @type {MouseEvent} */ event) => {
    const box = /** @type {HTMLElement} */ (event.currentTarget);
    const shape = /** @type {HTMLElement} */ (box.firstElementChild).getBoundingClientRect();
    const x = (event.clientX - shape.left) / shape.width;
    const y = (event.clientY - shape.top) / shape.height;
    if (x >= 0 && y >= 0 && x <= 1 && y <= 1) click(camera.name, storedPixel(camera, x, y));
  };
  return html`<div class="pictures click-views">
    ${cameras.map(
      (camera) => html`<figure key=${camera.name} class="picture">
        <div class="clickable" onClick=${(event) => hear(camera, event)}>
          <img src=${picture(camera.name)} alt=${`Picture of ${camera.name}`} draggable=${false} />
          <div class="marks">
            ${marks(camera.name).map(({ pixel, words, isChosen }) => {
              if (!pixel) return null;
              const [x, y] = shownAt(camera, pixel);
              return html`<i
                key=${words}
                class=${isChosen ? "mark chosen" : "mark"}
                style=${{ left: `${100 * x}%`, top: `${100 * y}%` }}
              >
                ${words}
              </i>`;
            })}
          </div>
        </div>
        <figcaption><b>${camera.name}</b></figcaption>
      </figure>`,
    )}
  </div>`;
}

/** In how many views a point was clicked. */
const viewsOf = (point) => Object.keys(point.pixels).length;

/**
 * Let a person click. `picture(name)`: the address of a camera's; `send(points)` takes those that
 * are complete, `stop()` ends it.
 * @param {{ cameras: any[], picture: (camera: string) => string,
 *   send: (points: any[]) => Promise<void>, stop: () => void }} properties
 */
export function FloorClicks({ cameras, picture, send, stop }) {
  const [points, setPoints] = useState(/** @type {any[]} */ ([{ pixels: {} }]));
  const [chosen, setChosen] = useState(0);
  const [wrong, setWrong] = useState(/** @type {any} */ (null));
  const complete = points.filter((point) => viewsOf(point) > 1);
  const isReady = complete.length >= FEWEST;

  const click = (/** @type {string} */ camera, /** @type {[number, number]} */ pixel) => {
    const pixels = { ...points[chosen].pixels, [camera]: pixel };
    const next = points.with(chosen, { pixels });
    const isFull = viewsOf(next[next.length - 1]) > 1 && next.length < MOST;
    setPoints(isFull ? [...next, { pixels: {} }] : next);
  };
  const done = () => {
    setWrong(null);
    return send(complete).catch(setWrong);
  };

  return html`<div class="calibrated">
    <div class="aside-actions">
      <${Action}
        kind="primary"
        act=${done}
        disabled=${!isReady}
        title=${
          isReady ? "" : `Three points in two views each are needed (there are ${complete.length}).`
        }
      >
        Set the floor
      </${Action}>
      <${Action} kind="quiet" act=${stop}>Cancel</${Action}>
    </div>
    <p class="hint">
      Click a point of the floor in one view and the same point in another; then choose the next
      number. The first becomes the origin, the second lies on X. Points far apart are best.
    </p>
    <div class="point-list">
      ${points.map((point, at) => {
        const seen = viewsOf(point);
        return html`<${Toggle} key=${at} isOn=${at === chosen} act=${() => setChosen(at)}>
          ${at + 1} · ${seen > 1 ? `${seen} views` : seen ? "one view" : "new"}
        </${Toggle}>`;
      })}
    </div>
    <${Failure} error=${wrong} />
    <${ClickViews}
      cameras=${cameras}
      picture=${picture}
      click=${click}
      marks=${(camera) =>
        points.map(({ pixels: { [camera]: pixel } }, at) => ({
          pixel,
          words: at + 1,
          isChosen: at === chosen,
        }))}
    />
  </div>`;
}
