// Step Check: whether the motion fits the pictures, frame by frame; refining and smoothing; which
// track is exported.

import { fetchJson, post, remove, runPath } from "./api.js";
import {
  actions,
  button,
  drawProgress,
  element,
  failure,
  fill,
  hint,
  optional,
  percent,
  table,
} from "./elements.js";
import { followJob, progressOf } from "./jobs.js";
import { complain } from "./messages.js";
import { viewWall } from "./setup_views.js";

/** @import { Schemas } from "./api_types" */

const MOST_CHIPS = 24;
const GOOD = 0.85;
const GOING = {
  refine: "refining",
  smooth: "smoothing",
  check: "comparing",
  landmarks: "looking for joints",
};
const millimetres = (value) => (value === null ? "–" : `${value.toFixed(1)} mm`);

/** @param {HTMLElement} place @param {import("./setup.js").Setup} setup */
export function mount(place, setup) {
  const run = setup.detail.runs.find((one) => one.name === setup.step?.run) ?? setup.detail.runs[0];
  const here = runPath(setup.session, run.name);
  const found = element("section", { className: "footage-step" });
  const witness = element("section", { className: "footage-step" });
  const better = element("section", { className: "footage-step" });
  const going = optional();
  place.append(
    found,
    going,
    ...(setup.detail.body.by_height && setup.detail.cameras.length > 1 ? [witness] : []),
    better,
  );
  const wall = viewWall(setup);
  /** @type {Schemas["CheckAnswer"] | null} */
  let answer = null;
  /** @type {Schemas["TrackList"]["tracks"]} */
  let tracks = [];
  let job = null;
  let track = "";
  let shown = run.first; // the frame that is looked at
  let failed = null;
  /** @type {Schemas["LandmarksLine"] | null} */
  let seen = null; // how far the track lies from a network's joints
  let stopped = false;

  const picker = element("input", {
    type: "range",
    min: 0,
    max: 0,
    value: 0,
    ariaLabel: "Checked frame",
  });
  wall.tools.append(picker);
  picker.oninput = () => show(framesToSee()[Number(picker.value)]);

  const everyTenth = () =>
    Array.from(
      { length: Math.ceil(Math.max(run.tracked_to - run.first, 1) / 10) },
      (_, at) => run.first + 10 * at,
    );
  const framesToSee = () => answer?.check?.frames ?? everyTenth();

  function show(frame) {
    if (frame === undefined) return;
    shown = frame;
    const frames = framesToSee();
    picker.max = String(frames.length - 1);
    if (frames.includes(frame)) picker.value = String(frames.indexOf(frame));
    wall.show({ run: run.name, frame, track: track === "raw" ? "" : track, show: "outline" });
    const check = answer?.check;
    const row = check?.frames.indexOf(frame) ?? -1;
    for (const camera of setup.detail.cameras) {
      const view = row < 0 ? -1 : (check?.cameras.indexOf(camera.name) ?? -1);
      const inside = check && view >= 0 ? check.inside[row][view] : null;
      wall.note(
        camera.name,
        view < 0
          ? ""
          : `${percent(inside)} of the model in the mask, ${percent(check?.covered[row][view])} of the mask under the model`,
        inside !== null && inside < GOOD ? "bad" : "",
      );
    }
    markShown();
  }

  /** The chips and bars of the frame that is looked at. */
  function markShown() {
    for (const chip of /** @type {NodeListOf<HTMLElement>} */ (
      found.querySelectorAll("[data-frame]")
    ))
      chip.toggleAttribute("aria-current", Number(chip.dataset.frame) === shown);
  }

  /** The frame that is looked at, as long as there is something to see in it. */
  function showAgain() {
    const frames = framesToSee();
    const check = answer?.check;
    const named = check
      ? [
          ...check.lost,
          ...check.doubtful,
          ...check.turned,
          ...check.jumps.map((jump) => jump.frame),
          ...Object.values(check.lost_limbs).flat(),
        ]
      : [];
    show([...frames, ...named].includes(shown) ? shown : frames[0]);
  }

  /** Frames to be looked at by a click. entries: {frame, words, title}. */
  function chips(words, entries) {
    if (!entries.length) return null;
    const more =
      entries.length > MOST_CHIPS ? ` (the first ${MOST_CHIPS} of ${entries.length})` : "";
    return element(
      "div",
      {},
      hint(`${words}${more}:`),
      element(
        "div",
        { className: "chips" },
        entries.slice(0, MOST_CHIPS).map(({ frame, limb = "", title = "" }) => {
          const chip = button("", () => show(frame), "small quiet", { title, dataset: { frame } });
          chip.append(...(limb ? [element("b", {}, frame), ` ${limb}`] : [String(frame)]));
          return chip;
        }),
      ),
    );
  }

  const plain = (frames) => frames.map((frame) => ({ frame }));
  const jumpsOf = (check) =>
    check.jumps.map(({ frame, limb, mm, usual_mm: usual }) => ({
      frame,
      limb,
      title: `The ${limb} jumps into frame ${frame}: its markers bend by ${mm.toFixed(0)} mm from a straight course, usually by ${usual.toFixed(1)} mm.`,
    }));

  /** A bar a looked-at frame: how much of the model lies in the masks, over all cameras. */
  function strip(check) {
    return element(
      "div",
      {
        className: "share-strip",
        role: "group",
        ariaLabel: "Share of the model in the masks, by frame",
      },
      check.frames.map((frame, row) => {
        const shares = check.inside[row].filter((share) => share !== null);
        const mean = shares.length
          ? shares.reduce((sum, share) => sum + share, 0) / shares.length
          : 0;
        const words = `frame ${frame}: ${percent(mean)}`;
        return element(
          "button",
          {
            type: "button",
            className: mean < GOOD ? "poor" : "",
            title: words,
            ariaLabel: `${words} of the model in the masks`,
            dataset: { frame },
            onclick: () => show(frame),
          },
          element("i", { style: `height: ${Math.round(100 * mean)}%` }),
        );
      }),
    );
  }

  function verdict(check) {
    const seen = check.covered.flat().filter((share) => share !== null);
    const covered = seen.reduce((sum, share) => sum + share, 0) / seen.length;
    const parts = [
      check.good ? "The motion fits the pictures." : "Check the marked frames.",
      `${percent(check.inside_mean)} of the model lies in the masks${seen.length ? `, ${percent(covered)} of the masks under the model: where it is little, a limb is elsewhere` : ""}.`,
      check.turned.length
        ? `The body turns round suddenly ${check.turned.length} times: left and right may be exchanged.`
        : "No sudden turn: left and right were not exchanged.",
      check.jumps.length
        ? `A limb jumps ${check.jumps.length === 1 ? "once" : `${check.jumps.length} times`}: it was lost or taken for another.`
        : "",
      check.jitter_mm !== null ? `The markers jitter by ${check.jitter_mm.toFixed(1)} mm.` : "",
    ];
    return element("p", { className: check.good ? "" : "notice" }, parts.filter(Boolean).join(" "));
  }

  function drawFound() {
    const check = answer?.check;
    const measure = actions(
      button(
        check ? "Measure again" : "Check the motion",
        () => begin("check", { track }),
        check ? "quiet small" : "primary",
        { disabled: Boolean(job) },
      ),
    );
    if (!check)
      return fill(
        found,
        hint(
          `Track "${track}" of ${run.name}: every tenth frame is compared with the masks, in every view.`,
        ),
        measure,
      );
    fill(
      found,
      verdict(check),
      strip(check),
      chips("Too little of the model in the masks", plain(check.poor)),
      chips("Lost", plain(check.lost)),
      Object.entries(check.lost_limbs).map(([limb, frames]) =>
        chips(`The ${limb} is not where masks or pictures show it`, plain(frames)),
      ),
      chips("Doubtful", plain(check.doubtful)),
      chips("Sudden turns", plain(check.turned)),
      chips("Jumps", jumpsOf(check)),
      measure,
    );
    markShown();
  }

  function drawBetter() {
    const has = (name) => tracks.some((line) => line.name === name);
    const act = (verb, words, name) =>
      button(words, () => begin(verb, { replace: has(name) }), "small", { disabled: Boolean(job) });
    const truth = setup.detail.has_truth;
    fill(
      better,
      element("h2", {}, "Improve the track"),
      table(
        ["track", "jitter", ...(truth ? ["from truth"] : [])],
        tracks.map((line) => [
          element(
            "td",
            {},
            element(
              "label",
              { className: "check" },
              element("input", {
                type: "radio",
                name: "setup-track",
                value: line.name,
                checked: line.name === track,
                ariaLabel: `Show ${line.name}`,
                onchange: () => choose(line.name).catch(complain),
              }),
              line.name === "raw" ? "raw (as searched)" : line.name,
            ),
            Array.isArray(line.made_by.exchanged) && hint(line.made_by.exchanged.join("; ")),
            line.name === answer?.usual &&
              element(
                "span",
                {
                  className: "badge good",
                  title: "Step Export takes this one, unless you choose another.",
                },
                "for export",
              ),
          ),
          millimetres(line.jitter_mm),
          ...(truth ? [millimetres(line.mean_mm)] : []),
        ]),
      ),
      actions(
        act("refine", has("refined") ? "Refine again" : "Refine on the silhouettes", "refined"),
        act("smooth", has("smoothed") ? "Smooth again" : "Smooth in time", "smoothed"),
      ),
      hint(
        "Each is stored beside the tracked one. The smoothed one is exported if there is one, else the refined one, else the one with corrected sides.",
      ),
      failure(failed),
    );
  }

  /** Another witness than the masks, of people: joints that a network sees, triangulated. */
  function drawWitness() {
    const file =
      seen &&
      element(
        "a",
        { href: `${here}/exports/${encodeURIComponent(seen.file)}`, download: seen.file },
        seen.file,
      );
    fill(
      witness,
      element("h2", {}, "Another witness"),
      seen
        ? element(
            "p",
            {},
            `Track "${track}" lies ${millimetres(seen.mean_mm)} from a network's joints, ${millimetres(seen.without_offsets_mm)} without each joint's constant offset; all of them are seen in ${percent(seen.seen)} of the frames. `,
            file,
          )
        : hint(
            "A network that knows people, and nothing of this body or its search, sees shoulders, elbows, wrists, hips, knees and ankles in every view; coarse by some centimetres.",
          ),
      actions(
        button(
          seen ? "Look again" : "Compare with a network's joints",
          () => begin("landmarks", { track }),
          "small",
          { disabled: Boolean(job) },
        ),
      ),
    );
  }

  async function choose(name) {
    track = name;
    seen = null;
    answer = await fetchJson(`${here}/check?track=${encodeURIComponent(name)}`);
    draw();
    showAgain();
  }

  function draw() {
    drawFound();
    drawWitness();
    drawBetter();
    drawProgress(
      going,
      job &&
        progressOf(job, GOING[job.verb] || "working", () =>
          remove(`/api/track-jobs/${job.identifier}`).catch(complain),
        ),
    );
  }

  /**
   * Begin refining, smoothing or measuring, and follow it to its end; nothing else can be begun
   * meanwhile.
   * @param {"refine" | "smooth" | "check" | "landmarks"} verb
   */
  function begin(verb, request) {
    failed = null;
    job = { verb, state: "running" };
    draw();
    return carry(() => post(`${here}/${verb}`, request));
  }

  /**
   * Follow a job, and what follows from it: a track that was made is looked at, whether it is
   * better is the next question.
   */
  async function carry(begun) {
    try {
      for (let start = begun; start && !stopped; ) {
        job = await start();
        draw();
        const made = await follow();
        start = made ? () => post(`${here}/check`, { track: made }) : null;
      }
    } catch (error) {
      failed = error;
    }
    job = null;
    if (!stopped) draw();
  }

  /** Wait for the job's end; resolves with the name of the track that it made, "" for none. */
  async function follow() {
    let ended = null;
    try {
      ended = await followJob(
        `/api/track-jobs/${job.identifier}`,
        (state) => {
          job = state;
          draw();
        },
        () => stopped,
      );
    } catch (error) {
      failed = error;
    }
    if (stopped) return "";
    const made =
      ended?.state === "done" && !["check", "landmarks"].includes(ended.verb) ? ended.track : "";
    if (made) seen = null;
    if (ended?.landmarks) seen = ended.landmarks;
    await load(made || track);
    await setup.refresh();
    return made;
  }

  async function load(wanted = "") {
    const [checked, listed] = await Promise.all([
      wanted
        ? fetchJson(`${here}/check?track=${encodeURIComponent(wanted)}`)
        : fetchJson(`${here}/check`),
      fetchJson(`${here}/tracks`),
    ]);
    [answer, tracks, track] = [checked, listed.tracks, checked.track];
    const running = listed.running[0] ?? null;
    if (running && !job) {
      job = running;
      carry(() => running);
    }
    draw();
    showAgain();
  }

  load().catch(complain);
  return () => {
    stopped = true;
    wall.stop();
  };
}
