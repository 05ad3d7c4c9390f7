// Calibration: the one in use or one that is proposed, three ways to get one, what speaks for and against it.

import { uploadFiles } from "./uploading.js";
import { button, duration, element } from "./elements.js";
import { complain } from "./messages.js";
import { findingList, plainNumbers, rigFromAbove, residualBars } from "./calibration_drawing.js";
import { clickFloor } from "./calibration_points.js";
import { boardForm } from "./way_boards.js";
import { field, files, select, text } from "./way_fields.js";
import { isGoing } from "./jobs.js";

const WAYS = { file: "From a file", boards: "From a board", used: "In use" };
/** The step. */
export function mount(place, way) {
  const here = `${way.api.sessionPath(way.session)}/calibration`;
  const progress = element("div");
  const state = { view: null, proposal: null, tab: "", job: "", clicking: null, board: true, said: [] };
  let gone = false;

  const shown = () => state.proposal ?? state.view?.present;
  const identifier = () => state.proposal?.identifier ?? "current";

  async function look() {
    state.view = await way.api.fetchJson(here);
    state.tab ||= state.view.present ? "used" : state.view.board_footage ? "boards" : "file";
    draw();
  }

  /** Ask, and show what was answered; failures are said where the button is. */
  async function propose(ask) {
    try {
      state.said = [];
      state.proposal = await ask();
      state.board = true;
    } catch (error) {
      state.proposal = null;
      state.said = [error];
    }
    draw();
  }

  const uploaded = (input) => uploadFiles(input.files, (words) => way.progress(progress, { words, share: null })).finally(() => way.progress(progress, null));

  // --- from a file
  function fileForm() {
    const path = text({ placeholder: "full path of a file or folder", value: state.path ?? "" });
    const upload = files({ multiple: true });
    const unit = select({ "": "as the file says", mm: "millimetres", m: "metres" });
    const up = select({ z: "Z", y: "Y", x: "X", "-z": "−Z", "-y": "−Y", "-x": "−X" });
    unit.value = state.unit ?? "";
    up.value = state.up ?? "z";
    path.oninput = () => { state.path = path.value; state.upload = null; };
    upload.onchange = () => { state.upload = null; state.path = path.value = ""; };
    const read = async () => {
      state.unit = unit.value;
      state.up = up.value;
      await propose(async () => {
        if (upload.files.length) state.upload = await uploaded(upload);
        const wish = state.upload ? { upload: state.upload } : { path: path.value };
        return way.api.post(`${here}/proposals`, { ...wish, unit: unit.value, up: up.value });
      });
    };
    // A unit or an axis that is corrected is seen at once.
    unit.onchange = up.onchange = () => { if (state.proposal && (state.upload || state.path)) read(); };
    return [
      element("p", { className: "hint", textContent: "Pose2Sim, anipose, FreeMoCap, Caliscope, EasyMocap, OpenCV, Qualisys or Bouguet files. Nothing changes before you use it." }),
      field("Upload", upload), field("or on this computer", path),
      element("div", { className: "step-row" }, field("Unit", unit, "Lengths in the file"), field("Points up", up, "The axis of the file's world that points up")),
      element("div", { className: "step-actions" }, button("Read the file", read, state.proposal ? "" : "primary")),
    ];
  }

  // --- from boards
  async function solve(wished) {
    state.said = [];
    state.proposal = null;
    try {
      const begun = await way.api.post(`${here}/solve`, await wished());
      state.job = begun.identifier;
      hear(begun);
    } catch (error) { state.said = [error]; draw(); }
  }

  /** The job got further. */
  async function hear(told) {
    if (gone || told.identifier !== state.job) return;
    if (isGoing(told)) {
      const left = told.seconds_left > 2 ? ` · about ${duration(told.seconds_left)} left` : "";
      way.progress(progress, { words: `${told.step || "Beginning"}${told.total > 1 ? ` · ${told.done} of ${told.total}` : ""}${left}`, share: told.share, cancel: () => way.api.remove(`/api/calibrations/${state.job}`).catch(complain) });
      return;
    }
    state.job = "";
    way.progress(progress, null);
    if (told.state === "done") await propose(() => way.api.fetchJson(`${here}/proposals/${told.proposal}`));
    else { state.said = told.state === "failed" ? [told] : []; draw(); }
  }

  // --- in use
  function usedForm() {
    const { present, earlier, formats } = state.view;
    if (!present) return [element("p", { className: "hint", textContent: "No calibration yet." })];
    const form = select(formats);
    const save = async () => {
      const answer = await fetch(`${here}/export?format=${form.value}`);
      if (!answer.ok) throw Object.assign(new Error((await answer.json()).message), { hint: "" });
      const name = answer.headers.get("content-disposition").match(/filename="([^"]+)"/)[1];
      const link = element("a", { href: URL.createObjectURL(await answer.blob()), download: name });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
      const notes = decodeURIComponent(answer.headers.get("x-studio-notes") ?? "");
      state.said = notes ? [{ message: notes, hint: "" }] : [];
      if (notes) draw();
    };
    const back = select(Object.fromEntries(earlier.map((name) => [name, `replaced ${name.slice(0, 4)}-${name.slice(4, 6)}-${name.slice(6, 8)} ${name.slice(9, 11)}:${name.slice(11, 13)} UTC`])));
    return [
      element("p", {}, element("b", { textContent: present.source || "imported with the footage" }), state.view.changed && element("span", { className: "quiet-text", textContent: ` · since ${new Date(state.view.changed).toLocaleString()}` })),
      ...state.view.notes.map((note) => element("p", { className: "notice", textContent: note })),
      !state.view.notes.length && state.view.stale_runs.length > 0 && element("p", { className: "notice", textContent: `Tracked with another calibration: ${state.view.stale_runs.join(", ")}.` }),
      element("div", { className: "step-row" }, field("Export for other tools", form), element("div", { className: "step-actions at-end" }, button("Download", () => save().catch(complain)))),
      earlier.length > 0 && element("div", { className: "step-row" }, field("Earlier ones", back), element("div", { className: "step-actions at-end" }, button("Look at it", () => propose(() => way.api.post(`${here}/proposals`, { earlier: back.value }))))),
    ];
  }

  // --- what is proposed, and what is done with it
  async function apply(anyway) {
    try {
      state.view = await way.api.post(`${here}/proposals/${state.proposal.identifier}/apply`, { anyway });
      Object.assign(state, { proposal: null, tab: "used", said: [] });
      await way.refresh();
    } catch (error) { state.said = [error]; }
    draw();
  }

  function pointWords(points) {
    const off = Math.max(...points.flatMap((point) => Object.values(point.missed_px)));
    const high = Math.max(...points.map((point) => Math.abs(point.place[2])));
    return `${points.length} points: the clicks miss them by up to ${plainNumbers(off)} px, and they lie within ${plainNumbers(high, 0)} mm of one plane.`;
  }

  function proposalBox() {
    const made = state.proposal;
    const warned = made.findings.some((one) => one.severity === "blocks");
    const sure = element("input", { type: "checkbox" });
    const use = button("Use this calibration", () => apply(sure.checked), "primary");
    use.disabled = warned;
    sure.onchange = () => { use.disabled = !sure.checked; };
    return element("section", { className: "proposal" }, element("h2", { textContent: made.source }),
      made.unit_note && element("p", { className: "hint", textContent: made.unit_note }),
      ...made.notes.map((note) => element("p", { className: "hint", textContent: note })),
      made.points.length > 0 && element("p", { className: "hint", textContent: pointWords(made.points) }),
      warned && made.cameras.length > 0 && element("label", { className: "check" }, sure, "Use it although results would be wrong"),
      element("div", { className: "step-actions" }, use, button("Leave it", () => { state.proposal = null; draw(); }, "quiet")));
  }

  function startClicking() {
    state.clicking = clickFloor(way.aside, {
      cameras: shown().cameras,
      picture: (camera) => `${here}/proposals/${identifier()}/views/${encodeURIComponent(camera)}.jpg?height=720&board=${state.board}&axes=false`,
      send: async (points) => { const base = state.proposal?.identifier ?? ""; state.proposal = await way.api.post(`${here}/floor`, { proposal: base, points }); state.clicking = null; draw(); },
      stop: () => { state.clicking = null; draw(); },
    });
  }

  function drawAside() {
    const rig = shown();
    if (!rig) return way.aside.replaceChildren(element("div", { className: "aside-empty" }, element("p", { textContent: "The cameras are drawn here once there is a calibration." })));
    const address = `${here}/proposals/${identifier()}`;
    const lenses = rig.report?.cameras ?? [];
    const figures = rig.cameras.map((camera) => {
      const image = element("img", { alt: `Floor and axes on the picture of ${camera.name}`, src: `${address}/views/${encodeURIComponent(camera.name)}.jpg?height=480&board=${state.board}&at=${Date.now()}` });
      image.onerror = () => { image.hidden = true; };
      const off = camera.rms_px === null ? "" : ` · ${plainNumbers(camera.rms_px, 2)} px`;
      return element("figure", { className: "picture axes-picture" }, image, element("figcaption", {}, element("b", { textContent: camera.name }),
        `${camera.width}×${camera.height}, focal length ${plainNumbers(camera.focal_px[0], 0)} px${off}`));
    });
    const coverage = lenses.filter((lens) => lens.pictures.length).map((lens) => element("figure", { className: "picture coverage" },
      element("img", { alt: `Where the board was seen by ${lens.name}`, src: `${address}/coverage/${encodeURIComponent(lens.name)}.png` }),
      element("figcaption", {}, element("b", { textContent: `${lens.name}: ${Math.round(100 * lens.coverage)} % covered` }), residualBars(lens), element("span", { textContent: lens.verdict }))));
    const head = element("div", { className: "aside-actions" }, rig.cameras.length > 1 && button("Set the floor by clicks", startClicking, "small"),
      state.proposal && lenses.length > 0 && way.detail.cameras?.length > 0 && button(state.board ? "Show the take" : "Show the board", () => { state.board = !state.board; drawAside(); }, "small quiet"));
    way.aside.replaceChildren(element("div", { className: "calibrated" }, head, rig.cameras.length > 0 && rigFromAbove(rig), element("div", { className: "pictures" }, ...figures),
      coverage.length > 0 && element("h2", { textContent: "What the board told" }), element("div", { className: "pictures" }, ...coverage)));
  }

  function draw() {
    if (gone || !state.view) return;
    const tabs = element("div", { className: "ways", role: "tablist" }, ...Object.entries(WAYS).map(([name, words]) => {
      const tab = button(words, () => { state.tab = name; state.said = []; draw(); }, "toggle");
      tab.setAttribute("role", "tab");
      tab.setAttribute("aria-selected", String(state.tab === name));
      tab.setAttribute("aria-pressed", String(state.tab === name));
      return tab;
    }));
    const form = { file: fileForm, boards: () => boardForm(way, state, { uploaded, solve }), used: usedForm }[state.tab]();
    const said = state.said.map((error) => element("div", { role: "alert" }, element("p", { className: "wrong", textContent: error.message }), error.hint && element("p", { className: "hint", textContent: error.hint })));
    const rig = shown();
    place.replaceChildren(...[tabs, ...form, progress, ...said, state.proposal && proposalBox(), rig && (state.proposal || rig.findings.length || !way.step?.why) && findingList(rig)].filter(Boolean));
    if (!state.clicking) drawAside();
  }

  way.on("calibration", hear);
  look().catch((error) => { state.view = { present: null, earlier: [], formats: {}, footage: [], notes: [], stale_runs: [] }; state.tab = "file"; state.said = [error]; draw(); });
  return () => { gone = true; state.clicking?.(); };
}
