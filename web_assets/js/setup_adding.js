// Footage taken into the session: uploaded from this browser, or from a folder of the studio's
// computer.

import { fault, fetchJson, post, remove, sessionPath } from "./api.js";
import { CANCELLED, jobDone, shareOf, standing } from "./jobs.js";
import { complain } from "./messages.js";
import { html, into, signal } from "./studio/component.js";
import { Action, Failure, Progress, Select } from "./studio/parts.js";
import { uploadFiles } from "./uploading.js";

/** @import { Schemas } from "./api_types" */

const MOST_FOLDERS = 60;
/** @type {[string, string][]} */
const FIELDS = [
  ["", "no"],
  ["auto", "into fields"],
  ["top", "top field first"],
  ["bottom", "bottom field first"],
];

/**
 * What is being taken in, and what can be; `done(job)` is called when footage was.
 * @param {import("./setup.js").Setup} setup
 * @param {boolean} isOpened whether the form is shown at first
 * @param {(job: any) => Promise<void>} done
 */
export function addingOf(setup, isOpened, done) {
  const isOpen = signal(isOpened);
  /** A folder of the studio's computer. */
  const source = signal("");
  /** The folders below it. */
  const folders = signal(/** @type {any} */ (null));
  const progress = signal(/** @type {Parameters<typeof Progress>[0] | null} */ (null));
  const failed = signal(/** @type {any} */ (null));
  /** Rises when the chosen files were taken: none is chosen then. */
  const taken = signal(0);
  /** What the other fields hold, by their names. @type {Record<string, any>} */
  const values = {};
  let abort = new AbortController();
  let isLeft = false;

  /** @param {ArrayLike<File>} files */
  async function sourceOf(files) {
    if (files.length) {
      const cancel = () => abort.abort();
      const report = (/** @type {string} */ words, /** @type {number} */ share) =>
        into(progress)({ words, share, cancel });
      return { upload: await uploadFiles(files, report, abort.signal) };
    }
    if (source.value.trim()) return { source: source.value.trim() };
    throw fault("Nothing is chosen.", "Choose the cameras' videos, or a folder.");
  }

  /** Take footage in, and follow that to its end. @param {ArrayLike<File>} files */
  async function begin(files) {
    failed.value = null;
    abort = new AbortController();
    try {
      /** @type {Omit<Schemas["FootageAddition"], "source" | "upload">} */
      const request = {
        copy: !values.refer,
        replace: Boolean(values.replace),
        fps: values.fps ? Number(values.fps) : null,
        fields: values.fields ?? "",
        by_time: Boolean(values.by_time),
        masks: values.inverted ? "inverted" : "",
        trial: values.trial?.trim() || null,
      };
      const { identifier } = await post(`${sessionPath(setup.session)}/footage`, {
        ...request,
        ...(await sourceOf(files)),
      });
      const cancel = () => remove(`/api/imports/${identifier}`).catch(complain);
      const job = await jobDone(
        `/api/imports/${identifier}`,
        (state) => {
          progress.value = { words: standing(state, "beginning"), share: shareOf(state), cancel };
        },
        () => isLeft,
      );
      if (job) {
        values.files = values.folder = null;
        taken.value += 1;
        isOpen.value = false;
        await done(job);
      }
    } catch (error) {
      if (error.name !== "AbortError" && error.code !== CANCELLED) failed.value = error;
    }
    progress.value = null;
  }

  /** @param {string} path */
  async function browse(path) {
    folders.value = await fetchJson(`/api/folders?path=${encodeURIComponent(path)}`);
  }

  return {
    isOpen,
    source,
    folders,
    progress,
    failed,
    taken,
    /** A field was changed. */
    hear: ({ target: { name, type, checked, files, value } }) => {
      values[name] = type === "checkbox" ? checked : type === "file" ? files : value;
    },
    begin: () => begin(values.files?.length ? values.files : (values.folder ?? [])),
    /** Take files that were dropped on the page. @param {File[]} files */
    take: (files) => {
      isOpen.value = true;
      return begin(files);
    },
    look: () =>
      browse(source.value).catch(() => {
        folders.value = null;
      }),
    /** @param {string} path */
    choose: (path) => {
      source.value = path;
      return browse(path).catch(complain);
    },
    stop: () => {
      isLeft = true;
      abort.abort();
    },
  };
}

/** @typedef {ReturnType<typeof addingOf>} Model */

/** Folders below the one that is typed, to be chosen by a click. @param {{ model: Model }} properties */
function Folders({ model }) {
  const listed = model.folders.value;
  if (!listed) return null;
  const open = (/** @type {string} */ name, /** @type {string} */ path) =>
    html`<${Action} key=${path} kind="quiet small" act=${() => model.choose(path)}>${name}</${Action}>`;
  return html`<div class="folder-list">
    ${listed.path && listed.parent !== null && open("‹ up", listed.parent)}
    ${listed.folders
      .slice(0, MOST_FOLDERS)
      .map((name) => open(name, listed.path ? `${listed.path}/${name}` : name))}
  </div>`;
}

/** @param {{ model: Model }} properties */
const Source = ({ model }) => html`
  <label key=${`files-${model.taken.value}`}>
    Videos, one per camera (or a zip or tar of all)
    <input
      type="file"
      name="files"
      multiple
      accept="video/*,image/*,.zip,.tar,.gz,.tgz,.bz2,.xz,.toml,.csv,.yml,.json"
    />
  </label>
  <label key=${`folder-${model.taken.value}`}>
    or a folder: videos/, pictures, masks/, background/, calibration/; Pose2Sim, FreeMoCap,
    Caliscope, anipose, EasyMocap, OpenCap and DANNCE layouts too
    <input type="file" name="folder" multiple webkitdirectory />
  </label>
  <label>
    or a folder of the computer that the studio runs on
    <input
      type="text"
      name="source"
      placeholder="full path"
      value=${model.source.value}
      onInput=${({ target }) => into(model.source)(target.value)}
      onFocus=${model.look}
    />
  </label>
  <${Folders} model=${model} />
  <${Box} name="refer">refer to it where it lies instead of copying it</${Box}>
`;

const Box = ({ name, title = "", children }) => html`<label class="check" title=${title}>
  <input type="checkbox" name=${name} />${children}
</label>`;

/**
 * The form, folded away where the session has footage.
 * @param {{ model: Model, isFirst: boolean }} properties
 */
export const AddingForm = ({ model, isFirst }) => html`<details
  class=${isFirst ? "footage-add alone" : "footage-add"}
  open=${model.isOpen.value}
  onToggle=${({ currentTarget }) => into(model.isOpen)(currentTarget.open)}
>
  <summary>${isFirst ? "Your cameras' footage" : "Add or replace footage"}</summary>
  <div class="footage-form" onInput=${model.hear}>
    <${Source} model=${model} />
    <div class="step-row">
      <label>
        Frames per second
        <input type="number" name="fps" min="1" step="any" placeholder="as the files say" />
      </label>
      <label title="For a folder with several trials.">
        Trial
        <input type="text" name="trial" placeholder="the only one" />
      </label>
      <${Select}
        label="Split interlaced videos"
        title="A frame of each field, twice as many."
        name="fields"
        options=${FIELDS}
      />
    </div>
    <${Box}
      name="by_time"
      title="Not by their numbers: for cameras of other rates, drift and lost frames."
    >
      pair frames by their times
    </${Box}>
    <${Box} name="inverted">black is the subject in the masks</${Box}>
    ${
      !isFirst &&
      html`<${Box} name="replace" title="Cameras that are not in the new footage are removed.">
        replace all cameras
      </${Box}>`
    }
    <div class="step-actions">
      <${Action} kind=${isFirst ? "primary" : ""} act=${model.begin}>Add footage</${Action}>
    </div>
    ${model.progress.value && html`<${Progress} ...${model.progress.value} />`}
    <${Failure} error=${model.failed.value} />
    ${
      isFirst &&
      html`<p class="hint">
        Connected cameras (USB, RTSP, MJPEG) can be viewed and recorded under${" "}
        <a href="/recording">Live cameras</a>.
      </p>`
    }
  </div>
</details>`;
