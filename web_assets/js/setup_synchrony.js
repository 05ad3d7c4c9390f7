// The cameras in step: offsets by hand, by a recorder's times, or estimated; an estimate is shown
// and applied only by a click.

import { accepted, post, remove, sessionPath } from "./api.js";
import { findJob, followJob, isGoing, progressOf } from "./jobs.js";
import { complain } from "./messages.js";
import { attempting, html, into, signal, useRef } from "./studio/component.js";
import { Action, Failure, Progress, Table } from "./studio/parts.js";

/**
 * What is known of the cameras' offsets, and what can be done; `use(offsets)` applies them.
 * @param {import("./setup.js").Setup} setup
 * @param {(offsets: Record<string, number>) => Promise<void>} use
 */
export function synchronyOf(setup, use) {
  const here = sessionPath(setup.session);
  /** Its job, or what a recorder's times say. */
  const estimate = signal(/** @type {any} */ (null));
  const failed = signal(/** @type {any} */ (null));
  const attempt = attempting(failed);
  /** Offsets that were typed and not yet applied. */
  const entered = signal(/** @type {Record<string, string>} */ ({}));
  let isLeft = false;

  const follow = () =>
    attempt(async () => {
      try {
        const ended = await followJob(`${here}/synchrony`, into(estimate), () => isLeft);
        if (!isLeft) estimate.value = ended;
      } catch (error) {
        estimate.value = null;
        throw error;
      }
    });

  // An estimate that was begun before this step was shown: how far it is, or what it found.
  findJob({ session: setup.session, kind: "synchrony" })
    .then((job) => {
      if (job && !isLeft && !estimate.value && job.state !== "cancelled") follow();
    })
    .catch(complain);

  return {
    estimate,
    failed,
    entered,
    begin: () =>
      attempt(async () => {
        await post(`${here}/synchrony`);
        await follow();
      }),
    /** Take the offsets that a recorder's file of times gives. @param {File | undefined} file */
    read: (file) =>
      file &&
      attempt(async () => {
        const times = await (
          await accepted(await fetch(`${here}/footage/times`, { method: "POST", body: file }))
        ).json();
        estimate.value = {
          state: "done",
          sure: true,
          from: file.name,
          offsets: times.offsets,
          notes: [...times.notes, `${times.apart.toFixed(2)} frames apart at most.`],
        };
      }),
    /** @param {Record<string, number>} offsets */
    use: async (offsets) => {
      await use(offsets);
      entered.value = {};
    },
    cancel: () => remove(`${here}/synchrony`).catch(complain),
    stop: () => {
      isLeft = true;
    },
  };
}

/** What was found of a camera, in words. */
function foundWords(estimate, name) {
  const [found, spread, sure] = [
    estimate?.offsets?.[name],
    estimate?.spread?.[name],
    estimate?.confidence?.[name],
  ];
  if (found === undefined) return "";
  const words = [found, spread && `± ${spread}`, sure && `peak ${sure.toFixed(1)}×`];
  return words.filter((part) => part || part === 0).join(" ");
}

/** What an estimate came to, and what uses it. */
function Found({ model, cameras }) {
  const estimate = model.estimate.value;
  if (estimate?.state !== "done") return null;
  const { offsets, from, sure, notes = [] } = estimate;
  const isUsed = cameras.every((camera) => (offsets[camera.name] ?? 0) === camera.offset);
  const verdict = from
    ? `From ${from}.`
    : sure
      ? "The estimate is reliable: all pairs of cameras agree."
      : "The estimate is not reliable: check the pictures before you use it.";
  return html`
    <p class=${sure ? "hint" : "notice"}>${verdict}${isUsed && " These offsets are in use."}</p>
    ${notes.map((note) => html`<p class="hint">${note}</p>`)}
    ${
      !isUsed &&
      html`<div class="step-actions">
        <${Action} kind="use-estimate" act=${() => model.use(offsets)}>Use these offsets</${Action}>
      </div>`
    }
  `;
}

/**
 * The section, nothing for a single camera.
 * @param {{ model: ReturnType<typeof synchronyOf>, footage: any }} properties
 */
export function Synchronisation({ model, footage: { cameras, stale_runs: stale } }) {
  const times = useRef(/** @type {HTMLInputElement | null} */ (null));
  if (cameras.length < 2) return null;
  const estimate = model.estimate.value;
  const entered = model.entered.value;
  const offsetOf = ({ name, offset }) => Number(entered[name] ?? offset);
  const rows = cameras.map((camera) => [
    camera.name,
    html`<input
      type="number"
      step="1"
      aria-label=${`Offset of ${camera.name}, frames`}
      value=${entered[camera.name] ?? camera.offset}
      onInput=${({ target }) => {
        model.entered.value = { ...entered, [camera.name]: target.value };
      }}
    />`,
    foundWords(estimate, camera.name),
  ]);
  const apply = () =>
    model.use(Object.fromEntries(cameras.map((camera) => [camera.name, offsetOf(camera)])));
  return html`<section class="footage-step">
    <h2>Synchronisation</h2>
    <p class="hint">The frame of each camera's file that was recorded with frame 0 of the others.</p>
    <${Table} heads=${["camera", "offset", "found"]} rows=${rows} kind="figures offsets" />
    <div class="step-actions">
      ${
        cameras.some((camera) => offsetOf(camera) !== camera.offset) &&
        html`<${Action} kind="apply-offsets" act=${apply}>Apply</${Action}>`
      }
      <${Action} kind="small" act=${model.begin} disabled=${isGoing(estimate)}>
        Estimate from motion
      </${Action}>
      <${Action} kind="quiet small" act=${() => times.current?.click()}>
        From timestamps.csv…
      </${Action}>
      <input
        ref=${times}
        type="file"
        accept=".csv"
        hidden
        onChange=${({ target }) => model.read(target.files[0])}
      />
    </div>
    ${isGoing(estimate) && html`<${Progress} ...${progressOf(estimate, "beginning", model.cancel)} />`}
    <${Failure} error=${model.failed.value} />
    <${Found} model=${model} cameras=${cameras} />
    ${
      stale.length > 0 &&
      html`<p class="notice">Tracked with earlier offsets or rotations: ${stale.join(", ")}.</p>`
    }
  </section>`;
}
