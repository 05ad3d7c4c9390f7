// The cameras in step: offsets by hand, by a recorder's times, or estimated; an estimate is shown
// and applied only by a click.

import { accepted, post, remove, sessionPath } from "./api.js";
import {
  actions,
  button,
  drawProgress,
  element,
  failure,
  files,
  fill,
  hint,
  notice,
  number,
  optional,
  table,
} from "./elements.js";
import { findJob, followJob, isGoing, progressOf } from "./jobs.js";
import { complain } from "./messages.js";

/** Draw in `place`; `use(offsets)` applies offsets. @param {import("./setup.js").Setup} setup */
export function synchroniser(place, setup, use) {
  const here = sessionPath(setup.session);
  let footage = null;
  let estimate = null; // its job, or what a recorder's times say
  let failed = null;
  let stopped = false;
  let from = ""; // the file of times that the estimate comes from

  const entered = () =>
    Object.fromEntries(
      [...place.querySelectorAll("input[data-camera]")].map((input) => [
        input.dataset.camera,
        Number(input.value || 0),
      ]),
    );

  function rows(apply) {
    const changed = () => {
      apply.hidden = footage.cameras.every((camera) => entered()[camera.name] === camera.offset);
    };
    return footage.cameras.map(({ name, offset }) => {
      const [found, spread, sure] = [
        estimate?.offsets?.[name],
        estimate?.spread?.[name],
        estimate?.confidence?.[name],
      ];
      const words =
        found === undefined
          ? ""
          : [found, spread && `± ${spread}`, sure && `peak ${sure.toFixed(1)}×`]
              .filter((part) => part || part === 0)
              .join(" ");
      return [
        name,
        number(offset, {
          min: "",
          step: 1,
          ariaLabel: `Offset of ${name}, frames`,
          dataset: { camera: name },
          oninput: changed,
        }),
        words,
      ];
    });
  }

  function found() {
    if (estimate?.state !== "done") return null;
    const same = footage.cameras.every(
      (camera) => (estimate.offsets[camera.name] ?? 0) === camera.offset,
    );
    const verdict = from
      ? `From ${from}.`
      : estimate.sure
        ? "The estimate is reliable: all pairs of cameras agree."
        : "The estimate is not reliable: check the pictures before you use it.";
    return [
      (estimate.sure ? hint : notice)(verdict, same && " These offsets are in use."),
      (estimate.notes ?? []).map((note) => hint(note)),
      !same && actions(button("Use these offsets", () => use(estimate.offsets), "use-estimate")),
    ].flat();
  }

  function draw(state = footage) {
    footage = state;
    if (!footage) return undefined;
    if (footage.cameras.length < 2) return fill(place);
    const bar = optional();
    const apply = button("Apply", () => use(entered()), "apply-offsets", { hidden: true });
    const times = files({ accept: ".csv", hidden: true });
    times.onchange = () => readTimes(times.files?.[0]).catch(complain);
    fill(
      place,
      element("h2", {}, "Synchronisation"),
      hint("The frame of each camera's file that was recorded with frame 0 of the others."),
      table(["camera", "offset", "found"], rows(apply), "figures offsets"),
      actions(
        apply,
        button("Estimate from motion", begin, "small"),
        button("From timestamps.csv…", () => times.click(), "quiet small"),
        times,
      ),
      bar,
      failure(failed),
      found(),
      footage.stale_runs.length > 0 &&
        notice(`Tracked with earlier offsets or rotations: ${footage.stale_runs.join(", ")}.`),
    );
    if (isGoing(estimate))
      drawProgress(
        bar,
        progressOf(estimate, "beginning", () => remove(`${here}/synchrony`).catch(complain)),
      );
  }

  async function readTimes(file) {
    if (!file) return;
    const times = await (
      await accepted(await fetch(`${here}/footage/times`, { method: "POST", body: file }))
    ).json();
    from = file.name;
    failed = null;
    estimate = {
      state: "done",
      sure: true,
      offsets: times.offsets,
      notes: [...times.notes, `${times.apart.toFixed(2)} frames apart at most.`],
    };
    draw();
  }

  async function begin() {
    from = "";
    failed = null;
    try {
      await post(`${here}/synchrony`);
    } catch (error) {
      failed = error;
      return draw();
    }
    return followEstimate();
  }

  async function followEstimate() {
    try {
      estimate = await followJob(
        `${here}/synchrony`,
        (job) => {
          estimate = job;
          draw();
        },
        () => stopped,
      );
    } catch (error) {
      estimate = null;
      failed = error;
    }
    if (!stopped) draw();
  }

  // An estimate that was begun before this step was shown: how far it is, or what it found.
  findJob({ session: setup.session, kind: "synchrony" })
    .then((job) => {
      if (job && !stopped && !estimate && job.state !== "cancelled") followEstimate();
    })
    .catch(complain);

  return {
    draw,
    stop() {
      stopped = true;
    },
  };
}
