// The pictures of all views with their masks, in a frame that can be chosen; knobs that are tried
// show at once.

import { sessionPath } from "./api.js";
import { agreementOf } from "./setup_quality.js";
import { batch, html, into, signal, useEffect, useRef, useState } from "./studio/component.js";
import { opensLarge } from "./studio/dialogs.js";
import { Action, Check } from "./studio/parts.js";

/** @import { Schemas } from "./api_types" */

const HEIGHT = 420;
const SPREAD = 5;

/**
 * Which pictures are shown.
 * @param {import("./setup.js").Setup} setup
 * @param {number} count of frames
 */
export function shownMasks(setup, count) {
  const last = Math.max(0, count - 1);
  const shown = {
    here: sessionPath(setup.session),
    last,
    /** Cameras of which a picture has been shown. @type {Set<string>} */
    seen: new Set(),
    frame: signal(Math.min(last, Math.floor(count / 2))),
    /** Knobs that are tried. @type {import("@preact/signals").Signal<Record<string, any>>} */
    settings: signal({}),
    /** Rises whenever the masks may be others. */
    age: signal(0),
    isBare: signal(false),
    /** While new masks are cut the old ones are not shown: they would pass for the result. */
    isCutting: signal(false),
    refresh() {
      shown.age.value += 1;
    },
    /** Show the masks under other knobs. @param {Record<string, any>} settings */
    preview: (settings) =>
      batch(() => {
        shown.settings.value = { ...settings };
        shown.refresh();
      }),
    /** @param {boolean} isCutting */
    cut: (isCutting) =>
      batch(() => {
        if (shown.isCutting.value !== isCutting) shown.refresh();
        shown.isCutting.value = isCutting;
      }),
    /** @param {string} camera */
    address(camera) {
      const settings = shown.settings.value;
      const tried = Object.keys(settings).length
        ? `&settings=${encodeURIComponent(JSON.stringify(settings))}`
        : "";
      const show = shown.isBare.value || shown.isCutting.value ? "" : "mask";
      const view = `frames/${shown.frame.value}/views/${encodeURIComponent(camera)}.jpg`;
      return `${shown.here}/${view}?show=${show}&height=${HEIGHT}&age=${shown.age.value}${tried}`;
    },
    /**
     * Before the first mask the picture alone, as it is recorded: a session's first masks take
     * their time.
     * @param {string} camera
     */
    first(camera) {
      const lens = setup.detail.cameras.find((one) => one.name === camera);
      return lens?.quarter_turns
        ? ""
        : `${shown.here}/footage/${encodeURIComponent(camera)}/${shown.frame.value}.jpg?height=${HEIGHT}`;
    },
  };
  return shown;
}

/** @typedef {ReturnType<typeof shownMasks>} Shown */
/** @typedef {Schemas["BackgroundAnswer"]["cameras"][number]} Camera */
/**
 * @typedef {{ shown: Shown, cameras: Camera[], quality: Schemas["MaskQuality"] | null,
 *   exclude: (camera: string) => void, hide: (camera: string) => void,
 *   paint: (camera: string) => void, otherwise?: string }}
 *   MaskProperties
 *   `exclude` opens the brush for what does not count, `hide` that for things in front, `paint`
 *   that for strokes; `otherwise`: in words whose masks are shown, where others were chosen
 */

/** The pictures, and the bar that chooses their frame. @param {MaskProperties} properties */
export function MaskPictures({ shown, cameras, otherwise = "", ...more }) {
  const frame = shown.frame.value;
  const apart = Math.max(1, Math.round(shown.last / SPREAD));
  const go = (/** @type {number} */ to) => {
    shown.frame.value = Math.max(0, Math.min(shown.last, to));
  };
  const step = (
    /** @type {string} */ words,
    /** @type {number} */ by,
    /** @type {string} */ name,
  ) =>
    html`<${Action} kind="small" act=${() => go(frame + by)} aria-label=${name}>${words}</${Action}>`;
  return html`
    <div class="mask-bar">
      ${step("‹", -apart, "Some frames back")}
      <input
        type="range"
        min="0"
        max=${shown.last}
        value=${frame}
        aria-label="Frame"
        onInput=${({ target }) => go(Number(target.value))}
      />
      ${step("›", apart, "Some frames on")}
      <output>frame ${frame}</output>
      <${Check}
        checked=${shown.isBare.value}
        take=${into(shown.isBare)}
      >
        picture alone
      </${Check}>
    </div>
    ${otherwise && !shown.isBare.value && html`<p class="notice masks-in-use">${otherwise}</p>`}
    ${
      !shown.isBare.value &&
      html`<p class="hint mask-words">
        Red: the subject. Violet: it cannot be told whether it is.
      </p>`
    }
    <div class=${shown.isCutting.value ? "pictures masks cutting" : "pictures masks"}>
      ${cameras.map(
        (camera) =>
          html`<${MaskPicture} key=${camera.name} shown=${shown} camera=${camera} ...${more} />`,
      )}
    </div>
  `;
}

/**
 * One request at a time; the newest one follows when the last is answered.
 * @param {Omit<MaskProperties, "cameras"> & { camera: Camera }} properties
 */
function MaskPicture({ shown, camera, quality, exclude, hide, paint }) {
  const image = useRef(/** @type {HTMLImageElement | null} */ (null));
  const [state, setState] = useState("waiting");
  const wanted = shown.address(camera.name);
  const request = useRef({ newest: wanted, asked: "", isBusy: false });
  request.current.newest = wanted;
  const load = () => {
    const now = request.current;
    const address = (shown.seen.has(camera.name) ? "" : shown.first(camera.name)) || now.newest;
    if (!image.current || now.isBusy || now.asked === address) return;
    Object.assign(now, { asked: address, isBusy: true });
    setState("waiting");
    image.current.src = address;
  };
  const done = (/** @type {boolean} */ isWrong) => {
    request.current.isBusy = false;
    shown.seen.add(camera.name);
    setState(isWrong ? "failed" : "");
    load();
  };
  useEffect(load, [wanted]);
  const line = quality?.cameras.find((one) => one.camera === camera.name);
  return html`<figure class=${`picture ${state}`}>
    <img
      ref=${image}
      alt=${`Mask of ${camera.name}`}
      ...${opensLarge(`${camera.name}, frame ${shown.frame.value}`)}
      onLoad=${() => done(false)}
      onError=${() => done(true)}
    />
    <figcaption>
      <div class="head-line">
        <b>${camera.name}</b>
        ${
          line &&
          html`<span class=${`badge ${line.usable ? "good" : "bad"}`}>
            ${line.agreement === null ? "empty" : agreementOf(line)}
          </span>`
        }
        ${camera.excluded && html`<span class="hint">regions excluded</span>`}
        ${
          camera.in_front &&
          html`<span class="hint">in front: ${camera.found ? "found" : "painted"}</span>`
        }
        <span class="spring"></span>
        <${Action}
          kind="small"
          act=${() => paint(camera.name)}
          aria-label=${`Paint strokes of ${camera.name}`}
        >
          Strokes…
        </${Action}>
        <${Action}
          kind="small"
          act=${() => exclude(camera.name)}
          aria-label=${`Exclude regions of ${camera.name}`}
        >
          Exclude…
        </${Action}>
        <${Action}
          kind="small"
          act=${() => hide(camera.name)}
          aria-label=${`Paint things in front in ${camera.name}`}
        >
          In front…
        </${Action}>
      </div>
    </figcaption>
  </figure>`;
}
