// Calibration: the one in use or one that is proposed, three ways to get one, what speaks for and
// against it.

import { accepted, fetchJson, post, remove, sessionPath } from "./api.js";
import { findingList, plainNumbers, residualBars, rigFromAbove } from "./calibration_drawing.js";
import { clickFloor } from "./calibration_points.js";
import {
  actions,
  button,
  check,
  dotted,
  download,
  drawProgress,
  element,
  failure,
  field,
  files,
  fill,
  hint,
  notice,
  optional,
  picture,
  select,
  text,
} from "./elements.js";
import { findJob, isGoing, timeLeft } from "./jobs.js";
import { complain } from "./messages.js";
import { uploadFiles } from "./uploading.js";
import { boardForm } from "./setup_boards.js";

/** @import { Schemas } from "./api_types" */

const TABS = { file: "From a file", boards: "From a board", used: "In use" };
/** @type {[string, string][]} */
const UNITS = [
  ["", "as the file says"],
  ["mm", "millimetres"],
  ["m", "metres"],
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
const savedAt = (name) =>
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

/** @type {import("./setup.js").Mount<typeof load>} */
export function mount(place, setup, loaded) {
  const here = /** @type {const} */ (`${sessionPath(setup.session)}/calibration`);
  const progress = optional();
  /** @type {View} */
  let view = loaded.view;
  /** @type {Schemas["ProposalView"] | null} */
  let proposal = null;
  let tab = view.present ? "used" : view.board_footage ? "boards" : "file";
  let job = ""; // the identifier of the calibration that is being computed
  let stopClicking = null;
  let showsBoard = true; // whether the pictures are of the board, else of the recording
  let failed = loaded.failed;
  let gone = false;
  /**
   * @type {{ path: string, upload: string | null, unit: Schemas["CalibrationFileRequest"]["unit"], up:
   *   Schemas["CalibrationFileRequest"]["up"] }}
   */
  const fromFile = { path: "", upload: null, unit: "", up: "z" };
  const fromBoard = { distances: [], offsets: {} };

  const shown = () => proposal ?? view.present;
  const identifier = () => proposal?.identifier ?? "current";

  /** Propose, and show what was answered; what went wrong stands where the button is. */
  async function propose(work) {
    failed = proposal = null;
    try {
      proposal = await work();
      showsBoard = true;
    } catch (error) {
      failed = error;
    }
    draw();
    // The form above it may be longer than the window.
    place.querySelector(".proposal .step-actions")?.scrollIntoView({ block: "nearest" });
  }

  const uploaded = (input) =>
    uploadFiles(input.files, (words, share) => drawProgress(progress, { words, share })).finally(
      () => drawProgress(progress, null),
    );

  function fileForm() {
    const path = text({
      placeholder: "full path of a file or folder",
      value: fromFile.path,
      oninput: () => Object.assign(fromFile, { path: path.value, upload: null }),
    });
    const upload = files({
      multiple: true,
      onchange: () => {
        path.value = "";
        Object.assign(fromFile, { path: "", upload: null });
      },
    });
    const read = () =>
      propose(async () => {
        if (upload.files?.length) fromFile.upload = await uploaded(upload);
        const from = fromFile.upload ? { upload: fromFile.upload } : { path: path.value };
        return post(`${here}/proposals`, { ...from, unit: fromFile.unit, up: fromFile.up });
      });
    // A unit or an axis that is corrected is seen at once.
    const corrected =
      (key) =>
      ({ target }) => {
        fromFile[key] = target.value;
        if (proposal && (fromFile.upload || fromFile.path)) read();
      };
    return [
      hint(
        "Pose2Sim, anipose, FreeMoCap, Caliscope, EasyMocap, OpenCV, Qualisys or Bouguet files. Nothing changes before you use it.",
      ),
      field("Upload", upload),
      field("or on this computer", path),
      element(
        "div",
        { className: "step-row" },
        field(
          "Unit",
          select(UNITS, fromFile.unit, {
            title: "Lengths in the file",
            onchange: corrected("unit"),
          }),
        ),
        field(
          "Points up",
          select(AXES, fromFile.up, {
            title: "The axis of the file's world that points up",
            onchange: corrected("up"),
          }),
        ),
      ),
      actions(button("Read the file", read, proposal ? "" : "primary")),
    ];
  }

  const boards = () =>
    boardForm(setup.session, {
      cameras: view.footage,
      inputs: fromBoard,
      hasFootage: view.board_footage,
      isChief: !proposal,
      uploaded,
      solve,
    });

  async function solve(request) {
    failed = proposal = null;
    // What is entered stays: a file field that is drawn anew is empty.
    for (const old of place.querySelectorAll(":scope > .wrong, :scope > .proposal")) old.remove();
    try {
      const begun = await post(`${here}/solve`, await request());
      job = begun.identifier;
      hear(begun);
    } catch (error) {
      failed = error;
      draw();
    }
  }

  /**
   * Turn the world of the calibration in use to the vertical, with the floor under the person by
   * the silhouettes.
   */
  async function level() {
    failed = proposal = null;
    try {
      const begun = await post(`${here}/level`, {});
      job = begun.identifier;
      hear(begun);
    } catch (error) {
      failed = error;
      draw();
    }
  }

  /** The calibration that is being computed got further. */
  async function hear(state) {
    if (gone || state.identifier !== job) return;
    if (isGoing(state)) {
      const cancel = () => remove(`/api/calibrations/${job}`).catch(complain);
      return drawProgress(progress, {
        words: dotted(
          state.step || "Beginning",
          state.total > 1 && `${state.done} of ${state.total}`,
          timeLeft(state.seconds_left) && `about ${timeLeft(state.seconds_left)}`,
        ),
        share: state.share,
        cancel,
      });
    }
    job = "";
    drawProgress(progress, null);
    if (state.state === "done")
      return propose(() => fetchJson(`${here}/proposals/${state.proposal}`));
    failed = state.state === "failed" ? state : null;
    draw();
  }

  async function save(format) {
    const answer = await accepted(await fetch(`${here}/export?format=${format}`));
    const name = answer.headers.get("content-disposition").match(/filename="([^"]+)"/)[1];
    download(name, await answer.blob());
    const notes = decodeURIComponent(answer.headers.get("x-studio-notes") ?? "");
    failed = notes ? { message: notes } : null;
    if (notes) draw();
  }

  function usedForm() {
    const { present, earlier, formats, notes, changed, stale_runs: stale } = view;
    if (!present) return [hint("No calibration yet.")];
    const format = select(Object.entries(formats));
    const back = select(earlier.map((name) => [name, savedAt(name)]));
    const row = (label, made, act) =>
      element(
        "div",
        { className: "step-row" },
        field(label, made),
        element("div", { className: "step-actions at-end" }, act),
      );
    return [
      element(
        "p",
        {},
        element("b", {}, present.source || "imported with the footage"),
        changed &&
          element(
            "span",
            { className: "quiet-text" },
            ` · since ${new Date(changed).toLocaleString()}`,
          ),
      ),
      ...notes.map((note) => notice(note)),
      !notes.length &&
        stale.length > 0 &&
        notice(`Tracked with another calibration: ${stale.join(", ")}.`),
      row(
        "Export for other tools",
        format,
        button("Download", () => save(format.value).catch(complain)),
      ),
      earlier.length > 0 &&
        row(
          "Earlier ones",
          back,
          button("Preview", () =>
            propose(() => post(`${here}/proposals`, { earlier: back.value })),
          ),
        ),
    ];
  }

  // What is proposed, and what is done with it.

  async function apply(identifier, anyway) {
    try {
      view = await post(`${here}/proposals/${String(identifier)}/apply`, { anyway });
      failed = proposal = null;
      tab = "used";
      await setup.refresh();
    } catch (error) {
      failed = error;
    }
    draw();
  }

  function pointWords(points) {
    const off = Math.max(...points.flatMap((point) => Object.values(point.missed_px)));
    const high = Math.max(...points.map((point) => Math.abs(point.place[2])));
    return `${points.length} points: the clicks miss them by up to ${plainNumbers(off)} px, and they lie within ${plainNumbers(high, 0)} mm of one plane.`;
  }

  /** @param {Schemas["ProposalView"]} made */
  function proposalBox(made) {
    const blocked = made.findings.some((one) => one.severity === "blocks");
    const use = button("Use this calibration", () => apply(made.identifier, blocked), "primary", {
      disabled: blocked,
    });
    return element(
      "section",
      { className: "proposal" },
      element("h2", {}, made.source),
      made.unit_note && hint(made.unit_note),
      made.notes.map((note) => hint(note)),
      made.points.length > 0 && hint(pointWords(made.points)),
      blocked &&
        made.cameras.length > 0 &&
        check("Use it although results will be wrong", {
          onchange: ({ target }) => {
            use.disabled = !target.checked;
          },
        }),
      actions(
        use,
        button(
          "Discard",
          () => {
            proposal = null;
            draw();
          },
          "quiet",
        ),
      ),
    );
  }

  function startClicking() {
    const end = () => {
      stopClicking = null;
      draw();
    };
    stopClicking = clickFloor(setup.aside, {
      cameras: shown()?.cameras ?? [],
      picture: (camera) =>
        `${here}/proposals/${identifier()}/views/${encodeURIComponent(camera)}.jpg?height=720&board=${showsBoard}&axes=false`,
      send: async (points) => {
        proposal = await post(`${here}/floor`, { proposal: proposal?.identifier ?? "", points });
        end();
      },
      stop: end,
    });
  }

  function drawAside() {
    const rig = shown();
    if (!rig)
      return fill(
        setup.aside,
        element(
          "div",
          { className: "aside-empty" },
          element("p", {}, "The cameras are drawn here once there is a calibration."),
        ),
      );
    const address = `${here}/proposals/${identifier()}`;
    /** @type {any[]} */
    const lenses = /** @type {any} */ (rig.report)?.cameras ?? [];
    const figures = rig.cameras.map((camera) => {
      const image = element("img", {
        alt: `Floor and axes on the picture of ${camera.name}`,
        src: `${address}/views/${encodeURIComponent(camera.name)}.jpg?height=480&board=${showsBoard}&at=${Date.now()}`,
        onerror: () => {
          image.hidden = true;
        },
      });
      const made = picture(
        image,
        camera.name,
        dotted(
          `${camera.width}×${camera.height}, focal length ${plainNumbers(camera.focal_px[0], 0)} px`,
          camera.rms_px !== null && `${plainNumbers(camera.rms_px, 2)} px`,
        ),
      );
      made.classList.add("axes-picture");
      return made;
    });
    const coverage = lenses
      .filter((lens) => lens.pictures.length)
      .map((lens) =>
        element(
          "figure",
          { className: "picture coverage" },
          element("img", {
            alt: `Where the board was seen by ${lens.name}`,
            src: `${address}/coverage/${encodeURIComponent(lens.name)}.png`,
          }),
          element(
            "figcaption",
            {},
            element("b", {}, `${lens.name}: ${Math.round(100 * lens.coverage)} % covered`),
            residualBars(lens),
            element("span", {}, lens.verdict),
          ),
        ),
      );
    fill(
      setup.aside,
      element(
        "div",
        { className: "calibrated" },
        element(
          "div",
          { className: "aside-actions" },
          rig.cameras.length > 1 && button("Set the floor by clicks", startClicking, "small"),
          !proposal &&
            (view.present?.cameras.length ?? 0) > 1 &&
            setup.detail.cameras.length > 0 &&
            button("Level it", level, "small", {
              title:
                "Turn the world to the cameras' vertical and put z = 0 under the person's feet, by the silhouettes",
            }),
          proposal &&
            lenses.length > 0 &&
            setup.detail.cameras.length > 0 &&
            button(
              showsBoard ? "Show the recording" : "Show the board",
              () => {
                showsBoard = !showsBoard;
                drawAside();
              },
              "small quiet",
            ),
        ),
        rig.cameras.length > 0 && rigFromAbove(rig),
        element("div", { className: "pictures" }, figures),
        coverage.length > 0 && element("h2", {}, "Coverage of the board"),
        element("div", { className: "pictures" }, coverage),
      ),
    );
  }

  function draw() {
    if (gone) return;
    const tabs = element(
      "div",
      { className: "group", role: "tablist" },
      Object.entries(TABS).map(([name, words]) =>
        button(
          words,
          () => {
            tab = name;
            failed = null;
            draw();
          },
          "toggle",
          { role: "tab", ariaSelected: String(tab === name) },
        ),
      ),
    );
    const rig = shown();
    fill(
      place,
      tabs,
      { file: fileForm, boards, used: usedForm }[tab](),
      progress,
      failure(failed),
      proposal && proposalBox(proposal),
      rig && (proposal || rig.findings.length || !setup.step?.why) && findingList(rig),
    );
    if (!stopClicking) drawAside();
  }

  setup.on("calibration", hear);
  // A calibration that was begun before this step was shown goes on to be followed.
  findJob({ session: setup.session, kind: "calibration" })
    .then((known) => {
      if (gone || job || !known) return undefined;
      if (isGoing(known) || known.state === "failed") {
        job = known.identifier;
        return hear(known);
      }
      return undefined;
    })
    .catch(complain);
  draw();
  return () => {
    gone = true;
    stopClicking?.();
  };
}
