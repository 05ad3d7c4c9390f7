// The layer transport, under the timeline: a tile for each layer of the shown frame, and what plays
// them.
//
// All tiles of a frame are there from its first layer on, so nothing moves while it is searched; a
// layer that is still to come is an empty tile.

import { figure } from "../chart_looks.js";
import { byId } from "../elements.js";
import { stepLayer } from "../selection.js";
import { drawSoon } from "../pacing.js";
import { get, watch } from "../state.js";
import { layerColour, onTheme } from "../theme.js";
import { follow, html, mount, signal, useMemo } from "./component.js";
import { Select } from "./parts.js";
import { LayerOutline, scaleOf } from "./layer_outline.js";
import { layerPlayback, playLayers, RATES, scrubTo, toggleLayers } from "./layer_playback.js";
import {
  layerWords,
  missingLayerWords,
  searchName,
  shownLayers,
  survivorsOf,
  varianceShare,
} from "./shown_layers.js";

const PLAY = "M4 2.5v11l9-5.5z";
const PAUSE = "M4 3h3v10H4zM9 3h3v10H9z";
const LOOP =
  "M8 2.5a5.5 5.5 0 0 1 4.6 2.5V2.8h1.5V8H9V6.5h2.6A4 4 0 1 0 12 8.9h1.5A5.5 5.5 0 1 1 8 2.5z";
const PINGPONG = "M5 3v2.2h6V3l4 3.5L11 10V7.8H5V10L1 6.5zM2 12h12v1.5H2z";
/**
 * The variance bar of a layer that has so small a share of the first layer's, or less, is empty.
 */
const LEAST_SHARE = 1e-4;

const icon = (path) => html`<svg viewBox="0 0 16 16"><path d=${path} /></svg>`;

/** Rises when the theme changes: the layers' colours are those of the theme. */
const looks = signal(0);

/** The shown frame's layers, renewed at most ten times a second, however fast they are searched. */
const shown = signal(shownLayers());
const renew = () => {
  shown.value = shownLayers();
};

/** A layer's numbers in words. */
function numbersOf(layer) {
  const survivors = survivorsOf(layer);
  const parts = [];
  if (layer.beta !== null) parts.push(`β ${figure(layer.beta)}`);
  if (survivors === null) parts.push(`${layer.particles} evaluations`);
  else parts.push(`${survivors} of ${layer.particles} survive`);
  return parts.join(" · ");
}

/** What the strip shows, in words, and what there is to say of it. @returns {string[]} */
function shownWords(/** @type {number | null} */ chosen) {
  const { layers, isTrial } = shown.value;
  if (chosen === null) return ["all layers", isTrial ? "of the frame annealed again" : ""];
  const layer = layers[chosen];
  if (!layer) return missingLayerWords(chosen, shown.value);
  return [layerWords(chosen, shown.value), numbersOf(layer)];
}

/**
 * How high a layer's variance bar stands, 0 to 1: the share of the first layer's variance on a log
 * scale.
 */
const barOf = (share) =>
  share === null ? 0 : Math.max(0, 1 - Math.log(Math.min(1, share)) / Math.log(LEAST_SHARE));

function titleOf(words, layer, share) {
  if (!layer) return `${words}: still to come`;
  const survivors = survivorsOf(layer);
  return [
    words,
    layer.beta !== null && `exponent β ${figure(layer.beta)}`,
    `${layer.particles} evaluations`,
    survivors !== null && `${survivors} survivors`,
    share !== null && `variance ${figure(100 * share)} % of the first layer's`,
  ]
    .filter(Boolean)
    .join("\n");
}

function Tile({ number, layer, first, scale, colour, isChosen, title, isTrial }) {
  const share = layer ? varianceShare(first, layer) : null;
  const survivors = layer ? survivorsOf(layer) : null;
  const name = [
    "layer-tile",
    layer ? "" : "to-come",
    isChosen ? "chosen" : "",
    isTrial ? "tried" : "",
  ];
  return html`<div
    class=${name.filter(Boolean).join(" ")}
    style=${{ "--layer": colour }}
    title=${titleOf(title, layer, share)}
  >
    <b>${number}</b>
    <${LayerOutline} outline=${layer?.outline} scale=${scale} colour=${colour} />
    <span class="layer-numbers">
      ${
        layer &&
        html`${layer.beta === null ? "" : html`<span>β ${figure(layer.beta)}</span>`}
          <span>${survivors === null ? layer.particles : `${survivors} of ${layer.particles}`}</span>`
      }
    </span>
    <i class="layer-bar"><i style=${{ height: `${100 * barOf(share)}%` }}></i></i>
  </div>`;
}

/** The tiles, one slider: a drag goes from layer to layer, Escape shows all of them together. */
function Tiles() {
  const chosen = follow("layer");
  const theme = looks.value;
  const { layers, count, searchLayers, searches, isTrial } = shown.value;
  const scale = useMemo(() => scaleOf(layers.map((layer) => layer.outline)), [layers]);
  const colours = useMemo(
    () => Array.from({ length: count }, (_, at) => layerColour(at, count)),
    [count, theme],
  );
  const groups = Array.from({ length: Math.ceil(count / searchLayers) }, (_, search) =>
    Array.from(
      { length: Math.min(searchLayers, count - search * searchLayers) },
      (_, at) => search * searchLayers + at,
    ),
  );
  const takePointer = (event) => {
    if (event.type === "pointermove" && !event.buttons) return;
    const strip = event.currentTarget;
    if (event.type === "pointerdown") strip.setPointerCapture(event.pointerId);
    const tiles = [...strip.querySelectorAll(".layer-tile")];
    const at = tiles.findIndex((tile) => event.clientX <= tile.getBoundingClientRect().right);
    const wanted = at < 0 ? tiles.length - 1 : at;
    if (layers.length) scrubTo(Math.min(layers.length - 1, wanted));
  };
  const takeKey = (event) => {
    const last = layers.length - 1;
    const to = { Home: 0, End: last }[event.key];
    const by = { ArrowLeft: -1, ArrowRight: 1, ArrowDown: -1, ArrowUp: 1 }[event.key];
    if (to === undefined && by === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    if (last < 0) return;
    const from = chosen ?? (by === 1 ? -1 : last + 1);
    scrubTo(to ?? Math.max(0, Math.min(last, from + (by ?? 0))));
  };
  return html`<div
    class=${`layer-tiles ${searches > 1 ? "searches" : ""}`}
    id="layer-tiles"
    role="slider"
    tabindex="0"
    aria-label="Layer"
    aria-valuemin="1"
    aria-valuemax=${Math.max(1, layers.length)}
    aria-valuenow=${Math.max(1, Math.min(layers.length, (chosen ?? Infinity) + 1))}
    aria-valuetext=${chosen === null ? "all layers together" : shownWords(chosen).join(", ")}
    onPointerDown=${takePointer}
    onPointerMove=${takePointer}
    onKeyDown=${takeKey}
  >
    ${groups.map(
      (group, search) =>
        html`<div
          key=${search}
          class="layer-search"
          style=${{ flexGrow: group.length }}
          data-name=${searches > 1 ? searchName(search) : null}
        >
          ${group.map(
            (layer) =>
              html`<${Tile}
                key=${layer}
                number=${(layer % searchLayers) + 1}
                layer=${layers[layer]}
                first=${layers[0]}
                scale=${scale}
                colour=${colours[layer]}
                isChosen=${layer === chosen}
                title=${layerWords(layer, shown.value)}
                isTrial=${isTrial}
              />`,
          )}
        </div>`,
    )}
  </div>`;
}

function Tools() {
  const { playing, rate, mode } = layerPlayback.value;
  const chosen = follow("layer");
  const none = !shown.value.layers.length;
  const [words, more] = shownWords(chosen);
  const isPingpong = mode === "pingpong";
  const back = isPingpong ? "Forth and back" : "In a loop";
  return html`
    <div class="group" role="group" aria-label="Layers">
      <button
        class="icon"
        id="play-layers"
        disabled=${none}
        aria-label=${playing ? "Pause layers" : "Play layers"}
        title="Play or pause the layers (shift space)"
        onClick=${toggleLayers}
      >
        ${icon(playing ? PAUSE : PLAY)}
      </button>
      <${Select}
        id="layer-rate"
        aria-label="Layers a second"
        title="Layers a second"
        options=${RATES.map((one) => [String(one), `${one}/s`])}
        value=${String(rate)}
        take=${(chosen) => playLayers({ rate: Number(chosen) })}
      />
      <button
        class="icon toggle"
        id="layer-mode"
        aria-label="Forth and back"
        aria-pressed=${String(isPingpong)}
        title=${`${back}; a click changes it`}
        onClick=${() => playLayers({ mode: isPingpong ? "loop" : "pingpong" })}
      >
        ${icon(isPingpong ? PINGPONG : LOOP)}
      </button>
      <button
        class="icon"
        id="layer-back"
        disabled=${none}
        aria-label="Layer before"
        title="Layer before (shift ←)"
        onClick=${() => step(-1)}
      >
        ‹
      </button>
      <button
        class="icon"
        id="layer-on"
        disabled=${none}
        aria-label="Next layer"
        title="Next layer (shift →)"
        onClick=${() => step(1)}
      >
        ›
      </button>
    </div>
    <output class="layer-words" id="layer-label">
      <span>${words}</span>
      <small>${more}</small>
    </output>
  `;
}

/** One layer on or back by hand; past either end all layers are shown together. */
export function step(by) {
  playLayers({ playing: false });
  stepLayer(by);
}

/**
 * Leave the layers: stop what plays and show all of them together. Whether there was anything to
 * leave.
 */
export function leaveLayers() {
  if (!layerPlayback.value.playing && get("layer") === null) return false;
  scrubTo(null);
  return true;
}

/** Show the strip. */
export function startLayerStrip() {
  onTheme(() => {
    looks.value += 1;
  });
  watch(["whatIf", "detail", "layerCount"], () => drawSoon(renew));
  mount(byId("layers"), html`<div class="layer-tools"><${Tools} /></div><${Tiles} />`);
}
