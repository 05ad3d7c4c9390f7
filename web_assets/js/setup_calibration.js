// Calibration: the one in use or one that is proposed, three ways to get one, what speaks for and
// against it.

import { accepted, fetchJson, post, remove, sessionPath } from "./api.js";
import { Findings, plainNumbers, Residuals, RigFromAbove } from "./calibration_drawing.js";
import { FloorClicks } from "./calibration_points.js";
import { dotted, download } from "./elements.js";
import { findJob, isGoing, timeLeft } from "./jobs.js";
import { complain } from "./messages.js";
import { BoardForm, boardOf } from "./setup_boards.js";
import { batch, html, into, signal, useEffect, useRef, useState } from "./studio/component.js";
import { opensLarge } from "./studio/dialogs.js";
import { Action, Check, Failure, Progress, Select } from "./studio/parts.js";
import { uploadFiles } from "./uploading.js";

/** @import { Schemas } from "./api_types" */

const TABS = { file: "From a file", boards: "From a board", used: "In use" };
/** @type {[string, string][]} */
const UNITS = [
  ["", "as the file says"],
  ["mm", "millimetres"],
  ["cm", "centimetres"],
  ["m", "metres"],
  ["in", "inches"],
  ["board", "squares of a board"],
];
/** @type {[string, string][]} */
const AXES = [
  ["z", "Z"],
  ["y", "Y"],
  ["x", "X"],
  ["-z", "−Z"],
  ["-y", "−Y"],
  ["-x", "−X"],
];
const savedAt = (/** @type {string} */ name) =>
  `replaced ${name.slice(0, 4)}-${name.slice(4, 6)}-${name.slice(6, 8)} ${name.slice(9, 11)}:${name.slice(11, 13)} UTC`;

/** @typedef {Omit<Schemas["CalibrationView"], "session">} View */
/** What is shown where the calibration cannot be read: another one is read from a file. */
const NONE = /** @type {View} */ ({
  present: null,
  board_footage: false,
  earlier: [],
  formats: {},
  footage: [],
  notes: [],
  stale_runs: [],
  changed: "",
});

/** @param {string} session */
export async function load(session) {
  try {
    return { view: await fetchJson(`${sessionPath(session)}/calibration`), failed: null };
  } catch (failed) {
    return { view: NONE, failed };
  }
}

/**
 * What the step knows, and what can be done.
 * @param {import("./setup.js").Setup} setup
 * @param {Awaited<ReturnType<typeof load>>} loaded
 */
export function modelOf(setup, loaded) {
  const here = /** @type {const} */ (`${sessionPath(setup.session)}/calibration`);
  const view = signal(/** @type {View} */ (loaded.view));
  const proposal = signal(/** @type {Schemas["ProposalView"] | null} */ (null));
  const tab = signal(loaded.view.present ? "used" : loaded.view.board_footage ? "boards" : "file");
  const failed = signal(/** @type {any} */ (loaded.failed));
  const progress = signal(/** @type {Parameters<typeof Progress>[0] | null} */ (null));
  /** Whether the pictures are of the board, else of the recording. */
  const showsBoard = signal(true);
  /** Whether points of the floor are clicked. */
  const isClicking = signal(false);
  /**
   * What is read from a file: files that are chosen, or what was uploaded of them, or a path.
   * @type {import("@preact/signals").Signal<{ files: FileList | null, upload: string | null,
   *   path: string, unit: Schemas["CalibrationFileRequest"]["unit"],
   *   up: Schemas["CalibrationFileRequest"]["up"] }>}
   */
  const file = signal({ files: null, upload: null, path: "", unit: "", up: "z" });
  const board = boardOf(setup.session);
  /** The identifier of the calibration that is being computed. */
  let job = "";
  let isLeft = false;

  const clear = () =>
    batch(() => {
      failed.value = proposal.value = null;
    });

  /** Propose what is answered. @param {() => Promise<Schemas["ProposalView"]>} work */
  async function propose(work) {
    clear();
    try {
      proposal.value = await work();
      showsBoard.value = true;
    } catch (error) {
      failed.value = error;
    }
  }

  /** @param {FileList} files */
  const upload = (files) =>
    uploadFiles(files, (words, share) => into(progress)({ words, share })).finally(() =>
      into(progress)(null),
    );

  /** The calibration that is being computed got further. @param {any} state */
  async function hear(state) {
    if (isLeft || state.identifier !== job) return;
    if (isGoing(state)) {
      const left = timeLeft(state.seconds_left);
      progress.value = {
        words: dotted(
          state.step || "Beginning",
          state.total > 1 && `${state.done} of ${state.total}`,
          left && `about ${left}`,
        ),
        share: state.share,
        cancel: () => remove(`/api/calibrations/${state.identifier}`).catch(complain),
      };
      return;
    }
    job = "";
    progress.value = null;
    if (state.state === "done")
      await propose(() => fetchJson(`${here}/proposals/${state.proposal}`));
    else failed.value = state.state === "failed" ? state : null;
  }

  /** Begin to compute one. @param {() => Promise<any>} work */
  async function begin(work) {
    clear();
    try {
      const begun = await work();
      job = begun.identifier;
      await hear(begun);
    } catch (error) {
      failed.value = error;
    }
  }

  const read = () =>
    propose(async () => {
      const { files, path, unit, up } = file.value;
      if (files?.length) file.value = { ...file.value, files: null, upload: await upload(files) };
      const from = file.value.upload ? { upload: file.value.upload } : { path };
      return post(`${here}/proposals`, { ...from, unit, up });
    });

  setup.on("calibration", hear);
  // A calibration that was begun before this step was shown goes on to be followed.
  findJob({ session: setup.session, kind: "calibration" })
    .then((known) => {
      if (isLeft || job || !(isGoing(known) || known?.state === "failed")) return undefined;
      job = known.identifier;
      return hear(known);
    })
    .catch(complain);

  return {
    setup,
    here,
    view,
    proposal,
    tab,
    failed,
    progress,
    showsBoard,
    isClicking,
    file,
    board,
    propose,
    read,
    shown: () => proposal.value ?? view.value.present,
    /** Where the pictures of what is shown are. */
    pictures: () => `${here}/proposals/${proposal.value?.identifier ?? "current"}`,
    /** @param {keyof typeof TABS} name */
    choose: (name) =>
      batch(() => {
        tab.value = name;
        failed.value = null;
      }),
    /** @param {Record<string, any>} changes */
    enter: (changes) => {
      file.value = { ...file.value, ...changes };
    },
    solve: () => begin(async () => post(`${here}/solve`, await board.request(upload))),
    /**
     * Turn the world of the calibration in use to the vertical, with the floor under the person by
     * the silhouettes.
     */
    level: () => begin(() => post(`${here}/level`, {})),
    /** Keep it as a file of another program. @param {string} format */
    save: async (format) => {
      const answer = await accepted(await fetch(`${here}/export?format=${format}`));
      const name = answer.headers.get("content-disposition").match(/filename="([^"]+)"/)[1];
      download(name, await answer.blob());
      const notes = decodeURIComponent(answer.headers.get("x-studio-notes") ?? "");
      failed.value = notes ? { message: notes } : null;
    },
    /** @param {any[]} points of the floor */
    setFloor: async (points) => {
      const request = { proposal: proposal.value?.identifier ?? "", points };
      proposal.value = await post(`${here}/floor`, request);
      isClicking.value = false;
    },
    /** Use what is proposed. @param {boolean} anyway */
    apply: async (anyway) => {
      const identifier = String(proposal.value?.identifier);
      try {
        view.value = await post(`${here}/proposals/${identifier}/apply`, { anyway });
        clear();
        tab.value = "used";
        await setup.refresh();
      } catch (error) {
        failed.value = error;
      }
    },
    stop: () => {
      isLeft = true;
    },
  };
}

/** @typedef {ReturnType<typeof modelOf>} Model */

/** @param {{ model: Model }} properties */
function FileForm({ model }) {
  const { path, unit, up } = model.file.value;
  const [kind, square] = (unit ?? "").split("=");
  // A unit or an axis that is corrected is seen at once.
  const correct = (/** @type {Record<string, string>} */ changes) => {
    model.enter(changes);
    const { files, upload } = model.file.value;
    if (model.proposal.value && (files?.length || upload || path)) model.read();
  };
  return html`
    <p class="hint">
      Pose2Sim, anipose, FreeMoCap, Caliscope, EasyMocap, OpenCV, Qualisys or Bouguet files. Nothing
      changes before you use it.
    </p>
    <label>
      Upload
      <input
        type="file"
        multiple
        onChange=${({ target }) => model.enter({ files: target.files, upload: null, path: "" })}
      />
    </label>
    <label>
      or on this computer
      <input
        type="text"
        placeholder="full path of a file or folder"
        value=${path}
        onInput=${({ target }) => model.enter({ path: target.value, files: null, upload: null })}
      />
    </label>
    <div class="step-row">
      <${Select}
        label="Unit"
        title="Lengths in the file"
        options=${UNITS}
        value=${kind}
        take=${(unit) => (unit === "board" ? model.enter({ unit: "board=" }) : correct({ unit }))}
      />
      ${
        kind === "board" &&
        html`<label>
          A square (mm)
          <input
            type="number"
            min="0.1"
            step="any"
            value=${square}
            onChange=${({ target }) => target.value && correct({ unit: `board=${target.value}` })}
          />
        </label>`
      }
      <${Select}
        label="Points up"
        title="The axis of the file's world that points up"
        options=${AXES}
        value=${up}
        take=${(up) => correct({ up })}
      />
    </div>
    <div class="step-actions">
      <${Action} kind=${model.proposal.value ? "" : "primary"} act=${model.read}>
        Read the file
      </${Action}>
    </div>
  `;
}

/** @param {{ model: Model }} properties */
const Boards = ({ model }) => html`<${BoardForm}
  model=${model.board}
  cameras=${model.view.value.footage}
  hasFootage=${model.view.value.board_footage}
  isChief=${!model.proposal.value}
  solve=${model.solve}
/>`;

/** A choice, and what is done with what is chosen. */
function ChoiceRow(
  /** @type {{ label: string, options: [string, string][], words: string,
   *   act: (chosen: string) => any }} */ { label, options, words, act },
) {
  const [chosen, setChosen] = useState(options[0]?.[0] ?? "");
  return html`<div class="step-row">
    <${Select} label=${label} options=${options} value=${chosen} take=${setChosen} />
    <div class="step-actions at-end"><${Action} act=${() => act(chosen)}>${words}</${Action}></div>
  </div>`;
}

/** @param {{ model: Model }} properties */
function Used({ model }) {
  const { present, earlier, formats, notes, changed, stale_runs: stale } = model.view.value;
  if (!present) return html`<p class="hint">No calibration yet.</p>`;
  return html`
    <p>
      <b>${present.source || "imported with the footage"}</b>
      ${
        changed &&
        html`<span class="quiet-text"> · since ${new Date(changed).toLocaleString()}</span>`
      }
    </p>
    ${notes.map((note) => html`<p class="notice">${note}</p>`)}
    ${
      !notes.length &&
      stale.length > 0 &&
      html`<p class="notice">Tracked with another calibration: ${stale.join(", ")}.</p>`
    }
    <${ChoiceRow}
      label="Export for other tools"
      options=${Object.entries(formats)}
      words="Download"
      act=${(format) => model.save(format).catch(complain)}
    />
    ${
      earlier.length > 0 &&
      html`<${ChoiceRow}
        key=${earlier[0]}
        label="Earlier ones"
        options=${earlier.map((name) => [name, savedAt(name)])}
        words="Preview"
        act=${(chosen) => model.propose(() => post(`${model.here}/proposals`, { earlier: chosen }))}
      />`
    }
  `;
}

/** @param {any[]} points */
function pointWords(points) {
  const off = Math.max(...points.flatMap((point) => Object.values(point.missed_px)));
  const high = Math.max(...points.map((point) => Math.abs(point.place[2])));
  const flat = `they lie within ${plainNumbers(high, 0)} mm of one plane`;
  return `${points.length} points: the clicks miss them by up to ${plainNumbers(off)} px, and ${flat}.`;
}

/** What is proposed, and what is done with it. */
function Proposal(/** @type {{ model: Model, made: Schemas["ProposalView"] }} */ { model, made }) {
  const [isForced, setForced] = useState(false);
  const buttons = useRef(/** @type {HTMLElement | null} */ (null));
  // The form above it may be longer than the window.
  useEffect(() => buttons.current?.scrollIntoView({ block: "nearest" }), []);
  const isBlocked = made.findings.some((one) => one.severity === "blocks");
  const notes = [made.unit_note, ...made.notes, made.points.length && pointWords(made.points)];
  return html`<section class="proposal">
    <h2>${made.source}</h2>
    ${notes.filter(Boolean).map((note) => html`<p class="hint">${note}</p>`)}
    ${
      isBlocked &&
      made.cameras.length > 0 &&
      html`<${Check} checked=${isForced} take=${setForced}>
        Use it although results will be wrong
      </${Check}>`
    }
    <div class="step-actions" ref=${buttons}>
      <${Action}
        kind="primary"
        act=${() => model.apply(isBlocked)}
        disabled=${isBlocked && !isForced}
      >
        Use this calibration
      </${Action}>
      <${Action}
        kind="quiet"
        act=${() => into(model.proposal)(null)}
      >
        Discard
      </${Action}>
    </div>
  </section>`;
}

/** @param {{ model: Model }} properties */
export function Panel({ model }) {
  const tab = model.tab.value;
  const proposal = model.proposal.value;
  const rig = model.shown();
  const Form = { file: FileForm, boards: Boards, used: Used }[tab];
  return html`
    <div class="group" role="tablist">
      ${Object.entries(TABS).map(
        ([name, words]) =>
          html`<button
            key=${name}
            type="button"
            class="toggle"
            role="tab"
            aria-selected=${String(tab === name)}
            onClick=${() => model.choose(/** @type {any} */ (name))}
          >
            ${words}
          </button>`,
      )}
    </div>
    <${Form} model=${model} />
    ${model.progress.value && html`<${Progress} ...${model.progress.value} />`}
    <${Failure} error=${model.failed.value} />
    ${proposal && html`<${Proposal} key=${proposal.identifier} model=${model} made=${proposal} />`}
    ${
      rig &&
      (proposal || rig.findings.length > 0 || !model.setup.step?.why) &&
      html`<${Findings} findings=${rig.findings} />`
    }
  `;
}

/** The floor and the axes on a camera's picture. */
function AxesPicture({ address, camera }) {
  const [isMissing, setMissing] = useState(false);
  return html`<figure class="picture axes-picture">
    <img
      alt=${`Floor and axes on the picture of ${camera.name}`}
      ...${opensLarge(camera.name)}
      src=${address}
      hidden=${isMissing}
      onLoad=${() => setMissing(false)}
      onError=${() => setMissing(true)}
    />
    <figcaption>
      <b>${camera.name}</b>
      ${dotted(
        `${camera.width}×${camera.height}, focal length ${plainNumbers(camera.focal_px[0], 0)} px`,
        camera.rms_px !== null && `${plainNumbers(camera.rms_px, 2)} px`,
      )}
    </figcaption>
  </figure>`;
}

/** Where the board was seen by a camera. */
const Coverage = ({ at, lens }) => html`<figure class="picture coverage">
  <img
    alt=${`Where the board was seen by ${lens.name}`}
    ...${opensLarge(`Where the board was seen by ${lens.name}`)}
    src=${`${at}/coverage/${encodeURIComponent(lens.name)}.png`}
  />
  <figcaption>
    <b>${lens.name}: ${Math.round(100 * lens.coverage)} % covered</b>
    <${Residuals} lens=${lens} />
    <span>${lens.verdict}</span>
  </figcaption>
</figure>`;

/** The cameras as they stand and what they see. @param {{ model: Model }} properties */
export function Beside({ model }) {
  const rig = model.shown();
  const at = model.pictures();
  const showsBoard = model.showsBoard.value;
  const { cameras } = model.setup.detail;
  const view = (/** @type {string} */ camera, /** @type {string} */ query) =>
    `${at}/views/${encodeURIComponent(camera)}.jpg?board=${showsBoard}&${query}`;
  if (model.isClicking.value)
    return html`<${FloorClicks}
      cameras=${rig?.cameras ?? []}
      picture=${(camera) => view(camera, "height=720&axes=false")}
      send=${model.setFloor}
      stop=${() => into(model.isClicking)(false)}
    />`;
  if (!rig)
    return html`<div class="aside-empty">
      <p>The cameras are drawn here once there is a calibration.</p>
    </div>`;
  const isProposed = Boolean(model.proposal.value);
  /** @type {any[]} */
  const lenses = /** @type {any} */ (rig.report)?.cameras ?? [];
  const covered = lenses.filter((lens) => lens.pictures.length);
  const now = Date.now();
  return html`<div class="calibrated">
    <div class="aside-actions">
      ${
        rig.cameras.length > 1 &&
        html`<${Action} kind="small" act=${() => into(model.isClicking)(true)}>
          Set the floor by clicks
        </${Action}>`
      }
      ${
        !isProposed &&
        rig.cameras.length > 1 &&
        cameras.length > 0 &&
        html`<${Action}
          kind="small"
          act=${model.level}
          title="Turn the world to the cameras' vertical and put z = 0 under the person's feet, by the silhouettes"
        >
          Level it
        </${Action}>`
      }
      ${
        isProposed &&
        lenses.length > 0 &&
        cameras.length > 0 &&
        html`<${Action} kind="small quiet" act=${() => into(model.showsBoard)(!showsBoard)}>
          ${showsBoard ? "Show the recording" : "Show the board"}
        </${Action}>`
      }
    </div>
    ${rig.cameras.length > 0 && html`<${RigFromAbove} rig=${rig} isPerson=${model.setup.detail.body.by_height} />`}
    <div class="pictures">
      ${rig.cameras.map(
        (camera) =>
          html`<${AxesPicture}
            key=${camera.name}
            address=${view(camera.name, `height=480&at=${now}`)}
            camera=${camera}
          />`,
      )}
    </div>
    ${covered.length > 0 && html`<h2>Coverage of the board</h2>`}
    <div class="pictures">
      ${covered.map((lens) => html`<${Coverage} key=${lens.name} at=${at} lens=${lens} />`)}
    </div>
  </div>`;
}
