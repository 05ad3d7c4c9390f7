// Step Check: whether the motion fits the pictures, frame by frame; refining and smoothing; which track is exported.

import { button, element } from "./elements.js";
import { followJob, shareOf, withTimeLeft } from "./jobs.js";
import { complain } from "./messages.js";
import { viewWall } from "./way_views.js";

const MOST_CHIPS = 24;
const GOOD = 0.85;
const percent = (share) => (share === null || share === undefined ? "–" : `${Math.round(100 * share)} %`);

export function mount(place, way) {
  const { fetchJson, post, remove, runPath } = way.api;
  const run = way.detail.runs[0];
  const here = runPath(way.session, run.name);
  const found = element("section", { className: "footage-step" });
  const better = element("section", { className: "footage-step" });
  const going = element("div", {});
  place.append(found, going, better);
  const wall = viewWall(way);
  const state = { told: null, tracks: [], job: null, track: "", frame: run.first, stopped: false, failed: null };

  const picker = element("input", { type: "range", min: 0, max: 0, value: 0, ariaLabel: "Looked-at frame" });
  wall.tools.append(picker);
  picker.oninput = () => { const frames = framesToSee(); show(frames[Number(picker.value)]); };

  const framesToSee = () => state.told?.check?.frames ?? every(10);
  function every(step) {
    const frames = [];
    for (let frame = run.first; frame < Math.max(run.tracked_to, run.first + 1); frame += step) frames.push(frame);
    return frames;
  }

  function show(frame) {
    if (frame === undefined) return;
    state.frame = frame;
    picker.max = framesToSee().length - 1;
    const at = framesToSee().indexOf(frame);
    if (at >= 0) picker.value = at;
    wall.show({ run: run.name, frame, track: state.track === "raw" ? "" : state.track, show: "outline" });
    const check = state.told?.check;
    for (const camera of way.detail.cameras) wall.note(camera.name, "");
    const row = check?.frames.indexOf(frame) ?? -1;
    check?.cameras.forEach((camera, view) => {
      const inside = row >= 0 ? check.inside[row][view] : null;
      wall.note(camera, row < 0 ? "" : `${percent(inside)} of the model in the mask, ${percent(check.covered[row][view])} of the mask under the model`, inside !== null && inside < GOOD ? "bad" : "");
    });
    markShown();
  }

  /** The chips and bars of the frame that is looked at. */
  function markShown() {
    for (const chip of found.querySelectorAll("[data-frame]")) chip.toggleAttribute("aria-current", Number(chip.dataset.frame) === state.frame);
  }

  /** The frame that is looked at, as long as there is something to see in it. */
  function showAgain() {
    const frames = framesToSee();
    const check = state.told?.check;
    const named = check ? [...check.lost, ...check.doubtful, ...check.turned, ...check.jumps.map((jump) => jump.frame), ...Object.values(check.lost_limbs).flat()] : [];
    show(frames.includes(state.frame) || named.includes(state.frame) ? state.frame : frames[0]);
  }

  function chips(words, frames) {
    if (!frames.length) return null;
    const made = frames.slice(0, MOST_CHIPS).map((frame) => {
      const chip = button(`${frame}`, () => show(frame), "small quiet");
      chip.dataset.frame = frame;
      return chip;
    });
    return element("div", {}, element("p", { className: "hint", textContent: `${words}${frames.length > MOST_CHIPS ? ` (the first ${MOST_CHIPS} of ${frames.length})` : ""}` }), element("div", { className: "chips" }, ...made));
  }

  /** Leaps by frame, each with its limb; the frame before is seen by ‹ in the studio's own window. */
  function jumpChips(jumps) {
    if (!jumps.length) return null;
    const made = jumps.slice(0, MOST_CHIPS).map((jump) => {
      const chip = button("", () => show(jump.frame), "small quiet");
      chip.append(element("b", { textContent: jump.frame }), ` ${jump.limb}`);
      chip.dataset.frame = jump.frame;
      chip.title = `The ${jump.limb} leaps into frame ${jump.frame}: its markers bend by ${jump.mm.toFixed(0)} mm from a straight course, usually by ${jump.usual_mm.toFixed(1)} mm.`;
      return chip;
    });
    return element("div", {}, element("p", { className: "hint", textContent: `Jumps${jumps.length > MOST_CHIPS ? ` (the first ${MOST_CHIPS} of ${jumps.length})` : ""}:` }), element("div", { className: "chips" }, ...made));
  }

  /** A bar a looked-at frame: how much of the model lies in the masks, over all cameras. */
  function strip(check) {
    const bars = check.frames.map((frame, row) => {
      const shares = check.inside[row].filter((share) => share !== null);
      const mean = shares.length ? shares.reduce((sum, share) => sum + share, 0) / shares.length : 0;
      const bar = element("button", { type: "button", className: mean < GOOD ? "poor" : "", title: `frame ${frame}: ${percent(mean)}`, ariaLabel: `frame ${frame}: ${percent(mean)} of the model in the masks` }, element("i", { style: `height: ${Math.round(100 * mean)}%` }));
      bar.dataset.frame = frame;
      bar.onclick = () => show(frame);
      return bar;
    });
    return element("div", { className: "share-strip", role: "group", ariaLabel: "Share of the model in the masks, by frame" }, ...bars);
  }

  function verdict(check) {
    const seen = check.covered.flat().filter((share) => share !== null);
    const covered = seen.reduce((sum, share) => sum + share, 0) / seen.length;
    const parts = [
      check.good ? "The motion fits the pictures." : "Look at the marked frames.",
      `${percent(check.inside_mean)} of the model lies in the masks${seen.length ? `, ${percent(covered)} of the masks under the model: where it is little, an arm or a leg is elsewhere` : ""}.`,
      check.turned.length ? `The body turns round suddenly ${check.turned.length} times: left and right may have changed places.` : "Left and right keep their places: no sudden turn.",
      check.jumps.length ? `A limb leaps ${check.jumps.length === 1 ? "once" : `${check.jumps.length} times`}: it was lost or taken for another.` : "",
      check.jitter_mm !== null ? `The markers jitter by ${check.jitter_mm.toFixed(1)} mm.` : "",
    ];
    return element("p", { className: check.good ? "" : "notice", textContent: parts.filter(Boolean).join(" ") });
  }

  function drawFound() {
    const check = state.told?.check;
    const measure = button(check ? "Measure again" : "Look at the motion", () => begin("check", { track: state.track }), check ? "quiet small" : "primary");
    measure.disabled = Boolean(state.job);
    if (!check) {
      return found.replaceChildren(element("p", { className: "hint", textContent: `Track "${state.track}" of ${run.name}: every tenth frame is compared with the masks, in every view.` }), element("div", { className: "step-actions" }, measure));
    }
    found.replaceChildren(...[verdict(check), strip(check), chips("Too little of the model in the masks:", check.poor), chips("Lost:", check.lost), ...Object.entries(check.lost_limbs).map(([limb, frames]) => chips(`The ${limb} is off the masks:`, frames)), chips("Doubtful:", check.doubtful), chips("Sudden turns:", check.turned), jumpChips(check.jumps), element("div", { className: "step-actions" }, measure)].filter(Boolean));
    markShown();
  }

  function trackRows() {
    const usual = state.told?.usual;
    return state.tracks.map((line) => {
      const radio = element("input", { type: "radio", name: "way-track", value: line.name, checked: line.name === state.track, ariaLabel: `Look at ${line.name}` });
      radio.onchange = () => choose(line.name).catch(complain);
      return element("tr", {}, element("td", {}, element("label", { className: "check" }, radio, line.name === "raw" ? "raw (as searched)" : line.name), line.made_by.exchanged ? element("p", { className: "hint", textContent: line.made_by.exchanged.join("; ") }) : "", line.name === usual ? element("span", { className: "badge good", textContent: "for export", title: "Step Export takes this one, unless you choose another." }) : ""),
        element("td", { textContent: line.jitter_mm === null ? "–" : `${line.jitter_mm.toFixed(1)} mm` }), ...(way.detail.has_truth ? [element("td", { textContent: line.mean_mm === null ? "–" : `${line.mean_mm.toFixed(1)} mm` })] : []));
    });
  }

  function drawBetter() {
    const has = (name) => state.tracks.some((line) => line.name === name);
    const act = (verb, words, name) => {
      const made = button(words, () => begin(verb, { replace: has(name) }), "small");
      made.disabled = Boolean(state.job);
      return made;
    };
    better.replaceChildren(...[
      element("h2", { textContent: "Make it better" }),
      element("table", { className: "figures" }, element("thead", {}, element("tr", {}, ...["track", "jitter", ...(way.detail.has_truth ? ["from truth"] : [])].map((head) => element("th", { textContent: head })))), element("tbody", {}, ...trackRows())),
      element("div", { className: "step-actions" }, act("refine", has("refined") ? "Refine again" : "Refine on the silhouettes", "refined"), act("smooth", has("smoothed") ? "Smooth again" : "Smooth in time", "smoothed")),
      element("p", { className: "hint", textContent: "Each is kept beside what the search found. The smoothed one is exported where there is one, else the refined one, else that with sides put right." }),
      state.failed && element("p", { className: "wrong", role: "alert" }, state.failed.message, element("span", { className: "hint", textContent: ` ${state.failed.hint ?? ""}` })),
    ].filter(Boolean));
  }

  async function choose(name) {
    state.track = name;
    state.told = await fetchJson(`${here}/check?track=${name}`);
    drawAll();
    showAgain();
  }

  function drawAll() {
    drawFound();
    drawBetter();
    const { job } = state;
    way.progress(going, job && {
      words: withTimeLeft(job, { refine: "refining", smooth: "smoothing", check: "comparing" }[job.verb] || "working"),
      share: shareOf(job), cancel: () => remove(`/api/track-jobs/${job.identifier}`).catch(complain),
    });
  }

  /** Begin refining, smoothing or measuring, and follow it to its end; nothing else can be begun meanwhile. */
  function begin(verb, wish) {
    state.failed = null;
    state.job = { verb, state: "running" };
    drawAll();
    return carry(() => post(`${here}/${verb}`, wish));
  }

  /** Follow a job, and what follows from it: a track that was made is looked at, whether it is better is the next question. */
  async function carry(begun) {
    try {
      for (let start = begun; start && !state.stopped;) {
        state.job = await start();
        drawAll();
        const made = await follow();
        start = made ? () => post(`${here}/check`, { track: made }) : null;
      }
    } catch (error) { state.failed = error; }
    state.job = null;
    if (!state.stopped) drawAll();
  }

  /** Wait for the job's end; resolves with the name of the track that it made, "" for none. */
  async function follow() {
    let ended = null;
    try {
      ended = await followJob(`/api/track-jobs/${state.job.identifier}`, (told) => { state.job = told; drawAll(); }, () => state.stopped);
    } catch (error) { state.failed = error; }
    if (state.stopped) return "";
    const made = ended?.state === "done" && ended.verb !== "check" ? ended.track : "";
    await load(made || state.track);
    await way.refresh();
    return made;
  }

  async function load(wanted = "") {
    const [told, tracks] = await Promise.all([fetchJson(`${here}/check${wanted ? `?track=${wanted}` : ""}`), fetchJson(`${here}/tracks`)]);
    Object.assign(state, { told, tracks: tracks.tracks, track: told.track });
    const running = tracks.running[0] ?? null;
    if (running && !state.job) { state.job = running; carry(() => running); }
    drawAll();
    showAgain();
  }

  load().catch(complain);
  return () => { state.stopped = true; wall.stop(); };
}
