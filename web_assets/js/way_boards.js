// Calibration from a printed board: the board, where its footage lies, the floor, what was measured, a board to print.

import { button, element } from "./elements.js";
import { field, files, number, select, text } from "./way_fields.js";

const DICTIONARIES = ["DICT_4X4_50", "DICT_4X4_100", "DICT_4X4_250", "DICT_5X5_50", "DICT_5X5_100", "DICT_5X5_250", "DICT_6X6_100", "DICT_6X6_250", "DICT_7X7_250", "DICT_ARUCO_ORIGINAL"];
const PAGES = { a4: "A4", a3: "A3", letter: "Letter" };
const REMEMBERED = "calibration-board";

function boardFields() {
  const kept = JSON.parse(localStorage.getItem(REMEMBERED) ?? "null") ?? { kind: "charuco", columns: 7, rows: 5, square: 36, marker: 27 };
  const kind = select({ charuco: "ChArUco", chessboard: "Chessboard" });
  kind.value = kept.kind;
  const columns = number(kept.columns, { step: 1, min: 2 });
  const rows = number(kept.rows, { step: 1, min: 2 });
  const square = number(kept.square);
  const marker = number(kept.marker);
  const markerField = field("Marker mm", marker, "Side of a marker as measured on the print");
  const dictionary = select(Object.fromEntries(DICTIONARIES.map((name) => [name, name.replace("DICT_", "").replaceAll("_", " ").toLowerCase()])));
  dictionary.value = kept.dictionary ?? "DICT_4X4_250";
  const legacy = element("input", { type: "checkbox", checked: Boolean(kept.legacy) });
  const markers = element("div", { className: "step-row" }, field("Markers", dictionary, "The dictionary that the markers are of"),
    element("label", { className: "check", title: "Boards drawn by OpenCV before 4.6 with an even number of rows" }, legacy, "old pattern"));
  const count = element("span", { className: "hint" });
  const settle = () => {
    markerField.hidden = markers.hidden = kind.value === "chessboard";
    count.textContent = kind.value === "chessboard" ? "Columns and rows count inner corners." : "Columns and rows count squares.";
  };
  kind.onchange = settle;
  settle();
  const spelling = () => {
    localStorage.setItem(REMEMBERED, JSON.stringify({ kind: kind.value, columns: columns.value, rows: rows.value, square: square.value, marker: marker.value, dictionary: dictionary.value, legacy: legacy.checked }));
    const sizes = `${columns.value}x${rows.value},${square.value}`;
    return kind.value === "chessboard" ? `chessboard:${sizes}` : `charuco:${sizes},${marker.value},${dictionary.value}${legacy.checked ? ",legacy" : ""}`;
  };
  const rowsOf = [element("div", { className: "step-row board-sizes" }, field("Board", kind), field("Columns", columns), field("Rows", rows), field("Square mm", square, "As measured on the print"), markerField), markers, count];
  return { rowsOf, spelling };
}

function printRow() {
  const kind = select({ charuco: "ChArUco", chessboard: "Chessboard" });
  const page = select(PAGES);
  const link = element("a", { className: "link-button", textContent: "Download the PDF" });
  const settle = () => { link.href = `/api/calibration-boards.pdf?kind=${kind.value}&page=${page.value}`; };
  kind.onchange = page.onchange = settle;
  settle();
  return element("details", { className: "print-board" }, element("summary", { textContent: "No board yet? Print one" }),
    element("p", { className: "hint", textContent: "Print at 100 %, measure the bar and the squares, glue it on a flat, stiff plate." }),
    element("div", { className: "step-row" }, field("Board", kind), field("Paper", page)), element("div", { className: "step-actions" }, link));
}

/** Distances between lenses as they were measured with a tape: rows of two cameras and mm. */
function distanceRows(cameras, kept) {
  const box = element("div", { className: "distances" });
  const draw = () => {
    const rows = kept.map((each, index) => {
      const pick = (key, label) => {
        const made = select(Object.fromEntries(cameras.map((name) => [name, name])));
        made.value = each[key];
        made.setAttribute("aria-label", label);
        made.onchange = () => { each[key] = made.value; };
        return made;
      };
      const mm = number(each.mm, { placeholder: "mm", ariaLabel: "Millimetres between their lenses" });
      mm.oninput = () => { each.mm = mm.value; };
      const off = button("×", () => { kept.splice(index, 1); draw(); }, "quiet small");
      off.setAttribute("aria-label", "Leave this distance out");
      return element("div", { className: "distance" }, pick("first", "First camera"), pick("second", "Second camera"), mm, off);
    });
    const add = button(kept.length ? "Another distance" : "Add a measured distance", () => { kept.push({ first: cameras[0], second: cameras[1], mm: "" }); draw(); }, "small");
    add.title = "Between two cameras' lenses, by tape. It checks the scale: a board of another size than told is found by it.";
    box.replaceChildren(...rows, element("div", { className: "step-actions" }, add));
  };
  draw();
  return box;
}

/** Everything else that `studio calibrate` knows; what is entered stays in `wish`. */
function moreFields(way, cameras, wish) {
  const place = (key, placeholder) => {
    const made = text({ placeholder, value: wish[key] ?? "" });
    made.oninput = () => { wish[key] = made.value; };
    return made;
  };
  const refine = element("input", { type: "checkbox", checked: Boolean(wish.refine) });
  refine.onchange = () => { wish.refine = refine.checked; };
  const own = element("input", { type: "checkbox", checked: Boolean(wish.own) });
  own.onchange = () => { wish.own = own.checked; shifts.hidden = own.checked; };
  const shifts = element("div", { className: "shifts", hidden: Boolean(wish.own) }, ...cameras.map((camera) => {
    const made = element("input", { type: "number", step: 1, value: wish.offsets[camera] ?? 0 });
    made.oninput = () => { wish.offsets[camera] = Number(made.value); };
    return field(`${camera} begins at`, made, "Frame of this camera's common board footage that the others' frame 0 belongs to");
  }));
  const many = cameras.length > 1;
  return element("details", { className: "more-board", open: Boolean(wish.open) }, element("summary", { textContent: "More", onclick: () => { wish.open = !wish.open; } }), element("div", { className: "more-fields" },
    field("Lenses from", place("intrinsics", "a folder, or a calibration file"), "Board footage for the lenses, a video or folder of pictures a camera; or a calibration file that has them. Instead of intrinsics/"),
    field("Places from", place("extrinsics", "a folder"), "Board footage of all cameras at once, in step. Instead of extrinsics/"),
    field("Floor from pictures in", place("floorFolder", "a folder"), "A picture a camera of the board that lies on the floor, face up; instead of a frame of the common footage"),
    ...(many ? [distanceRows(cameras, wish.distances),
      element("label", { className: "check", title: "Only where board and take are one recording" }, own, "The board was recorded without stopping: use the session's offsets"), shifts] : []),
    element("label", { className: "check", title: "Lenses that were found alone may change a little where all cameras together say so; only with a board that was seen all over the pictures" }, refine, "let the lenses move a little in the last adjustment")));
}

/** The form. `solve(() => wish)` begins; `uploaded(input)` uploads and resolves with the upload's identifier. */
export function boardForm(way, state, { uploaded, solve }) {
  const wish = (state.wish ??= { distances: [], offsets: {} });
  const board = boardFields();
  const path = text({ placeholder: state.view.board_footage ? "found in the session" : "full path of the folder", value: wish.path ?? "" });
  path.oninput = () => { wish.path = path.value; };
  const upload = files({ webkitdirectory: true, multiple: true });
  const floor = number(wish.floor ?? "", { step: 1, placeholder: "not set" });
  floor.oninput = () => { wish.floor = floor.value; };
  const thickness = number(wish.thickness ?? 0);
  thickness.oninput = () => { wish.thickness = thickness.value; };
  const cameras = state.view.footage;

  async function wished() {
    const asked = { board: board.spelling(), thickness_mm: Number(thickness.value), floor: floor.value === "" ? "" : `frame:${floor.value}`, refine_lenses: Boolean(wish.refine) };
    asked.distances = wish.distances.filter((each) => Number(each.mm) > 0).map((each) => ({ ...each, mm: Number(each.mm) }));
    const same = asked.distances.find((each) => each.first === each.second);
    if (same) throw Object.assign(new Error(`A distance from ${same.first} to itself cannot be measured.`), { hint: "Choose two cameras." });
    if (wish.intrinsics) asked.intrinsics = { path: wish.intrinsics };
    if (wish.extrinsics) asked.extrinsics = { path: wish.extrinsics };
    if (wish.floorFolder) Object.assign(asked, { floor_footage: { path: wish.floorFolder }, floor: "" });
    if (upload.files.length) asked.footage = { upload: await uploaded(upload) };
    else if (path.value) asked.footage = { path: path.value };
    if (wish.own) asked.offsets = await sessionOffsets(way);
    else if (Object.values(wish.offsets).some(Boolean)) asked.offsets = Object.fromEntries(Object.entries(wish.offsets).filter(([, frames]) => frames));
    return asked;
  }

  return [
    element("p", { className: "hint", textContent: "A folder with intrinsics/ (the board close to each camera) and extrinsics/ (all cameras at once): one video or folder of pictures a camera. Either alone does, if it shows enough." }),
    ...board.rowsOf, field("Upload a folder", upload), field("or on this computer", path),
    element("div", { className: "step-row" }, field("Board on the floor in frame", floor, "Frame of the common footage in which the board lies on the floor, face up; the floor can be clicked later instead"),
      field("Plate thickness mm", thickness, "Of the plate that carries the board; matters where it lies on the floor")),
    moreFields(way, cameras, wish),
    element("div", { className: "step-actions" }, button("Calibrate", () => solve(wished), state.proposal ? "" : "primary")), printRow(),
  ];
}

async function sessionOffsets(way) {
  const told = await way.api.fetchJson(`${way.api.sessionPath(way.session)}/footage`);
  return Object.fromEntries(told.cameras.map((camera) => [camera.name, camera.offset]));
}
