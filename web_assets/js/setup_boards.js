// Calibration from a printed board: the board, where its footage lies, the floor, what was
// measured, a board to print.

import { fault, fetchJson, sessionPath } from "./api.js";
import {
  actions,
  button,
  check,
  element,
  field,
  files,
  fill,
  hint,
  number,
  select,
  text,
} from "./elements.js";

const DICTIONARIES = [
  ...[4, 5, 6, 7].flatMap((bits) =>
    [50, 100, 250, 1000].map((count) => `DICT_${bits}X${bits}_${count}`),
  ),
  "DICT_ARUCO_ORIGINAL",
  "DICT_ARUCO_MIP_36H12",
  "DICT_APRILTAG_16H5",
  "DICT_APRILTAG_25H9",
  "DICT_APRILTAG_36H10",
  "DICT_APRILTAG_36H11",
];
/** @type {[string, string][]} */
const KINDS = [
  ["charuco", "ChArUco"],
  ["chessboard", "Chessboard"],
];
const REMEMBERED = "calibration-board";

/**
 * The fields that describe a board. `description()`: the board as `studio calibrate --board` takes
 * it, remembered for the next time.
 */
function boardFields() {
  const kept = JSON.parse(localStorage.getItem(REMEMBERED) ?? "null") ?? {
    kind: "charuco",
    columns: 7,
    rows: 5,
    square: 36,
    marker: 27,
  };
  const kind = select(KINDS, kept.kind);
  const columns = number(kept.columns, { step: 1, min: 2 });
  const rows = number(kept.rows, { step: 1, min: 2 });
  const square = number(kept.square, { title: "As measured on the print" });
  const marker = number(kept.marker);
  const markerField = field("Marker mm", marker, {
    title: "Side of a marker as measured on the print",
  });
  const dictionary = select(
    DICTIONARIES.map((name) => [
      name,
      name.replace("DICT_", "").replaceAll("_", " ").toLowerCase(),
    ]),
    kept.dictionary ?? "DICT_4X4_250",
  );
  const legacy = check(
    "old pattern",
    { checked: Boolean(kept.legacy) },
    "Boards drawn by OpenCV before 4.6 with an even number of rows",
  );
  const markers = element(
    "div",
    { className: "step-row" },
    field("Markers", dictionary, { title: "The dictionary of the markers" }),
    legacy,
  );
  const count = element("span", { className: "hint" });
  kind.onchange = () => {
    markerField.hidden = markers.hidden = kind.value === "chessboard";
    count.textContent =
      kind.value === "chessboard"
        ? "Columns and rows count inner corners."
        : "Columns and rows count squares.";
  };
  kind.dispatchEvent(new Event("change"));
  const description = () => {
    const old = legacy.querySelector("input")?.checked ?? false;
    localStorage.setItem(
      REMEMBERED,
      JSON.stringify({
        kind: kind.value,
        columns: columns.value,
        rows: rows.value,
        square: square.value,
        marker: marker.value,
        dictionary: dictionary.value,
        legacy: old,
      }),
    );
    const sizes = `${columns.value}x${rows.value},${square.value}`;
    return kind.value === "chessboard"
      ? `chessboard:${sizes}`
      : `charuco:${sizes},${marker.value},${dictionary.value}${old ? ",legacy" : ""}`;
  };
  return {
    lines: [
      element(
        "div",
        { className: "step-row board-sizes" },
        field("Board", kind),
        field("Columns", columns),
        field("Rows", rows),
        field("Square mm", square),
        markerField,
      ),
      markers,
      count,
    ],
    description,
  };
}

function printRow() {
  const kind = select(KINDS);
  const page = select([
    ["a4", "A4"],
    ["a3", "A3"],
    ["letter", "Letter"],
  ]);
  const link = element("a", { className: "link-button" }, "Download the PDF");
  const settle = () => {
    link.href = `/api/calibration-boards.pdf?kind=${kind.value}&page=${page.value}`;
  };
  kind.onchange = page.onchange = settle;
  settle();
  return element(
    "details",
    { className: "print-board" },
    element("summary", {}, "No board yet? Print one"),
    hint("Print at 100 %, measure the bar and the squares, glue it on a flat, stiff plate."),
    element("div", { className: "step-row" }, field("Board", kind), field("Paper", page)),
    actions(link),
  );
}

/** Distances between lenses as they were measured with a tape: rows of two cameras and mm. */
function distanceRows(cameras, kept) {
  const box = element("div", { className: "distances" });
  const row = (each, index) => {
    const pick = (key, ariaLabel) =>
      select(cameras, each[key], {
        ariaLabel,
        onchange: ({ target }) => {
          each[key] = target.value;
        },
      });
    return element(
      "div",
      { className: "distance" },
      pick("first", "First camera"),
      pick("second", "Second camera"),
      number(each.mm, {
        placeholder: "mm",
        ariaLabel: "Millimetres between their lenses",
        oninput: ({ target }) => {
          each.mm = target.value;
        },
      }),
      button(
        "×",
        () => {
          kept.splice(index, 1);
          draw();
        },
        "quiet small",
        { ariaLabel: "Leave this distance out" },
      ),
    );
  };
  const draw = () =>
    fill(
      box,
      kept.map(row),
      actions(
        button(
          kept.length ? "Another distance" : "Add a measured distance",
          () => {
            kept.push({ first: cameras[0], second: cameras[1], mm: "" });
            draw();
          },
          "small",
          {
            title:
              "Between two cameras' lenses, by tape. It checks the scale and so finds a wrong board size.",
          },
        ),
      ),
    );
  draw();
  return box;
}

/** Everything else that `studio calibrate` knows; what is entered stays in `inputs`. */
function moreFields(cameras, inputs) {
  const place = (key, placeholder) =>
    text({
      placeholder,
      value: inputs[key] ?? "",
      oninput: ({ target }) => {
        inputs[key] = target.value;
      },
    });
  const shifts = element(
    "div",
    { className: "shifts", hidden: Boolean(inputs.own) },
    cameras.map((camera) =>
      field(
        `${camera} begins at`,
        number(inputs.offsets[camera] ?? 0, {
          step: 1,
          min: "",
          oninput: ({ target }) => {
            inputs.offsets[camera] = Number(target.value);
          },
        }),
        {
          title: "Frame of this camera's common board footage that the others' frame 0 belongs to",
        },
      ),
    ),
  );
  return element(
    "details",
    { className: "more-board", open: Boolean(inputs.open) },
    element(
      "summary",
      {
        onclick: () => {
          inputs.open = !inputs.open;
        },
      },
      "More",
    ),
    element(
      "div",
      { className: "more-fields" },
      field("Lenses from", place("intrinsics", "a folder, or a calibration file"), {
        title:
          "Board footage for the lenses, a video or folder of pictures for each camera; or a calibration file that has them. Instead of intrinsics/",
      }),
      field("Positions from", place("extrinsics", "a folder"), {
        title: "Synchronised board footage of all cameras at once. Instead of extrinsics/",
      }),
      field("Floor from pictures in", place("floorFolder", "a folder"), {
        title:
          "A picture a camera of the board that lies on the floor, face up; instead of a frame of the common footage",
      }),
      cameras.length > 1 && [
        distanceRows(cameras, inputs.distances),
        check(
          "The board was recorded without stopping: use the session's offsets",
          {
            checked: Boolean(inputs.own),
            onchange: ({ target }) => {
              inputs.own = shifts.hidden = target.checked;
            },
          },
          "Only where the board and the motion are one recording",
        ),
        shifts,
      ],
      check(
        "let the lenses move a little in the last adjustment",
        {
          checked: Boolean(inputs.refine),
          onchange: ({ target }) => {
            inputs.refine = target.checked;
          },
        },
        "Let the final adjustment of all cameras change the lenses a little; only with a board that was seen all over the pictures",
      ),
    ),
  );
}

const sessionOffsets = async (session) =>
  Object.fromEntries(
    (await fetchJson(`${sessionPath(session)}/footage`)).cameras.map((camera) => [
      camera.name,
      camera.offset,
    ]),
  );

/**
 * The form. cameras: the footage's; inputs: what was entered so far, which it goes on with;
 * `solve(() => request)` begins; `uploaded(input)` uploads and resolves with the upload's
 * identifier.
 */
export function boardForm(session, { cameras, inputs, hasFootage, isChief, uploaded, solve }) {
  const board = boardFields();
  const entered = (key, made) =>
    Object.assign(made, {
      oninput: () => {
        inputs[key] = made.value;
      },
    });
  const path = entered(
    "path",
    text({
      placeholder: hasFootage ? "found in the session" : "full path of the folder",
      value: inputs.path ?? "",
    }),
  );
  const upload = files({ folder: true, multiple: true });
  const floor = entered("floor", number(inputs.floor ?? "", { step: 1, placeholder: "not set" }));
  const thickness = entered("thickness", number(inputs.thickness ?? 0));

  async function request() {
    const distances = inputs.distances
      .filter((each) => Number(each.mm) > 0)
      .map((each) => ({ ...each, mm: Number(each.mm) }));
    const same = distances.find((each) => each.first === each.second);
    if (same)
      throw fault(
        `A distance from ${same.first} to itself cannot be measured.`,
        "Choose two cameras.",
      );
    const shifted = Object.fromEntries(
      Object.entries(inputs.offsets).filter(([, frames]) => frames),
    );
    return {
      board: board.description(),
      thickness_mm: Number(thickness.value),
      refine_lenses: Boolean(inputs.refine),
      distances,
      floor: inputs.floorFolder || floor.value === "" ? "" : `frame:${floor.value}`,
      ...(inputs.floorFolder ? { floor_footage: { path: inputs.floorFolder } } : {}),
      ...(inputs.intrinsics ? { intrinsics: { path: inputs.intrinsics } } : {}),
      ...(inputs.extrinsics ? { extrinsics: { path: inputs.extrinsics } } : {}),
      ...(upload.files?.length
        ? { footage: { upload: await uploaded(upload) } }
        : path.value
          ? { footage: { path: path.value } }
          : {}),
      ...(inputs.own
        ? { offsets: await sessionOffsets(session) }
        : Object.keys(shifted).length
          ? { offsets: shifted }
          : {}),
    };
  }

  return [
    hint(
      "A folder with intrinsics/ (the board close to each camera) and extrinsics/ (all cameras at once): one video or folder of pictures for each camera. Either alone is enough if it shows the board well.",
    ),
    ...board.lines,
    field("Upload a folder", upload),
    field("or on this computer", path),
    element(
      "div",
      { className: "step-row" },
      field("Board on the floor in frame", floor, {
        title:
          "Frame of the common footage in which the board lies on the floor, face up; the floor can be clicked later instead",
      }),
      field("Plate thickness mm", thickness, {
        title: "Of the plate that carries the board; matters where it lies on the floor",
      }),
    ),
    moreFields(cameras, inputs),
    actions(button("Calibrate", () => solve(request), isChief ? "primary" : "")),
    printRow(),
  ];
}
