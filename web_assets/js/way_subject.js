// Step Subject: which body, how tall, what follows from it; and the fit to the footage, with lengths before and after.

import { button, element } from "./elements.js";
import { followJob, isGoing, shareOf, withTimeLeft } from "./jobs.js";
import { complain } from "./messages.js";
import { drawStature } from "./way_stature.js";

const PREVIEW_MILLISECONDS = 150;
const USUAL_HEIGHT = 1750;
const LEAST_MM = 1000;
const MOST_MM = 2200;
const LEAST_METRES = 0.3;
const MOST_METRES = 3;
const PICTURE_HEIGHT = 300;

export function mount(place, way) {
  const { fetchJson, post, put, remove, sessionPath } = way.api;
  const here = sessionPath(way.session);
  const state = { told: null, bodies: [], body: "", height: null, fit: null, timer: 0, preview: 0, gone: false, failed: null, wish: { symmetric: true, lengths: true, radii: true, count: 5, frames: "", run: "" } };
  const style = element("link", { rel: "stylesheet", href: "/assets/way_background.css" });
  document.head.append(style);
  const who = element("section", { className: "subject-who background-make" });
  const fitting = element("section", { className: "subject-fit background-quality" });
  place.append(who, fitting);

  const changed = () => state.body !== state.told.body || state.height !== state.told.height_mm;

  // Who it is.

  function drawWho() {
    const body = element("select", {}, ...state.bodies.map((one) => new Option(`${one.label}`, one.name, false, one.name === state.body)));
    body.onchange = () => { state.body = body.value; look(); drawFit(); };
    const number = element("input", { type: "number", min: 30, max: 300, step: 0.5, value: state.height ? state.height / 10 : "", placeholder: "unknown", ariaLabel: "Height in centimetres" });
    const slider = element("input", { type: "range", min: LEAST_MM, max: MOST_MM, step: 5, value: state.height ?? USUAL_HEIGHT, ariaLabel: "Height" });
    const take = (height) => { state.height = height; look(); drawFit(); };
    // "1.80" is metres: nobody is that many centimetres tall.
    number.onchange = () => { if (Number(number.value) >= LEAST_METRES && Number(number.value) <= MOST_METRES) { number.value = Math.round(1000 * Number(number.value)) / 10; number.oninput(); } };
    number.oninput = () => { if (number.value === "" || !number.checkValidity()) return; take(Number(number.value) * 10); slider.value = state.height; };
    slider.oninput = () => { take(Number(slider.value)); number.value = state.height / 10; };
    who.replaceChildren(element("label", {}, "Body", body),
      element("label", {}, "Height (cm)", element("div", { className: "height-row" }, number, slider)),
      element("p", { className: "hint", textContent: `Every length follows from the height by published proportions. ${state.told.fitted ? "A height that is set again replaces what was fitted." : "A guess within 3 cm will do; the fit finds the rest."}` }),
      element("div", { className: "step-actions" }, saveHeight), state.failed ? wrong(state.failed) : "");
  }

  const wrong = (error) => element("p", { className: "wrong", role: "alert" }, error.message, element("span", { className: "hint", textContent: ` ${error.hint ?? ""}` }));

  const saveHeight = button("Set the height", async () => {
    state.failed = null;
    try {
      if (!state.height) throw Object.assign(new Error("The height is not known yet."), { hint: "Type it, or move the slider." });
      await put(`${here}/subject`, { height_mm: state.height, body: state.body });
      await ask();
      state.fit = null;
      way.refresh().catch(complain);
    } catch (error) { state.failed = error; }
    drawAll();
  });

  /** Draw the body as it would be. */
  function look() {
    clearTimeout(state.preview);
    state.preview = setTimeout(async () => {
      const wish = new URLSearchParams({ body: state.body });
      if (state.height) wish.set("height_mm", state.height);
      const asked = wish.toString();
      try {
        const told = changed() ? await fetchJson(`${here}/subject?${asked}`) : state.told;
        if (!state.gone && !state.fit?.limbs?.length) drawStature(way.aside, told, null, note(told));
      } catch (error) { complain(error); }
    }, PREVIEW_MILLISECONDS);
  }

  const note = (told) => (told === state.told ? (told.fitted ? "As it was fitted to the footage." : told.saved ? "By published proportions." : "Of usual size: nothing is known of the person yet.") : "As it would be.");

  // The fit.

  function drawFit() {
    saveHeight.classList.toggle("primary", !state.told.saved || changed());
    const { wish } = state;
    const going = isGoing(state.fit);
    const box = (name, label, title) => {
      const input = element("input", { type: "checkbox", checked: wish[name] });
      input.onchange = () => { wish[name] = input.checked; };
      return element("label", { className: "check", title }, input, label);
    };
    const count = element("input", { type: "number", min: 1, max: 24, value: wish.count });
    count.onchange = () => { wish.count = Number(count.value) || 5; };
    const frames = element("input", { type: "text", value: wish.frames, placeholder: "chosen for variety", pattern: "[0-9, ]*" });
    frames.onchange = () => { wish.frames = frames.value; };
    const runs = element("select", {}, new Option("the newest run's, else searched for", ""), ...way.detail.runs.filter((run) => run.done).map((run) => new Option(`of ${run.name}`, run.name, false, run.name === wish.run)));
    runs.onchange = () => { wish.run = runs.value; };
    const isReady = state.told.saved && !changed();
    const found = state.fit?.state === "done";
    const begin = button(found ? "Fit again" : "Fit the subject", beginFit, isReady && !(found && !state.fit.file) ? "primary" : "");
    begin.disabled = !isReady;
    fitting.replaceChildren(...[
      element("h2", { textContent: "Fit the subject to the footage" }),
      element("p", { className: "hint", textContent: isReady ? "Lengths and radii are found together with the poses of a few frames, on the silhouettes. Frames without a pose are searched first, which takes longest." : "Set the height first: it is the one measure that pictures cannot tell by themselves." }),
      element("div", { className: "step-row" }, element("label", {}, "How many frames", count), element("label", {}, "or these frames", frames)),
      element("label", {}, "First poses", runs),
      element("div", { className: "fit-boxes" }, box("symmetric", "left and right alike", "Off: each side has its own lengths, which needs more frames."), box("lengths", "lengths", "Of limbs"), box("radii", "radii", "Of limbs")),
      !going && element("div", { className: "step-actions" }, begin),
      element("div", { className: "going" }),
      state.fit?.state === "failed" && wrong(state.fit),
      found && results(),
    ].filter(Boolean));
    if (going) drawGoing();
  }

  async function beginFit() {
    const { wish } = state;
    const frames = wish.frames.split(/[,\s]+/).filter(Boolean).map(Number);
    try {
      if (frames.some((frame) => !Number.isInteger(frame))) throw Object.assign(new Error("Frames are whole numbers."), { hint: "Write them like 10, 40, 80." });
      state.fit = await post(`${here}/fit-subject`, { frames, count: wish.count, symmetric: wish.symmetric, lengths: wish.lengths, radii: wish.radii, run: wish.run || null, keep: false });
    } catch (error) { state.fit = { state: "failed", message: error.message, hint: error.hint }; }
    drawAll();
    follow();
  }

  function drawGoing() {
    const { identifier } = state.fit;
    way.progress(fitting.querySelector(".going"), { words: withTimeLeft(state.fit, "beginning"), share: shareOf(state.fit), cancel: () => remove(`/api/subject-fits/${identifier}`).catch(complain) });
  }

  async function follow() {
    if (!isGoing(state.fit)) return;
    try {
      state.fit = await followJob(`/api/subject-fits/${state.fit.identifier}`, (told) => { state.fit = told; drawGoing(); }, () => state.gone);
    } catch (error) { state.fit = { state: "failed", message: error.message, hint: error.hint }; }
    if (!state.gone) drawAll();
  }

  const words = (name) => name.replaceAll("_", " ").replace(/ (length|radius)$/, "");

  /** Each size before and after, and how far silhouettes overlap. */
  function results() {
    const { fit } = state;
    const table = (kind) => {
      const lines = fit.sizes.filter((line) => line.kind === kind);
      if (!lines.length) return null;
      const head = element("tr", {}, element("th", { textContent: kind === "length" ? "Length (mm)" : "Radius (mm)" }), element("th", { textContent: "before" }), element("th", { textContent: "after" }), element("th", { textContent: "±" }));
      return element("table", { className: "sizes" }, element("thead", {}, head), element("tbody", {}, ...lines.map((line) => element("tr", {}, element("td", { textContent: words(line.name) }),
        element("td", { textContent: Math.round(line.before) }), element("td", { className: "after", textContent: Math.round(line.after) }), element("td", { textContent: Math.max(1, Math.round(line.deviation)) })))));
    };
    const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
    const keep = button("Save as the subject", async () => {
      try {
        state.fit = await post(`/api/subject-fits/${fit.identifier}/keep`);
        await ask();
        way.refresh().catch(complain);
      } catch (error) { complain(error); }
      drawAll();
    }, "primary");
    const frames = fit.frames.length > 1 ? `frames ${fit.frames.slice(0, -1).join(", ")} and ${fit.frames.at(-1)}` : `frame ${fit.frames[0]}`;
    return element("div", { className: "background-quality" },
      element("p", { textContent: `The body covers ${Math.round(100 * mean(fit.overlap))} % of the silhouettes and they it (${Math.round(100 * mean(fit.overlap_before))} % before), in ${frames}; first poses ${fit.poses_from.startsWith("run") ? `of ${fit.poses_from}` : fit.poses_from}.` }),
      fit.file ? element("p", { className: "hint", textContent: "Saved. What was there before stays beside it as subject-before." }) : element("div", { className: "step-actions" }, keep),
      table("length"), table("radius"),
      element("p", { className: "hint", textContent: "± is one standard deviation: two limbs in three, about, lie within it. Wrists and shoulders show least." }));
  }

  /** The pictures of the fit: the new body over each frame, a camera each in turn. */
  function fitPictures() {
    const names = way.detail.cameras.map((camera) => camera.name);
    const made = state.fit.frames.map((frame, at) => {
      const camera = names[at % names.length];
      return element("figure", { className: "picture" }, element("img", { alt: `Frame ${frame}, ${camera}`, src: `/api/subject-fits/${state.fit.identifier}/frames/${frame}/views/${encodeURIComponent(camera)}.jpg?height=${PICTURE_HEIGHT}` }),
        element("figcaption", {}, element("span", {}, element("b", { textContent: `frame ${frame}` }), ` ${camera}, overlap ${Math.round(100 * state.fit.overlap[at])} %`)));
    });
    return element("div", { className: "pictures fitted" }, ...made);
  }

  function drawAll() {
    drawWho();
    drawFit();
    if (state.fit?.state === "done") {
      const before = Object.fromEntries(state.fit.sizes.map((line) => [line.name, line]));
      drawStature(way.aside, state.fit, { before: state.told.limbs, sizes: before }, state.fit.file ? "Fitted and saved. Dashed: by height alone." : "As fitted. Dashed: as it was before.");
      way.aside.append(fitPictures());
    } else look();
  }

  async function ask() {
    state.told = await fetchJson(`${here}/subject`);
    state.body = state.told.body;
    state.height = state.told.height_mm;
  }

  Promise.all([ask(), fetchJson("/api/choices").then((choices) => { state.bodies = choices.bodies; })]).then(() => {
    if (state.gone) return;
    if (!state.bodies.some((one) => one.name === state.body)) state.bodies.push({ name: state.body, label: state.body });
    drawAll();
  }).catch((error) => place.append(wrong(error)));

  return () => { state.gone = true; clearTimeout(state.preview); style.remove(); };
}
