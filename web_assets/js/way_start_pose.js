// Step Start pose: found automatically with its confidence, checked in all views (left and right by colour), put right
// by hand in the scene or by a turn, made better by a short search.

import { button, element } from "./elements.js";
import { followJob, shareOf, withTimeLeft } from "./jobs.js";
import { complain } from "./messages.js";

const UNSURE = 0.75;
const PICTURE_HEIGHT = 360;
const REDRAW_MILLISECONDS = 250;
const percent = (share) => `${Math.round(100 * share)} %`;

export function mount(place, way) {
  const { fetchJson, post, put, remove, sessionPath } = way.api;
  const here = sessionPath(way.session);
  const last = Math.max(0, (way.detail.frame_count ?? 1) - 1);
  const state = {
    told: null, frame: Math.min(last, way.detail.start_pose_frame ?? 0), found: null, better: null,
    failed: null, editing: false, begun: false, going: false, gone: false, age: 0, timer: 0,
  };
  const steps = element("section", { className: "start-pose-make" });
  const progress = element("div", { className: "start-pose-progress" });
  const check = element("section", { className: "start-pose-check" });
  place.append(steps, progress, check);

  const shownPose = () => (state.told?.stored ? state.told.pose : null);

  /** Wait for a job of the background, its bar drawn meanwhile; what it found. */
  async function waited(path, begun, words) {
    const cancel = () => remove(`${path}/${begun.identifier}`).catch(complain);
    try {
      const ended = await followJob(`${path}/${begun.identifier}`, (told) => way.progress(progress, { words: withTimeLeft(told, words), share: shareOf(told), cancel }), () => state.gone);
      if (!ended) cancel();
      return ended?.state === "done" ? ended : null;
    } finally { way.progress(progress, null); }
  }

  /** Do something that takes a while; its error is shown in place. */
  async function during(work) {
    state.failed = null;
    state.going = true;
    draw();
    try { await work(); } catch (error) { state.failed = error; }
    state.going = false;
    if (state.gone) return;
    await ask();
    way.refresh().catch(complain);
  }

  const find = () => during(async () => {
    state.better = null;
    const begun = await post(`${here}/initialise`, { frame: state.frame, replace: true });
    state.found = (await waited("/api/initialisations", begun, "looking at the frame")) ?? state.found;
  });

  const refine = () => during(async () => {
    const begun = await post(`${here}/pose/refine`, { frame: state.frame, pose: state.told.pose });
    const better = await waited("/api/track-jobs", begun, "searching around the pose");
    if (!better) return;
    state.better = better;
    if (better.gain > 0) await keep(better.pose);
  });

  const keep = (pose) => put(`${here}/start-pose`, { pose, frame: state.frame });
  const exchange = (how) => during(async () => { await keep((await post(`${here}/pose/mirror`, { pose: state.told.pose, how })).pose); state.found = null; });

  async function edit() {
    state.failed = null;
    try {
      await way.scene({ frame: state.frame });
      await post("/api/scene/edit", { session: way.session, frame: state.frame });
      state.editing = true;
      state.begun = false;
    } catch (error) { state.failed = error; }
    draw();
  }

  async function leave(kept) {
    try {
      if (kept) {
        const edited = await fetchJson("/api/scene/edit");
        if (!edited.editing) throw Object.assign(new Error("The editing was ended in the scene."), { hint: "Edit by hand again." });
        await keep(edited.pose);
        state.found = null;
      }
      state.editing = false;
      await remove("/api/scene/edit");
    } catch (error) { state.failed = error; }
    await ask();
    way.refresh().catch(complain);
  }

  // The panel.

  function draw() {
    const stored = Boolean(state.told?.stored);
    const number = element("input", { type: "number", min: 0, max: last, step: 1, value: state.frame, ariaLabel: "Frame", disabled: state.going });
    number.onchange = () => {
      if (!number.checkValidity() || number.value === "") return;
      state.frame = Number(number.value);
      drawCheck();
      pictures();
    };
    const busy = state.going || state.editing;
    const automatic = button("Find it automatically", find, stored ? "" : "primary");
    const byHand = button("Edit by hand", edit);
    for (const one of [automatic, byHand]) one.disabled = busy;
    steps.replaceChildren(
      element("label", {}, "In frame", number),
      element("p", { className: "hint", textContent: "The frame in which tracking begins: the whole person in view, arms off the trunk if you can choose. Frames before it can be tracked backwards from it." }),
      ...(state.editing ? [editing()] : [element("div", { className: "step-actions" }, automatic, byHand)]),
      state.failed ? element("p", { className: "wrong", role: "alert" }, state.failed.message, element("span", { className: "hint", textContent: ` ${state.failed.hint ?? ""}` })) : "");
    drawCheck();
    if (!state.editing) pictures();
  }

  function drawCheck() {
    const shown = state.told?.stored && !state.editing;
    check.replaceChildren(...(shown ? [verdict(), ...mending(state.going)] : []));
  }

  const editing = () => element("div", { className: "step-place" },
    element("p", { textContent: "Drag the balls on the limbs: the body follows, its joints keep their limits. The rings turn it whole; the tab Pose has a slider for every angle, undo and a search from there." }),
    element("div", { className: "step-actions" }, button("Use this pose", () => leave(true), "primary"), button("Leave it as it was", () => leave(false), "quiet")));

  /** How sure the pose is, in words. */
  function verdict() {
    const words = [];
    if (state.found) words.push(`Found in frame ${state.found.frame}, confidence ${percent(state.found.confidence)}.`);
    if (state.better) words.push(state.better.gain > 0 && state.better.overlap !== null
      ? `Made better: overlap with the masks ${percent(state.better.overlap_before)} → ${percent(state.better.overlap)}.`
      : "The search found nothing better around it.");
    const unsure = state.found && state.found.confidence < UNSURE;
    const line = element("p", { className: unsure ? "notice" : "" , textContent: words.join(" ") || `The session has a start pose, of frame ${state.told.frame}.` });
    const doubt = unsure ? element("p", { className: "notice", textContent: "It may face the other way: look at left and right before you track." }) : "";
    return element("div", { className: "start-pose-verdict" }, line, doubt, state.found?.note ? element("p", { className: "hint", textContent: state.found.note }) : "");
  }

  function mending(busy) {
    if (state.frame !== state.told.frame) {
      const back = button(`Look at frame ${state.told.frame}`, () => { state.frame = state.told.frame; draw(); }, "small");
      const kept = `The start pose is of frame ${state.told.frame}, where tracking begins. To begin in frame ${state.frame}, find or edit it here.`;
      return [element("p", { className: "notice", textContent: kept }), element("div", { className: "step-actions" }, back)];
    }
    const swatch = (side) => element("i", { className: `side-swatch ${side}` });
    const line = element("p", { className: "side-check" }, swatch("left"), "the person's left, ", swatch("right"), "the person's right. Is it so in every picture?");
    const actions = [
      button("Yes, track from here", () => way.go("track"), "primary"),
      ...(state.told.has_sides ? [button("No: facing the other way", () => exchange("turned round")), button("Mirror", () => exchange("in place"))] : []),
      button("Refine from here", refine),
    ];
    for (const one of actions) one.disabled = busy;
    return [...(state.told.has_sides ? [element("h2", { textContent: "Left and right" }), line] : []), element("div", { className: "step-actions" }, ...actions)];
  }

  // The pictures of all views.

  function pictures() {
    clearTimeout(state.timer);
    state.timer = setTimeout(() => {
      if (state.gone || state.editing) return;
      const pose = shownPose() ? "&pose=start" : "";
      const views = (way.detail.cameras ?? []).map((camera) => {
        const image = element("img", { alt: `${camera.name}, frame ${state.frame}${pose ? ", start pose" : ""}`, loading: "lazy",
          src: `${here}/frames/${state.frame}/views/${encodeURIComponent(camera.name)}.jpg?show=outline&height=${PICTURE_HEIGHT}${pose}&age=${state.age}` });
        return element("figure", { className: "picture" }, image, element("figcaption", {}, element("b", { textContent: camera.name })));
      });
      way.aside.replaceChildren(element("div", { className: "pictures" }, ...views));
    }, REDRAW_MILLISECONDS);
  }

  async function ask() {
    try {
      const told = await fetchJson(`${here}/start-pose`);
      if (state.gone) return;
      state.told = told;
      state.age += 1;
      draw();
    } catch (error) { if (!state.gone) place.replaceChildren(element("p", { className: "wrong", textContent: error.message }), element("p", { className: "hint", textContent: error.hint ?? "" })); }
  }

  // The editor may be left in the scene itself.
  way.on("scene", (event) => {
    if (!state.editing) return;
    if (event.editing) state.begun = true;
    else if (state.begun) { state.editing = state.begun = false; ask(); }
  });
  ask();
  return () => {
    state.gone = true;
    clearTimeout(state.timer);
    if (state.editing) remove("/api/scene/edit").catch(() => {});
  };
}
