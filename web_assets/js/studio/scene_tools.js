// Over the scene: where it is looked at from, what the pointer is on.

import { post } from "../api.js";
import { byId } from "../elements.js";
import { complain } from "../messages.js";
import { NARROW, showKnobs } from "../scene_frame.js";
import { get, set } from "../state.js";
import { follow, html, mount, signal, useEffect, useSignalEffect } from "./component.js";

/** @import { Answer } from "../api_types" */

const HOVER_MILLISECONDS = 80;

/** Whether the view goes along with the body from frame to frame. */
const follows = signal(false);
/** Whether the scene is too narrow for its panel, and whether the panel is shown all the same. */
const isNarrow = signal(false);
const hasKnobs = signal(false);
/** @typedef {NonNullable<Answer<"/api/scene/point", "post">>} Pointed */
/**
 * @type {import("@preact/signals").Signal<{ found: Pointed, left: number, top: number } | null>}
 */
const pointed = signal(null);

/** @param {"body" | "front" | "side" | "top" | "first"} move */
const go = (move) => post("/api/scene/camera", { move }).catch(complain);

/** Let the body fill the scene, seen from where it is seen. */
export const frameBody = () => go("body");

/** The view that the session opens with, through no camera. */
export function resetView() {
  follows.value = false;
  if (get("through")) set({ through: null });
  else go("first");
}

/** Go along with the body from frame to frame, or stay. */
export function toggleFollow() {
  follows.value = !follows.value;
  if (follows.value) frameBody();
}

/**
 * What the pointer does over the scene: it names the particle that it is on, a click chooses it.
 */
export const scenePointer = { hover, click };

let isAsking = false;
let asked = 0;

/**
 * @param {number[] | null} place
 * @param {PointerEvent} event
 */
async function hover(place, event) {
  if (get("layer") === null || !place) {
    if (pointed.value) post("/api/scene/point", {}).catch(() => {});
    pointed.value = null;
    return;
  }
  if (isAsking || event.timeStamp - asked < HOVER_MILLISECONDS) return;
  isAsking = true;
  asked = event.timeStamp;
  const found = await post("/api/scene/point", { at: place }).catch(() => null);
  isAsking = false;
  pointed.value = found ? { found, left: event.clientX, top: event.clientY } : null;
}

/** @param {number[]} place */
function click(place) {
  if (get("layer") !== null) {
    post("/api/scene/point", { at: place, choose: true }).catch(complain);
  }
}

/** @param {number} share */
const percent = (share) => `${(100 * share).toPrecision(share < 0.1 ? 2 : 3)} %`;

/** The particle that the pointer is on, in words beside it. */
function PointedCard() {
  if (!pointed.value) return null;
  const { found, left, top } = pointed.value;
  const line = found.line.map((row) => row + 1);
  const back = line.length > 1 ? `line ${line.join(" → ")}` : "of the first set";
  return html`<div class="scene-pointed" style=${{ left: `${left + 14}px`, top: `${top + 14}px` }}>
    <b>particle ${found.particle + 1} of ${found.particles}</b>
    <span>weight ${found.weight === null ? "–" : percent(found.weight)}, layer ${found.layer + 1}</span>
    <small>${back}</small>
  </div>`;
}

/**
 * @param {{ label: string, title: string, act: () => void, pressed?: boolean, children: any }}
 *   properties
 */
function Tool({ label, title, act, pressed, children }) {
  return html`<button
    class="icon"
    aria-label=${label}
    title=${title}
    aria-pressed=${pressed === undefined ? undefined : String(pressed)}
    onClick=${act}
  >
    ${children}
  </button>`;
}

/** @param {string} path */
const drawing = (path) => html`<svg viewBox="0 0 16 16"><path d=${path} /></svg>`;
const FRAME =
  "M2 2h4v1.5H3.5V6H2zM10 2h4v4h-1.5V3.5H10zM2 10h1.5v2.5H6V14H2zM12.5 10H14v4h-4v-1.5h2.5zM8 5a3 3 0 1 1 0 6 3 3 0 0 1 0-6z";
const FOLLOW = "M8 1.5 11 5H9v2h2V5l3.5 3-3.5 3V9H9v2h2l-3 3.5L5 11h2V9H5v2L1.5 8 5 5v2h2V5H5z";
const RESET =
  "M8 2.5a5.5 5.5 0 1 1-5.4 6.6l1.5-.3A4 4 0 1 0 5.2 5.2L7 7H2.5V2.5l1.6 1.6A5.5 5.5 0 0 1 8 2.5z";
const FULL = "M2 2h5v1.5H4.6L8 6.9 6.9 8 3.5 4.6V7H2zM9 14v-1.5h2.4L8 9.1 9.1 8l3.4 3.4V9H14v5z";

function toggleFullScreen() {
  if (document.fullscreenElement) document.exitFullscreen();
  else byId("stage").requestFullscreen();
}

const KNOBS =
  "M2 4h6v1.5H2zM11 4h3v1.5h-3zM8 3h2v3.5H8zM2 10.5h2V12H2zM7 10.5h7V12H7zM4 9.5h2V13H4z";

/** The panel with the knobs, where the scene is too narrow to have it beside the body. */
function Knobs() {
  useEffect(() => {
    const watch = new ResizeObserver(([{ contentRect }]) => {
      isNarrow.value = contentRect.width <= NARROW;
    });
    watch.observe(byId("scene"));
    return () => watch.disconnect();
  }, []);
  if (!isNarrow.value) return null;
  const toggle = () => {
    hasKnobs.value = !hasKnobs.value;
    showKnobs(hasKnobs.value);
  };
  return html`<${Tool}
    label="Knobs"
    title="Survival rate, layers, particles and the other knobs, over the scene"
    pressed=${hasKnobs.value}
    act=${toggle}
  >
    ${drawing(KNOBS)}
  <//>`;
}

function SceneTools() {
  const through = follow("through");
  useSignalEffect(() => {
    // A scene that was built anew does not know it.
    if (follow("connected")) {
      const options = { follows_body: follows.value };
      post("/api/scene/view", { options }).catch(() => {});
    }
  });
  return html`<div class="scene-tools" role="group" aria-label="View of the scene">
      <${Tool} label="Frame the body" title="Frame the body (f)" act=${frameBody}>
        ${drawing(FRAME)}
      <//>
      <${Tool}
        label="Follow the body"
        title="Go along with the body from frame to frame (g)"
        pressed=${follows.value}
        act=${toggleFollow}
      >
        ${drawing(FOLLOW)}
      <//>
      <button class="small" title="See the body from its front" onClick=${() => go("front")}>Front</button>
      <button class="small" title="See the body from its left side" onClick=${() => go("side")}>Side</button>
      <button class="small" title="See the body from above" onClick=${() => go("top")}>Top</button>
      <${Tool} label="First view" title="Back to the first view, through no camera (0)" act=${resetView}>
        ${drawing(RESET)}
      <//>
      <${Tool} label="Full screen" title="The scene on the whole screen, and back" act=${toggleFullScreen}>
        ${drawing(FULL)}
      <//>
      <${Knobs} />
      ${
        through &&
        html`<button class="small scene-through" title="Leave the camera (0)" onClick=${resetView}>
          through ${through} ✕
        </button>`
      }
    </div>
    <${PointedCard} />`;
}

/** Put the tools over the scene. */
export function startSceneTools() {
  mount(byId("scene-tools"), html`<${SceneTools} />`);
}
