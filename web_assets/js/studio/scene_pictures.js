// What is taken along of the scene: a picture as it stands, or a film of the frame's layers or the
// run's frames. The film is kept with the run's exports, where it is found again; here it is
// offered once it is done.

import { accepted, fetchJson, post, readOnly, remove, runPath } from "../api.js";
import { download } from "../elements.js";
import { isGoing, timeLeft } from "../jobs.js";
import { onEvent } from "../live.js";
import { complain } from "../messages.js";
import { get } from "../state.js";
import { windowName } from "../window.js";
import { follow, html, mount, signal, useEffect, useState } from "./component.js";
import { Check, Select } from "./parts.js";

const SCALE = 2;
const PICTURE = "M2 3.5h12v9H2zM3.4 11h9.2L9.4 6.6 7 9.6 5.6 8z";
const FILM =
  "M2 3h12v10H2zM3.4 4.4v1.4h1.4V4.4zm0 5.8v1.4h1.4v-1.4zm7.8-5.8v1.4h1.4V4.4zm0 5.8v1.4h1.4v-1.4zM6 4.4v7.2h4V4.4z";

/** The film that was begun here, as it stands. @type {import("@preact/signals").Signal<any>} */
const film = signal(null);

/** @param {boolean} transparent */
async function takePicture(transparent) {
  const answer = await accepted(
    await fetch("/api/scene/picture", {
      method: "POST",
      headers: { "content-type": "application/json", "x-studio-window": windowName },
      body: JSON.stringify({ scale: SCALE, transparent }),
    }),
  );
  const layer = get("layer") === null ? "" : `-layer-${get("layer") + 1}`;
  download(
    `${get("session")}-${get("run")}-frame-${get("frame")}${layer}.png`,
    await answer.blob(),
  );
}

/**
 * A film of the run that is still being made, begun before the page was loaded.
 * @param {any} session
 * @param {any} run
 */
async function refind(session, run) {
  if (!run || isGoing(film.value)) return;
  const { running } = await fetchJson(`${runPath(session, run)}/exports`);
  film.value = running.find((one) => ["mp4", "gif"].includes(one.format)) ?? null;
}

/** @param {{ label: string, icon: string, open: boolean, act: () => void }} properties */
function Tool({ label, icon, open, act }) {
  return html`<button
    class="icon"
    aria-label=${label}
    title=${label}
    aria-expanded=${String(open)}
    onClick=${act}
  >
    <svg viewBox="0 0 16 16"><path d=${icon} fill-rule="evenodd" /></svg>
  </button>`;
}

/** @param {{ close: () => void }} properties */
function PictureForm({ close }) {
  const [transparent, setTransparent] = useState(false);
  const [busy, setBusy] = useState(false);
  const take = async () => {
    setBusy(true);
    try {
      await takePicture(transparent);
      close();
    } catch (error) {
      complain(error);
    }
    setBusy(false);
  };
  return html`<div class="take-form" role="group" aria-label="Picture of the scene">
    <b>Picture of the scene</b>
    <${Check} checked=${transparent} take=${setTransparent}>transparent background</${Check}>
    <p class="hint">As it stands, at twice the window's size, with its caption.</p>
    <button class="primary" disabled=${busy} onClick=${take}>${busy ? "Drawing…" : "Save PNG"}</button>
  </div>`;
}

const RATES = [1, 3, 10];
const SPEEDS = [0.1, 0.25, 0.5, 1];
const FILES = [
  ["mp4", "MP4"],
  ["gif", "GIF"],
];

function FilmForm() {
  const [of, setOf] = useState("layers");
  const [kind, setKind] = useState("mp4");
  const [rate, setRate] = useState(3);
  const going = film.value && isGoing(film.value);
  const frames = follow("summary")?.frames ?? [];
  const [first, setFirst] = useState(/** @type {number | null} */ (null));
  const [last, setLast] = useState(/** @type {number | null} */ (null));
  const begin = async () => {
    try {
      const span = of === "frames" ? { first, last: last === null ? null : last + 1 } : {};
      film.value = await post("/api/scene/films", /** @type {any} */ ({ of, kind, rate, ...span }));
    } catch (error) {
      complain(error);
    }
  };
  const frame = (/** @type {(value: number | null) => void} */ set, /** @type {any} */ at) =>
    html`<input
      type="number"
      min="0"
      placeholder=${at?.frame ?? 0}
      onChange=${({ target }) => set(target.value === "" ? null : Number(target.value))}
    />`;
  const choices = of === "layers" ? RATES : SPEEDS;
  const words = (/** @type {number} */ one) =>
    of === "layers" ? `${one} layer${one === 1 ? "" : "s"}/s` : `${one}×`;
  return html`<div class="take-form" role="group" aria-label="Film of the scene">
    <b>Film of the scene</b>
    <${Select}
      label="of"
      options=${[["layers", "this frame's layers"], "frames"]}
      value=${of}
      take=${(chosen) => {
        setOf(chosen);
        setRate(chosen === "layers" ? 3 : 0.25);
      }}
    />
    ${
      of === "frames" &&
      html`<label>from ${frame(setFirst, frames[0])} to ${frame(setLast, frames.at(-1))}</label>`
    }
    <label>
      at
      <${Select}
        options=${choices.map((one) => [String(one), words(one)])}
        value=${String(rate)}
        take=${(chosen) => setRate(Number(chosen))}
      />
      <${Select} aria-label="File" options=${FILES} value=${kind} take=${setKind} />
    </label>
    <${FilmState} />
    ${!going && html`<button class="primary" onClick=${begin}>Make the film</button>`}
  </div>`;
}

function FilmState() {
  const state = film.value;
  if (!state) {
    return html`<p class="hint">The scene plays it meanwhile; it is kept with the run's exports.</p>`;
  }
  if (isGoing(state)) {
    const share = state.total ? state.done / state.total : 0;
    return html`<div class="take-state" role="status">
      <div class="long-progress"><i style=${`width: ${Math.round(100 * share)}%`}></i></div>
      <span>${state.done ?? 0} of ${state.total || "…"} ${timeLeft(state.seconds_left)}</span>
      <button class="small" onClick=${() => remove(`/api/exports/${state.identifier}`).catch(complain)}>
        Cancel
      </button>
    </div>`;
  }
  if (state.state === "done") {
    const file = `${runPath(state.session, state.run)}/exports/${encodeURIComponent(state.result.file)}`;
    return html`<a class="download" href=${file} download>Save ${state.result.file}</a>`;
  }
  return html`<p class="wrong">
    ${state.message || "The film was cancelled."} <span class="hint">${state.hint}</span>
  </p>`;
}

function ScenePictures() {
  const [open, setOpen] = useState("");
  const run = follow("run");
  useEffect(() => {
    refind(get("session"), run).catch(() => {});
  }, [run]);
  if (readOnly || !run) return null;
  const toggle = (/** @type {string} */ what) => setOpen(open === what ? "" : what);
  return html`<div
    class="take-along"
    onKeyDown=${(/** @type {any} */ event) => {
      if (event.key === "Escape") setOpen("");
    }}
  >
    <div class="group" role="group" aria-label="Take the scene along">
      <${Tool}
        label="Picture of the scene (PNG)"
        icon=${PICTURE}
        open=${open === "picture"}
        act=${() => toggle("picture")}
      />
      <${Tool}
        label="Film of layers or frames (MP4, GIF)"
        icon=${FILM}
        open=${open === "film"}
        act=${() => toggle("film")}
      />
    </div>
    ${open === "picture" && html`<${PictureForm} close=${() => setOpen("")} />`}
    ${open === "film" && html`<${FilmForm} />`}
  </div>`;
}

/** Show the buttons over the scene. */
export function startScenePictures() {
  onEvent("export", (event) => {
    if (film.value?.identifier === event.identifier) film.value = event;
  });
  const place = /** @type {HTMLElement} */ (document.getElementById("scene-pictures"));
  mount(place, html`<${ScenePictures} />`);
}
