// Step Background: what backgrounds are made of, how masks are cut, what does not count, how far the views agree.

import { button, duration, element } from "./elements.js";
import { complain } from "./messages.js";
import { uploadFiles } from "./uploading.js";
import { alignmentBox } from "./way_alignment.js";
import { brush } from "./way_brush.js";
import { maskPictures } from "./way_masks.js";
import { qualityList } from "./way_quality.js";
import { isGoing } from "./jobs.js";

const POLL_MILLISECONDS = 500;
const PREVIEW_MILLISECONDS = 180;
const SOURCES = {
  combined: ["Combined", "Pictures of the empty room where there are any, the footage itself elsewhere; cleaned by what the other views see. The best where there are three cameras or more."],
  plate: ["Picture", "A picture of the empty room from each camera, as it is."],
  clip: ["Clip", "A short video of the empty room from each camera, as it is."],
  median: ["Median", "What the footage itself shows most of the time. Good where the person moves about."],
};
const MISSING = { plate: "Give a picture for every camera below.", clip: "Give a clip for every camera below." };
const FIRST = ["mask_threshold", "mask_gain_fit", "mask_shadow_test", "mask_shadow_darkest", "mask_shadow_colour", "mask_opening", "mask_closing", "mask_keep_components"];

export function mount(place, way) {
  const { fetchJson, post, remove, sessionPath } = way.api;
  const here = sessionPath(way.session);
  const state = { told: null, source: "", changed: {}, quality: null, gone: false, timer: 0, preview: 0, failed: null };
  const style = element("link", { rel: "stylesheet", href: "/assets/way_background.css" });
  document.head.append(style);

  const make = element("div", { className: "background-make" });
  const agreement = element("section", { className: "background-quality" });
  const cameras = element("section", { className: "background-quality", hidden: true });
  const knobs = element("details", { className: "background-knobs" });
  place.append(make, agreement, cameras, knobs);
  const alignment = alignmentBox(way, cameras, () => {
    state.quality = null;
    drawQuality();
    pictures.show();
    way.refresh().catch(complain);
  });
  const pictures = maskPictures(way, paint);

  async function ask() {
    state.told = await fetchJson(`${here}/background`);
    state.source ||= state.told.source === "masks" ? "" : defaultSource();
    return state.told;
  }

  function defaultSource() {
    const { told } = state;
    return told.cameras.length >= 3 && Object.keys(told.own).length === 0 ? "combined" : told.source;
  }

  // What backgrounds are made of.

  function choices() {
    const rows = Object.entries(SOURCES).map(([name, [label, words]]) => {
      const possible = state.told.possible.includes(name);
      const input = element("input", { type: "radio", name: "background-source", value: name, checked: name === state.source, disabled: !possible });
      input.onchange = () => { state.source = name; drawMake(); };
      const used = state.told.source === name && Object.keys(state.told.own).length > 0;
      return element("label", { className: "choice" }, input, element("span", {}, element("b", { textContent: label }), used && element("span", { className: "badge good", textContent: "in use" }),
        element("span", { className: "hint", textContent: possible ? words : MISSING[name] })));
    });
    return element("fieldset", { className: "choices" }, element("legend", { textContent: "Backgrounds are made of" }), ...rows);
  }

  function plates() {
    const many = element("input", { type: "file", multiple: true, accept: "image/*,video/*", ariaLabel: "Pictures or clips of the empty room" });
    many.onchange = () => give([...many.files], {});
    const rows = state.told.cameras.map((camera) => {
      const input = element("input", { type: "file", accept: "image/*,video/*", hidden: true });
      input.onchange = () => give([...input.files], { [camera.name]: input.files[0]?.name });
      const choose = button("Choose…", () => input.click(), "quiet small");
      choose.setAttribute("aria-label", `Choose the empty room of ${camera.name}`);
      return element("li", {}, element("span", { textContent: camera.name }), element("span", { className: "hint", textContent: camera.given ? `${camera.given === "clip" ? "clip" : "picture"} ${camera.file}` : "none" }), choose, input);
    });
    return element("details", { className: "plates", open: !state.told.cameras.some((camera) => camera.given) && state.told.cameras.length < 3 },
      element("summary", { textContent: `Pictures of the empty room: ${state.told.cameras.filter((camera) => camera.given).length} of ${state.told.cameras.length} cameras` }),
      element("label", {}, "One picture or clip per camera, matched by name", many), element("ul", { className: "plate-list" }, ...rows), element("p", { className: "hint upload-words", role: "status" }));
  }

  async function give(files, named) {
    if (!files.length) return;
    const words = make.querySelector(".upload-words");
    try {
      const upload = await uploadFiles(files, (text) => { words.textContent = text; });
      words.textContent = "Looking at them…";
      state.told = await post(`${here}/backgrounds`, { upload, files: named });
      state.failed = null;
      changedMasks();
    } catch (error) { state.failed = error; }
    drawMake();
    make.querySelector(".plates").open = true;
  }

  function drawMake() {
    const wasOpen = make.querySelector(".plates")?.open;
    const going = isGoing(state.told.job);
    const bar = element("div", { className: "going" });
    const trying = element("input", { type: "checkbox", checked: state.tune !== false });
    trying.onchange = () => { state.tune = trying.checked; };
    const unused = element("input", { type: "checkbox", checked: Boolean(state.unused) });
    unused.onchange = () => { state.unused = unused.checked; };
    const begin = button("Set up the background", setUp, "primary");
    begin.disabled = going || !state.source;
    make.replaceChildren(...[
      state.told.source === "masks" && element("p", { className: "notice", textContent: "Masks came with the footage and are used as they are. Set a background up only if they are not good." }),
      choices(), plates(),
      element("label", { className: "check", title: "Knobs under which the views agree best are chosen; those that you set below stay." }, trying, "try what makes the views agree best"),
      state.source === "combined" && element("label", { className: "check", title: "A bystander, a monitor, a window: what moves there is not the person." }, unused, "exclude what the person never comes near"),
      !going && element("div", { className: "step-actions" }, begin), bar,
      state.failed && element("p", { className: "wrong", role: "alert" }, state.failed.message, element("span", { className: "hint", textContent: ` ${state.failed.hint ?? ""}` })),
      ...(state.told.job?.notes ?? []).map((note) => element("p", { className: "hint", textContent: note })),
    ].filter(Boolean));
    if (wasOpen !== undefined) make.querySelector(".plates").open = wasOpen;
    if (going) drawGoing();
  }

  function drawGoing() {
    const { step, done, total, seconds_left: left } = state.told.job;
    const share = total ? done / total : null;
    const words = [step || "Reading the footage", total > 1 ? `${Math.round(100 * share)} %` : "", left > 2 ? `${duration(left)} left of this step` : ""].filter(Boolean).join(" · ");
    way.progress(make.querySelector(".going"), { words, share, cancel: () => remove(`${here}/background`).catch(complain) });
  }

  async function setUp() {
    state.failed = null;
    try {
      state.told.job = await post(`${here}/background`, { source: state.source, knobs: state.changed, tune: state.tune !== false, exclude_unused: Boolean(state.unused) && state.source === "combined" });
    } catch (error) { state.failed = error; }
    drawMake();
    follow();
  }

  /** Ask how the set-up stands until it ends. */
  async function follow() {
    clearTimeout(state.timer);
    if (state.gone || !isGoing(state.told.job)) return;
    state.timer = setTimeout(async () => {
      try { await ask(); } catch (error) { complain(error); }
      if (state.gone) return;
      const { job } = state.told;
      if (isGoing(job)) { drawGoing(); return follow(); }
      if (job?.state === "failed") state.failed = job;
      if (job?.state === "done") { state.quality = job.quality; state.changed = {}; changedMasks(); drawKnobs(); way.refresh().catch(complain); if (state.told.cameras.length > 1) alignment.measure(); }
      drawQuality();
      drawMake();
    }, POLL_MILLISECONDS);
  }

  // How far the views agree.

  function drawQuality() {
    const measure = button("Measure", async () => {
      agreement.querySelector(".hint").textContent = "Comparing the masks of five frames…";
      try { state.quality = await post(`${here}/masks/quality`); way.refresh().catch(complain); } catch (error) { complain(error); }
      drawQuality();
    }, "small");
    measure.hidden = state.told.cameras.length < 2;
    agreement.replaceChildren(element("div", { className: "head-line" }, element("h2", { textContent: "Agreement of the views" }), measure), ...qualityList(state.quality, paint, state.told.measured));
    pictures.tell(state.quality);
  }

  // Knobs with a live preview.

  const inUse = (knob) => state.changed[knob.name] ?? state.told.settings[knob.name];

  function knobRow(knob) {
    const value = inUse(knob);
    const shown = element("output", { textContent: words(knob, value) });
    let input;
    const take = (wanted) => {
      if (wanted === state.told.settings[knob.name]) delete state.changed[knob.name]; else state.changed[knob.name] = wanted;
      shown.textContent = words(knob, wanted);
      row.classList.toggle("changed", knob.name in state.changed);
      keep.hidden = reset.hidden = !Object.keys(state.changed).length;
      clearTimeout(state.preview);
      state.preview = setTimeout(() => pictures.preview(state.changed), PREVIEW_MILLISECONDS);
    };
    if (knob.kind === "bool") {
      input = element("input", { type: "checkbox", checked: value });
      input.onchange = () => take(input.checked);
    } else if (knob.choices.length) {
      input = element("select", {}, ...knob.choices.map((choice) => new Option(choice, choice, false, choice === value)));
      input.onchange = () => take(input.value);
    } else {
      const high = knob.high > 5000 ? 5000 : knob.high;
      input = element("input", { type: "range", min: knob.low, max: high, step: knob.step || (knob.kind === "int" ? 1 : "any"), value });
      input.oninput = () => take(Number(input.value));
    }
    input.setAttribute("aria-label", knob.label);
    const row = element("label", { className: knob.name in state.changed ? "knob changed" : "knob", title: knob.help }, element("span", { textContent: knob.label }), input, knob.kind === "bool" || knob.choices.length ? null : shown);
    return row;
  }

  const words = (knob, value) => `${typeof value === "number" ? Number(value.toPrecision(3)) : ""} ${knob.unit}`;
  const keep = button("Keep", async () => {
    try {
      await way.api.put(`${here}/evidence`, { ...state.told.own, ...state.changed });
      state.changed = {};
      await ask();
      drawKnobs(); drawMake(); changedMasks();
      way.refresh().catch(complain);
    } catch (error) { complain(error); }
  }, "small");
  const reset = button("Reset", () => { state.changed = {}; drawKnobs(); pictures.preview({}); }, "quiet small");

  function drawKnobs() {
    const named = Object.fromEntries(state.told.knobs.map((knob) => [knob.name, knob]));
    const rest = state.told.knobs.filter((knob) => knob.name.startsWith("mask_") && !FIRST.includes(knob.name));
    keep.hidden = reset.hidden = !Object.keys(state.changed).length;
    knobs.replaceChildren(element("summary", { textContent: "Fine adjustment" }), element("p", { className: "hint", textContent: "The pictures follow; nothing is kept before you say so." }),
      ...FIRST.map((name) => knobRow(named[name])), element("details", {}, element("summary", { textContent: "More" }), ...rest.map(knobRow)),
      element("div", { className: "step-actions" }, keep, reset));
  }

  function changedMasks() { pictures.preview(state.changed); }

  /** Paint what does not count of a camera, over its picture. */
  function paint(camera) {
    const lens = way.detail.cameras.find((one) => one.name === camera);
    const { excluded } = state.told.cameras.find((one) => one.name === camera);
    brush(way, { ...lens, frame: pictures.frame, excluded }, async (saved) => {
      if (!saved) return pictures.show();
      state.quality = null;
      await ask().catch(complain);
      pictures.mark(state.told.cameras);
      pictures.show();
      drawQuality();
      way.refresh().catch(complain);
    });
  }

  ask().then(() => {
    if (state.gone) return;
    state.quality = state.told.job?.quality ?? null;
    pictures.begin(state.told);
    drawMake(); drawQuality(); drawKnobs();
    follow();
    alignment.ask().catch(complain);
  }).catch((error) => place.append(element("p", { className: "wrong", textContent: `${error.message} ${error.hint ?? ""}` })));

  return () => { state.gone = true; clearTimeout(state.timer); clearTimeout(state.preview); pictures.close(); alignment.stop(); style.remove(); };
}
