// Calibration from a printed board: the board, where its footage lies, the floor, what was
// measured, a board to print.

import { fault, fetchJson, sessionPath } from "./api.js";
import { html, signal, useState } from "./studio/component.js";
import { Action, Check, Select } from "./studio/parts.js";

/** Names with their words. @type {[string, string][]} */
const DICTIONARIES = [
  ...[4, 5, 6, 7].flatMap((bits) =>
    [50, 100, 250, 1000].map((count) => `${bits}X${bits}_${count}`),
  ),
  "ARUCO_ORIGINAL",
  "ARUCO_MIP_36H12",
  "APRILTAG_16H5",
  "APRILTAG_25H9",
  "APRILTAG_36H10",
  "APRILTAG_36H11",
].map((name) => [`DICT_${name}`, name.replaceAll("_", " ").toLowerCase()]);
/** @type {[string, string][]} */
const KINDS = [
  ["charuco", "ChArUco"],
  ["chessboard", "Chessboard"],
];
/** @type {[string, string][]} */
const PAGES = [
  ["a4", "A4"],
  ["a3", "A3"],
  ["letter", "Letter"],
];
const REMEMBERED = "calibration-board";

/** A board as it is remembered for the next time. */
const BOARD = {
  kind: "charuco",
  columns: "7",
  rows: "5",
  square: "36",
  marker: "27",
  dictionary: "DICT_4X4_250",
  legacy: false,
};
const EMPTY = {
  files: /** @type {FileList | null} */ (null),
  path: "",
  floor: "",
  thickness: "0",
  intrinsics: "",
  extrinsics: "",
  floorFolder: "",
  distances: /** @type {{ first: string, second: string, mm: string }[]} */ ([]),
  offsets: /** @type {Record<string, number>} */ ({}),
  refine: false,
  own: false,
  isOpen: false,
};

const sessionOffsets = async (/** @type {string} */ session) =>
  Object.fromEntries(
    (await fetchJson(`${sessionPath(session)}/footage`)).cameras.map((camera) => [
      camera.name,
      camera.offset,
    ]),
  );

/**
 * What was entered, and what is asked for by it.
 * @param {string} session
 */
export function boardOf(session) {
  const kept = JSON.parse(localStorage.getItem(REMEMBERED) ?? "{}");
  const entered = signal({ ...BOARD, ...kept, ...EMPTY });

  /** The board as `studio calibrate --board` takes it. */
  function description() {
    const { kind, columns, rows, square, marker, dictionary, legacy } = entered.value;
    localStorage.setItem(
      REMEMBERED,
      JSON.stringify({ kind, columns, rows, square, marker, dictionary, legacy }),
    );
    const sizes = `${columns}x${rows},${square}`;
    return kind === "chessboard"
      ? `chessboard:${sizes}`
      : `charuco:${sizes},${marker},${dictionary}${legacy ? ",legacy" : ""}`;
  }

  return {
    entered,
    /** @param {Record<string, any>} changes */
    enter: (changes) => {
      entered.value = { ...entered.value, ...changes };
    },
    /** @param {(files: FileList) => Promise<string>} upload resolves with its identifier */
    request: async (upload) => {
      const { files, path, floor, thickness, intrinsics, extrinsics, floorFolder, ...more } =
        entered.value;
      const distances = more.distances
        .filter((each) => Number(each.mm) > 0)
        .map((each) => ({ ...each, mm: Number(each.mm) }));
      const same = distances.find((each) => each.first === each.second);
      if (same)
        throw fault(
          `A distance from ${same.first} to itself cannot be measured.`,
          "Choose two cameras.",
        );
      const shifted = Object.fromEntries(
        Object.entries(more.offsets).filter(([, frames]) => frames),
      );
      return {
        board: description(),
        thickness_mm: Number(thickness),
        refine_lenses: more.refine,
        distances,
        floor: floorFolder || floor === "" ? "" : `frame:${floor}`,
        ...(floorFolder ? { floor_footage: { path: floorFolder } } : {}),
        ...(intrinsics ? { intrinsics: { path: intrinsics } } : {}),
        ...(extrinsics ? { extrinsics: { path: extrinsics } } : {}),
        ...(files?.length
          ? { footage: { upload: await upload(files) } }
          : path
            ? { footage: { path } }
            : {}),
        ...(more.own
          ? { offsets: await sessionOffsets(session) }
          : Object.keys(shifted).length
            ? { offsets: shifted }
            : {}),
      };
    },
  };
}

/** @typedef {ReturnType<typeof boardOf>} Model */

/**
 * A field under its label, of text unless said.
 * @param {Model} model
 * @param {string} name
 * @param {string} label
 * @param {Record<string, any>} more properties of its input; `title`
 */
const entry = (model, name, label, { title, ...more }) => html`<label title=${title}>
  ${label}
  <input
    type="text"
    value=${model.entered.value[name]}
    onInput=${({ target }) => model.enter({ [name]: target.value })}
    ...${more}
  />
</label>`;
const NUMBER = { type: "number", step: "any", min: 0 };
const COUNT = { type: "number", step: 1 };

/** A box to be checked. */
const box = (
  /** @type {Model} */ model,
  /** @type {string} */ name,
  /** @type {string} */ words,
  /** @type {string} */ title,
) => html`<${Check}
  checked=${model.entered.value[name]}
  take=${(checked) => model.enter({ [name]: checked })}
  title=${title}
>
  ${words}
</${Check}>`;

/** What describes a board. @param {{ model: Model }} properties */
function Board({ model }) {
  const { kind, dictionary } = model.entered.value;
  const isChessboard = kind === "chessboard";
  return html`
    <div class="step-row board-sizes">
      <${Select}
        label="Board"
        options=${KINDS}
        value=${kind}
        take=${(kind) => model.enter({ kind })}
      />
      ${entry(model, "columns", "Columns", { ...COUNT, min: 2 })}
      ${entry(model, "rows", "Rows", { ...COUNT, min: 2 })}
      ${entry(model, "square", "Square mm", { ...NUMBER, title: "As measured on the print" })}
      ${
        !isChessboard &&
        entry(model, "marker", "Marker mm", {
          ...NUMBER,
          title: "Side of a marker as measured on the print",
        })
      }
    </div>
    ${
      !isChessboard &&
      html`<div class="step-row">
        <${Select}
          label="Markers"
          title="The dictionary of the markers"
          options=${DICTIONARIES}
          value=${dictionary}
          take=${(dictionary) => model.enter({ dictionary })}
        />
        ${box(
          model,
          "legacy",
          "old pattern",
          "Boards drawn by OpenCV before 4.6 with an even number of rows",
        )}
      </div>`
    }
    <span class="hint">Columns and rows count ${isChessboard ? "inner corners" : "squares"}.</span>
  `;
}

function PrintRow() {
  const [kind, setKind] = useState(KINDS[0][0]);
  const [page, setPage] = useState(PAGES[0][0]);
  return html`<details class="print-board">
    <summary>No board yet? Print one</summary>
    <p class="hint">
      Print at 100 %, measure the bar and the squares, glue it on a flat, stiff plate.
    </p>
    <div class="step-row">
      <${Select} label="Board" options=${KINDS} value=${kind} take=${setKind} />
      <${Select} label="Paper" options=${PAGES} value=${page} take=${setPage} />
    </div>
    <div class="step-actions">
      <a class="link-button" href=${`/api/calibration-boards.pdf?kind=${kind}&page=${page}`}>
        Download the PDF
      </a>
    </div>
  </details>`;
}

/** Distances between lenses as they were measured with a tape: rows of two cameras and mm. */
function Distances(/** @type {{ model: Model, cameras: string[] }} */ { model, cameras }) {
  const { distances } = model.entered.value;
  const set = (/** @type {typeof distances} */ changed) => model.enter({ distances: changed });
  return html`<div class="distances">
    ${distances.map((each, at) => {
      const change = (/** @type {Partial<typeof each>} */ changes) =>
        set(distances.with(at, { ...each, ...changes }));
      const pick = (/** @type {"first" | "second"} */ key, /** @type {string} */ label) =>
        html`<${Select}
          aria-label=${label}
          options=${cameras}
          value=${each[key]}
          take=${(name) => change({ [key]: name })}
        />`;
      return html`<div key=${at} class="distance">
        ${pick("first", "First camera")} ${pick("second", "Second camera")}
        <input
          ...${NUMBER}
          placeholder="mm"
          aria-label="Millimetres between their lenses"
          value=${each.mm}
          onInput=${({ target }) => change({ mm: target.value })}
        />
        <${Action}
          kind="quiet small"
          act=${() => set(distances.toSpliced(at, 1))}
          aria-label="Leave this distance out"
        >
          ×
        </${Action}>
      </div>`;
    })}
    <div class="step-actions">
      <${Action}
        kind="small"
        act=${() => set([...distances, { first: cameras[0], second: cameras[1], mm: "" }])}
        title="Between two cameras' lenses, by tape. It checks the scale and so finds a wrong board size."
      >
        ${distances.length ? "Another distance" : "Add a measured distance"}
      </${Action}>
    </div>
  </div>`;
}

/** Where each camera's board footage begins. */
const Shifts = (/** @type {{ model: Model, cameras: string[] }} */ { model, cameras }) => html`<div
  class="shifts"
>
  ${cameras.map((camera) => {
    const { offsets } = model.entered.value;
    return html`<label
      key=${camera}
      title="Frame of this camera's common board footage that the others' frame 0 belongs to"
    >
      ${camera} begins at
      <input
        ...${COUNT}
        defaultValue=${offsets[camera] ?? 0}
        onInput=${({ target }) =>
          model.enter({ offsets: { ...offsets, [camera]: Number(target.value) } })}
      />
    </label>`;
  })}
</div>`;

/** Everything else that `studio calibrate` knows. */
const More = (
  /** @type {{ model: Model, cameras: string[] }} */ { model, cameras },
) => html`<details
  class="more-board"
  open=${model.entered.value.isOpen}
  onToggle=${({ currentTarget }) => model.enter({ isOpen: currentTarget.open })}
>
  <summary>More</summary>
  <div class="more-fields">
    ${entry(model, "intrinsics", "Lenses from", {
      title:
        "Board footage for the lenses, a video or folder of pictures for each camera; " +
        "or a calibration file that has them. Instead of intrinsics/",
      placeholder: "a folder, or a calibration file",
    })}
    ${entry(model, "extrinsics", "Positions from", {
      title: "Synchronised board footage of all cameras at once. Instead of extrinsics/",
      placeholder: "a folder",
    })}
    ${entry(model, "floorFolder", "Floor from pictures in", {
      title:
        "A picture a camera of the board that lies on the floor, face up; " +
        "instead of a frame of the common footage",
      placeholder: "a folder",
    })}
    ${
      cameras.length > 1 &&
      html`<${Distances} model=${model} cameras=${cameras} />
        ${box(
          model,
          "own",
          "The board was recorded without stopping: use the session's offsets",
          "Only where the board and the motion are one recording",
        )}
        ${!model.entered.value.own && html`<${Shifts} model=${model} cameras=${cameras} />`}`
    }
    ${box(
      model,
      "refine",
      "let the lenses move a little in the last adjustment",
      "Let the final adjustment of all cameras change the lenses a little; " +
        "only with a board that was seen all over the pictures",
    )}
  </div>
</details>`;

/**
 * The form. `cameras`: the footage's; `solve()` begins.
 * @param {{ model: Model, cameras: string[], hasFootage: boolean, isChief: boolean,
 *   solve: () => Promise<void> }} properties
 */
export const BoardForm = ({ model, cameras, hasFootage, isChief, solve }) => html`
  <p class="hint">
    A folder with intrinsics/ (the board close to each camera) and extrinsics/ (all cameras at
    once): one video or folder of pictures for each camera. Either alone is enough if it shows the
    board well.
  </p>
  <${Board} model=${model} />
  <label>
    Upload a folder
    <input
      type="file"
      webkitdirectory
      multiple
      onChange=${({ target }) => model.enter({ files: target.files })}
    />
  </label>
  ${entry(model, "path", "or on this computer", {
    placeholder: hasFootage ? "found in the session" : "full path of the folder",
  })}
  <div class="step-row">
    ${entry(model, "floor", "Board on the floor in frame", {
      ...COUNT,
      min: 0,
      title:
        "Frame of the common footage in which the board lies on the floor, face up; " +
        "the floor can be clicked later instead",
      placeholder: "not set",
    })}
    ${entry(model, "thickness", "Plate thickness mm", {
      ...NUMBER,
      title: "Of the plate that carries the board; matters where it lies on the floor",
    })}
  </div>
  <${More} model=${model} cameras=${cameras} />
  <div class="step-actions">
    <${Action} kind=${isChief ? "primary" : ""} act=${solve}>Calibrate</${Action}>
  </div>
  <${PrintRow} />
`;
