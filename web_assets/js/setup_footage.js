// Step Footage: what the cameras recorded, how it is turned, and whether it is in step.

import { fetchJson, patch, sessionPath } from "./api.js";
import { dotted } from "./elements.js";
import { complain, say } from "./messages.js";
import { AddingForm, addingOf } from "./setup_adding.js";
import { Synchronisation, synchronyOf } from "./setup_synchrony.js";
import { batch, html, signal, useEffect, useState } from "./studio/component.js";
import { opensLarge } from "./studio/dialogs.js";
import { Action, Table } from "./studio/parts.js";

/** @import { Schemas } from "./api_types" */

const THUMB_HEIGHT = 420;
const FRAME_MILLISECONDS = 120;

/** @param {string} session */
export const load = (session) => fetchJson(`${sessionPath(session)}/footage`);

/**
 * What the step knows, and what can be done.
 * @param {import("./setup.js").Setup} setup
 * @param {Awaited<ReturnType<typeof load>>} loaded
 */
export function modelOf(setup, loaded) {
  const here = sessionPath(setup.session);
  const footage = signal(loaded);
  const warnings = signal(setup.detail.warnings ?? []);
  /** Rises when the pictures changed. */
  const age = signal(0);

  async function change(changes) {
    try {
      const changed = await patch(`${here}/footage`, changes);
      for (const note of changed.notes)
        say(note, { kind: changed.stale_runs.length ? "warning" : "info" });
      batch(() => {
        footage.value = changed;
        age.value += 1;
      });
    } catch (error) {
      complain(error);
    }
    await setup.refresh();
  }

  const sync = synchronyOf(setup, (offsets) => change({ offsets }));
  const adding = addingOf(setup, !loaded.cameras.length, async (job) => {
    for (const note of job.notes) say(note);
    const taken = await load(setup.session);
    batch(() => {
      footage.value = taken;
      warnings.value = job.warnings;
      age.value += 1;
    });
    await setup.refresh();
  });
  const takeDropped = ({ detail }) => adding.take(detail);
  document.addEventListener("footage", /** @type {any} */ (takeDropped));
  if (setup.asked.dropped) adding.take(setup.asked.dropped).catch(complain);

  return {
    footage,
    warnings,
    age,
    here,
    sync,
    adding,
    turn: ({ name, turned }) => change({ rotations: { [name]: (turned + 90) % 360 } }),
    stop: () => {
      document.removeEventListener("footage", /** @type {any} */ (takeDropped));
      sync.stop();
      adding.stop();
    },
  };
}

/** @typedef {ReturnType<typeof modelOf>} Model */

/** @param {{ footage: Model["footage"]["value"] }} properties */
const Cameras = ({ footage: { cameras, fps, frame_count: count } }) =>
  cameras.length > 0 &&
  html`<section class="footage-cameras">
    <p class="hint">${count} frames at ${Number(fps.toFixed(3))} a second are in all cameras.</p>
    <div class="scrolls">
      <${Table}
        heads=${["camera", "size", "frames", "turned"]}
        rows=${cameras.map((camera) => [
          camera.name,
          `${camera.width}×${camera.height}`,
          camera.frame_count,
          camera.turned ? `${camera.turned}°` : "–",
        ])}
      />
    </div>
  </section>`;

/** @param {{ model: Model }} properties */
export const Panel = ({ model }) => html`
  <${Cameras} footage=${model.footage.value} />
  ${model.warnings.value.map((words) => html`<p class="notice">${words}</p>`)}
  <${Synchronisation} model=${model.sync} footage=${model.footage.value} />
  <${AddingForm} model=${model.adding} isFirst=${!model.footage.value.cameras.length} />
`;

/** A camera's picture of a frame. @param {{ model: Model, frame: number, camera: any }} properties */
function CameraPicture({ model, frame, camera }) {
  const { name } = camera;
  const [isBroken, setBroken] = useState(false);
  const address = `${model.here}/footage/${encodeURIComponent(name)}/${frame}.jpg`;
  return html`<figure class="picture" data-camera=${name}>
    <img
      src=${`${address}?height=${THUMB_HEIGHT}&age=${model.age.value}`}
      alt=${isBroken ? `The footage of ${name} cannot be read.` : `Camera ${name}`}
      ...${opensLarge(`${name}, frame ${frame}`)}
      onLoad=${() => setBroken(false)}
      onError=${() => setBroken(true)}
    />
    <figcaption>
      <div class="step-actions">
        <b>${name}</b><span class="spring"></span>
        <${Action}
          kind="small"
          act=${() => model.turn(camera)}
          aria-label=${`Turn ${name} by 90 degrees clockwise`}
        >
          ↻ Turn
        </${Action}>
      </div>
      ${dotted(
        `${camera.width}×${camera.height}`,
        `${camera.frame_count} frames`,
        camera.kind,
        camera.has_masks && "masks",
        camera.has_background && "background",
      )}
    </figcaption>
  </figure>`;
}

/** The pictures of a frame, which follow its slider. @param {{ model: Model }} properties */
export function Beside({ model }) {
  const { cameras, frame_count: count } = model.footage.value;
  const last = Math.max(0, count - 1);
  const [chosen, setChosen] = useState(0);
  const [pictured, setPictured] = useState(0);
  useEffect(() => {
    const wait = setTimeout(() => setPictured(chosen), FRAME_MILLISECONDS);
    return () => clearTimeout(wait);
  }, [chosen]);
  if (!cameras.length)
    return html`<div class="aside-empty">
      <p>The pictures of your cameras will be here.</p>
      <p class="hint">
        Two cameras at least, better four: around the subject, each seeing all of it all the time.
      </p>
    </div>`;
  const frame = Math.min(chosen, last);
  return html`
    <div class="pictures-bar">
      <input
        type="range"
        min="0"
        max=${last}
        value=${frame}
        aria-label="Frame"
        onInput=${({ target }) => setChosen(Number(target.value))}
      />
      <output>frame ${frame}</output>
      <span class="hint">The same moment in every camera?</span>
    </div>
    <div class="pictures">
      ${cameras.map(
        (camera) =>
          html`<${CameraPicture}
            key=${camera.name}
            model=${model}
            frame=${Math.min(pictured, last)}
            camera=${camera}
          />`,
      )}
    </div>
  `;
}
