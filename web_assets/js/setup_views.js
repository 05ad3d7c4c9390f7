// All cameras' pictures of one frame beside the step, with what a run found drawn over them; or the
// scene instead.

import { post, runPath } from "./api.js";
import { showPicture } from "./elements.js";
import { complain } from "./messages.js";
import { loadScene } from "./scene_window.js";
import { studioPath } from "./sessions.js";
import { html, useEffect, useLayoutEffect, useRef, useState } from "./studio/component.js";
import { opensLarge } from "./studio/dialogs.js";
import { Check } from "./studio/parts.js";

const HEIGHT = 420;

/** The 3-D scene. */
export function SceneFrame({ kind = "" }) {
  const frame = useRef(/** @type {HTMLIFrameElement | null} */ (null));
  useLayoutEffect(() => {
    loadScene(frame.current);
  }, []);
  return html`<iframe ref=${frame} title="3-D scene" class=${kind}></iframe>`;
}

/** A camera's picture; another replaces it once it is decoded. */
function View({ name, address, note }) {
  const image = useRef(/** @type {HTMLImageElement | null} */ (null));
  const newest = address(HEIGHT);
  useEffect(() => showPicture(image.current, newest), [newest]);
  return html`<figure class="picture">
    <img ref=${image} alt=${`View of ${name}`} ...${opensLarge(name)} />
    <figcaption><b>${name}</b>${note && html`<span class=${note.kind}>${note.words}</span>`}</figcaption>
  </figure>`;
}

/**
 * The wall. `shown`: which frame of which run, in which track ("raw" unless said); without it
 * `words` say why there is nothing. `noteOf(camera)`: what stands under its picture; `children`:
 * tools over them.
 * @param {{ setup: import("./setup.js").Setup, shown: { run: string, frame: number, track?: string }
 *   | null, words?: string, noteOf?: (camera: string) => { words: string, kind: string } | null,
 *   children?: any }} properties
 */
export function ViewWall({ setup, shown, words = "", noteOf, children }) {
  const [isScene, setScene] = useState(false);
  const { run = "", frame = 0, track = "raw" } = shown ?? {};
  /** @type {Record<string, string>} */
  const chosen = track === "raw" ? {} : { track };
  useEffect(() => {
    if (shown && isScene)
      post("/api/scene/show", { session: setup.session, run, frame, options: chosen }).catch(
        complain,
      );
  }, [isScene, run, frame, track]);
  if (!shown) return html`<div class="aside-empty"><p>${words}</p></div>`;
  const address = (/** @type {string} */ camera, /** @type {number} */ height) =>
    `${runPath(setup.session, run)}/frames/${frame}/views/${encodeURIComponent(camera)}.jpg?` +
    new URLSearchParams({ show: "outline", height: String(height), ...chosen });
  return html`
    <div class="pictures-bar">
      ${children && html`<div class="wall-tools">${children}</div>`}
      <output>frame ${frame}</output><span class="spring"></span>
      <a
        class="link-button"
        href=${studioPath(setup.session, run, { frame, panel: "why", ...chosen })}
        title="This run and frame in the studio, where its search can be looked into"
      >
        Open in the studio
      </a>
      <${Check} checked=${isScene} take=${setScene}>3-D scene</${Check}>
    </div>
    ${
      isScene
        ? html`<${SceneFrame} kind="below-bar" />`
        : html`<div class="pictures">
            ${setup.detail.cameras.map(
              ({ name }) =>
                html`<${View}
                  key=${name}
                  name=${name}
                  address=${(/** @type {number} */ height) => address(name, height)}
                  note=${noteOf?.(name)}
                />`,
            )}
          </div>`
    }
  `;
}
