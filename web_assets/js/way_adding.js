// Footage taken into the session: uploaded from this browser, or from a folder of the studio's computer.

import { button, element } from "./elements.js";
import { CANCELLED, jobDone, shareOf, standing } from "./jobs.js";
import { complain } from "./messages.js";
import { uploadFiles } from "./uploading.js";

/** Draw the form in `place` (a details element); `done(told)` is called when footage was taken in. */
export function adder(place, way, done) {
  const { fetchJson, post, remove, sessionPath } = way.api;
  const state = { abort: null, identifier: "", stopped: false };
  const going = element("div", {});
  const wrong = element("p", { className: "wrong", role: "alert", hidden: true });
  const remedy = element("p", { className: "hint", hidden: true });
  const files = element("input", { type: "file", multiple: true, name: "files", accept: "video/*,image/*,.zip,.tar,.gz,.tgz,.bz2,.xz,.toml,.csv,.yml,.json" });
  const folder = element("input", { type: "file", multiple: true, name: "folder" });
  folder.setAttribute("webkitdirectory", "");
  const source = element("input", { type: "text", name: "source", placeholder: "full path" });
  const refer = element("input", { type: "checkbox", name: "refer" });
  const fps = element("input", { type: "number", name: "fps", min: 1, step: "any", placeholder: "as the files say" });
  const trial = element("input", { type: "text", name: "trial", placeholder: "the only one" });
  const replaced = element("input", { type: "checkbox", name: "replace" });
  const replaceLine = element("label", { className: "check", title: "Cameras that the new footage does not name are forgotten." }, replaced, "replace all cameras");
  const submit = button("Add footage", begin);
  const summary = element("summary", {});
  const elsewhere = element("p", { className: "hint" }, "Cameras that are connected now (USB, RTSP, MJPEG) are looked at and recorded under ", element("a", { href: "/recording", textContent: "Live cameras" }), ".");
  const folders = element("div", { className: "folder-list" });
  place.append(summary, element("div", { className: "footage-form" },
    element("label", {}, "Videos, one per camera (or a zip or tar of all)", files),
    element("label", {}, "or a folder: videos/, pictures, masks/, background/, calibration/; Pose2Sim, FreeMoCap, Caliscope, anipose and EasyMocap layouts too", folder),
    element("label", {}, "or a folder of the computer that the studio runs on", source), folders,
    element("label", { className: "check" }, refer, "refer to it where it lies instead of copying it"),
    element("div", { className: "step-row" }, element("label", {}, "Frames per second", fps), element("label", { title: "Where a folder holds several trials." }, "Trial", trial)),
    replaceLine, element("div", { className: "step-actions" }, submit), going, wrong, remedy, elsewhere));
  source.onfocus = () => browse(source.value).catch(() => folders.replaceChildren());

  /** Folders below the one that is typed, to be chosen by a click. */
  async function browse(path) {
    const told = await fetchJson(`/api/folders?path=${encodeURIComponent(path)}`);
    const go = (next) => { source.value = next; browse(next).catch(complain); };
    folders.replaceChildren(...(told.path && told.parent !== null ? [button("‹ up", () => go(told.parent), "quiet small")] : []),
      ...told.folders.slice(0, 60).map((name) => button(name, () => go(told.path ? `${told.path}/${name}` : name), "quiet small")));
  }

  function fail(error) {
    if (error.name === "AbortError" || error.code === CANCELLED) return;
    wrong.textContent = error.message;
    remedy.textContent = error.hint ?? "";
    wrong.hidden = false;
    remedy.hidden = !error.hint;
  }

  async function begin() {
    wrong.hidden = remedy.hidden = true;
    state.abort = new AbortController();
    const wish = { copy: !refer.checked, replace: replaced.checked, fps: fps.value ? Number(fps.value) : null, trial: trial.value.trim() || null };
    const chosen = files.files.length ? files.files : folder.files;
    try {
      if (chosen.length) wish.upload = await uploadFiles(chosen, (words, share) => way.progress(going, { words, share, cancel: () => state.abort.abort() }), state.abort.signal);
      else if (source.value.trim()) wish.source = source.value.trim();
      else throw Object.assign(new Error("Nothing is chosen."), { hint: "Choose the cameras' videos, or a folder." });
      const { identifier } = await post(`${sessionPath(way.session)}/footage`, wish);
      state.identifier = identifier;
      const told = await watchTaking(identifier);
      if (told) { files.value = folder.value = ""; place.open = false; await done(told); }
    } catch (error) { fail(error); }
    state.identifier = "";
    way.progress(going, null);
  }

  /** Wait until everything is read; null where the step was left meanwhile. */
  function watchTaking(identifier) {
    const cancel = () => remove(`/api/imports/${identifier}`).catch(complain);
    return jobDone(`/api/imports/${identifier}`, (told) => way.progress(going, { words: standing(told, "beginning"), share: shareOf(told), cancel }), () => state.stopped);
  }

  return {
    /** there: whether the session has footage; then the form is folded away. */
    draw(there) {
      summary.textContent = there ? "Add or replace footage" : "Your cameras' footage";
      place.open = !there || place.contains(document.activeElement);
      place.classList.toggle("alone", !there);
      submit.className = there ? "" : "primary";
      elsewhere.hidden = there;
      replaceLine.hidden = !there;
    },
    stop() { state.stopped = true; state.abort?.abort(); },
  };
}
