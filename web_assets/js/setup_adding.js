// Footage taken into the session: uploaded from this browser, or from a folder of the studio's
// computer.

import { fault, fetchJson, post, remove, sessionPath } from "./api.js";
import {
  actions,
  button,
  check,
  drawProgress,
  element,
  failure,
  field,
  files,
  fill,
  hint,
  number,
  optional,
  select,
  text,
} from "./elements.js";
import { CANCELLED, jobDone, shareOf, standing } from "./jobs.js";
import { complain } from "./messages.js";
import { uploadFiles } from "./uploading.js";

/** @import { Schemas } from "./api_types" */

const MOST_FOLDERS = 60;

/**
 * Draw the form in `place` (a details element); `done(job)` is called when footage was taken in.
 * @param {import("./setup.js").Setup} setup
 */
export function adder(place, setup, done) {
  let abort = null;
  let stopped = false;
  const going = optional();
  const wrong = optional();
  const videos = files({
    multiple: true,
    name: "files",
    accept: "video/*,image/*,.zip,.tar,.gz,.tgz,.bz2,.xz,.toml,.csv,.yml,.json",
  });
  const folder = files({ multiple: true, name: "folder", folder: true });
  const source = text({ name: "source", placeholder: "full path" });
  const refer = check("refer to it where it lies instead of copying it", { name: "refer" });
  const fps = number("", { name: "fps", min: 1, placeholder: "as the files say" });
  const trial = text({ name: "trial", placeholder: "the only one" });
  const fields = select(
    [
      ["", "no"],
      ["auto", "into fields"],
      ["top", "top field first"],
      ["bottom", "bottom field first"],
    ],
    "",
    { name: "fields" },
  );
  const byTime = check(
    "pair frames by their times",
    { name: "by_time" },
    "Not by their numbers: for cameras of other rates, drift and lost frames.",
  );
  const inverted = check("black is the person in the masks", { name: "inverted" });
  const replace = check(
    "replace all cameras",
    { name: "replace" },
    "Cameras that are not in the new footage are removed.",
  );
  const submit = button("Add footage", begin);
  const summary = element("summary", {}, "Add or replace footage");
  const elsewhere = hint(
    "Connected cameras (USB, RTSP, MJPEG) can be viewed and recorded under ",
    element("a", { href: "/recording" }, "Live cameras"),
    ".",
  );
  const folders = element("div", { className: "folder-list" });
  fill(
    place,
    summary,
    element(
      "div",
      { className: "footage-form" },
      field("Videos, one per camera (or a zip or tar of all)", videos),
      field(
        "or a folder: videos/, pictures, masks/, background/, calibration/; Pose2Sim, FreeMoCap, Caliscope, anipose, EasyMocap, OpenCap and DANNCE layouts too",
        folder,
      ),
      field("or a folder of the computer that the studio runs on", source),
      folders,
      refer,
      element(
        "div",
        { className: "step-row" },
        field("Frames per second", fps),
        field("Trial", trial, { title: "For a folder with several trials." }),
        field("Split interlaced videos", fields, {
          title: "A frame of each field, twice as many.",
        }),
      ),
      byTime,
      inverted,
      replace,
      actions(submit),
      going,
      wrong,
      elsewhere,
    ),
  );
  source.onfocus = () => browse(source.value).catch(() => fill(folders));

  /** Folders below the one that is typed, to be chosen by a click. */
  async function browse(path) {
    const found = await fetchJson(`/api/folders?path=${encodeURIComponent(path)}`);
    const open = (name, next) =>
      button(
        name,
        () => {
          source.value = next;
          browse(next).catch(complain);
        },
        "quiet small",
      );
    fill(
      folders,
      found.path && found.parent !== null && open("‹ up", found.parent),
      found.folders
        .slice(0, MOST_FOLDERS)
        .map((name) => open(name, found.path ? `${found.path}/${name}` : name)),
    );
  }

  /** @type {File[]} */
  let dropped = []; // from the computer's own windows

  async function chosenSource() {
    const picked = videos.files?.length ? videos.files : folder.files;
    const chosen = dropped.length ? dropped : (picked ?? []);
    if (chosen.length)
      return {
        upload: await uploadFiles(
          chosen,
          (words, share) => drawProgress(going, { words, share, cancel: () => abort.abort() }),
          abort.signal,
        ),
      };
    if (source.value.trim()) return { source: source.value.trim() };
    throw fault("Nothing is chosen.", "Choose the cameras' videos, or a folder.");
  }

  async function begin() {
    fill(wrong);
    abort = new AbortController();
    const checked = (box) => box.querySelector("input").checked;
    try {
      /** @type {Omit<Schemas["FootageAddition"], "source" | "upload">} */
      const request = {
        copy: !checked(refer),
        replace: checked(replace),
        fps: fps.value ? Number(fps.value) : null,
        fields: /** @type {Schemas["FootageAddition"]["fields"]} */ (fields.value),
        by_time: checked(byTime),
        masks: checked(inverted) ? "inverted" : "",
        trial: trial.value.trim() || null,
      };
      const { identifier } = await post(`${sessionPath(setup.session)}/footage`, {
        ...request,
        ...(await chosenSource()),
      });
      const cancel = () => remove(`/api/imports/${identifier}`).catch(complain);
      const job = await jobDone(
        `/api/imports/${identifier}`,
        (state) =>
          drawProgress(going, {
            words: standing(state, "beginning"),
            share: shareOf(state),
            cancel,
          }),
        () => stopped,
      );
      if (job) {
        videos.value = folder.value = "";
        place.open = false;
        await done(job);
      }
    } catch (error) {
      if (error.name !== "AbortError" && error.code !== CANCELLED) fill(wrong, failure(error));
    }
    dropped = [];
    drawProgress(going, null);
  }

  return {
    /** Take files that were dropped on the page. @param {File[]} files */
    take(files) {
      dropped = files;
      place.open = true;
      return begin();
    },
    /** there: whether the session has footage; then the form is folded away. */
    draw(there) {
      summary.textContent = there ? "Add or replace footage" : "Your cameras' footage";
      place.open = !there || place.contains(document.activeElement);
      place.classList.toggle("alone", !there);
      submit.className = there ? "" : "primary";
      elsewhere.hidden = there;
      replace.hidden = !there;
    },
    stop() {
      stopped = true;
      abort?.abort();
    },
  };
}
