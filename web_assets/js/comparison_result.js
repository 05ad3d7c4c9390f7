// One comparison: its progress, or its result: table, error curves, sign tests, settings.

import * as echarts from "../vendor/echarts.esm.min.js";
import {
  bar,
  button,
  card,
  dotted,
  duration,
  element,
  fill,
  hint,
  lead,
  optional,
  pageHead,
  spring,
  table,
} from "./elements.js";
import { drawChart } from "./findings_charts.js";
import { GOING } from "./jobs.js";
import { studioPath } from "./sessions.js";
import { showSweep } from "./sweep_result.js";
import { seriesColour } from "./theme.js";

/** @import { Schemas } from "./api_types" */

const BADGES = {
  queued: "calm",
  running: "good",
  cancelling: "warn",
  done: "calm",
  interrupted: "warn",
  cancelled: "calm",
  failed: "bad",
};
const SIGNIFICANT = 0.05;
const FAULTS =
  "The search's part goes with more evaluations; the likelihood's and the body's do not. Below zero: a heavier pose is known that is farther off.";

let disposals = [];

/** Take the charts of the comparison before away. */
export function clearComparison() {
  for (const dispose of disposals) dispose();
  disposals = [];
}

/** Whether a comparison is being computed. */
export const isGoing = (line) => GOING.includes(line?.status);

const millimetres = (value) => value.toFixed(1);
const seedWords = (count) => `${count} ${count === 1 ? "seed" : "seeds"}`;
const swatch = (names, name) =>
  element("i", { className: "swatch", style: `background: ${seriesColour(names.indexOf(name))}` });

/** The state of a comparison, as a badge. */
export const badge = (status) =>
  element("span", { className: `badge ${BADGES[status] ?? "calm"}` }, status);

/** How many poses and seeds a comparison takes. */
export const sizeWords = (line) =>
  isSweep(line)
    ? dotted(
        Object.entries(line.vary)
          .map(([name, values]) => `${name} × ${values.length}`)
          .join(", "),
        seedWords(line.seeds),
      )
    : comparedWords(line);
/** Whether it is a sweep of knobs. */
export const isSweep = (line) => Object.keys(line.vary ?? {}).length > 0;
const comparedWords = (line) =>
  dotted(`${line.trackers.length} trackers`, `${line.evaluations} poses`, seedWords(line.seeds));

/**
 * Show a comparison in `content`. actions: {cancel, resume, again, remove, look, show}.
 * @param {Schemas["ComparisonDetail"]} detail
 */
export function showComparison(content, detail, actions) {
  clearComparison();
  if (isSweep(detail.comparison)) {
    const place = element("div", { className: "column findings sweep" });
    fill(content, place);
    const shown = optional();
    if (detail.result) showSweep(shown, detail);
    fill(
      place,
      head(detail, actions),
      detail.result ? [...shown.children] : progressBox(detail.comparison, actions),
    );
    return;
  }
  fill(
    content,
    element(
      "div",
      { className: "column findings" },
      head(detail, actions),
      detail.result ? results(detail, actions) : progressBox(detail.comparison, actions),
      settingsBox(detail),
    ),
  );
}

/** What of a running comparison changes from second to second. */
export function updateProgress(content, line) {
  const shown = content.querySelector(".long-progress i");
  if (!shown) return;
  shown.style.width = `${100 * shareOf(line)}%`;
  content.querySelector(".progress-words").textContent = progressWords(line);
}

/** The share that is done. */
export const shareOf = (line) => line.done / Math.max(1, line.total);

function head({ comparison: line, fps }, actions) {
  const path = `/api/comparisons/${encodeURIComponent(line.session)}/${encodeURIComponent(line.name)}`;
  const download = (words, file) =>
    line.status === "done" &&
    element("a", { className: "download", href: `${path}/${file}`, download: "" }, words);
  return pageHead(
    `${isSweep(line) ? `Sweep of ${Object.keys(line.vary).join(", ")}` : line.trackers.join(", ")} on ${line.session}`,
    dotted(
      line.name,
      isSweep(line) ? `${line.total} runs` : `${line.evaluations} evaluations a frame`,
      `${seedWords(line.seeds)} each`,
      `frames ${line.first} to ${line.last - 1} at ${fps} per second`,
      line.created.slice(0, 16).replace("T", " "),
    ),
    element(
      "div",
      { className: "group" },
      download("JSON", "result.json"),
      download("CSV", "frames.csv"),
      button("Again…", actions.again),
      !isGoing(line) && button("Delete…", actions.remove, "quiet"),
    ),
  );
}

function progressWords(line) {
  if (line.status === "cancelling") return "Cancelling; finished trials stay.";
  const left =
    line.seconds_left === null
      ? line.done
        ? ""
        : ", the first ones read the footage"
      : `, about ${duration(line.seconds_left)} left`;
  return dotted(
    `${line.done} of ${line.total} ${isSweep(line) ? "runs" : "trials"}${left}`,
    line.step && `last: ${line.step}`,
  );
}

function progressBox(line, actions) {
  const going = isGoing(line);
  const words = {
    interrupted: "The studio ended before the comparison did. Finished trials are kept.",
    cancelled: "Cancelled. Finished trials are kept, and it can be resumed.",
    failed: line.problem,
  };
  return card(
    "",
    element(
      "div",
      { className: "form-foot" },
      badge(line.status),
      element(
        "span",
        { className: "progress-words" },
        going ? progressWords(line) : (words[line.status] ?? ""),
      ),
      spring(),
      going && line.status !== "cancelling" && button("Cancel", actions.cancel),
      !going && button("Resume", actions.resume, "primary"),
    ),
    bar(shareOf(line), "long-progress"),
    !going && hint(`${line.done} of ${line.total} trials are done.`),
  );
}

function results({ result, trials }, actions) {
  const [curves, seeds, faults] = result.findings.charts;
  const nearer = card("Which is nearer", signTests(result));
  const several = result.seeds.length > 1;
  const overFrames = (name, at) =>
    actions.show(
      trials.find(
        (trial) => name === (several ? `${trial.tracker}, seed ${trial.seed}` : trial.tracker),
      ),
      result.per_frame.frames[at],
    );
  const overSeeds = (name, at) =>
    actions.show(trials.find((trial) => name === trial.tracker && trial.seed === result.seeds[at]));
  return [
    card("", element("div", { className: "scrolls" }, figures(result))),
    card("", drawn(curves, overFrames)),
    element("section", { className: "pair" }, nearer, card("", drawn(seeds, overSeeds))),
    faults && card("", drawn(faults), hint(FAULTS)),
    trialsCard(trials, actions),
  ];
}

/**
 * Every trial, with its worst frame: the run of it, which is tracked again with the same settings
 * and seed where it is not stored.
 */
function trialsCard(trials, { session, look }) {
  const names = [...new Set(trials.map((trial) => trial.tracker))];
  const frameOf = (trial) =>
    trial.run
      ? element(
          "a",
          { href: studioPath(session, trial.run, { frame: trial.worst_frame, panel: "why" }) },
          `frame ${trial.worst_frame}`,
        )
      : button(`Track again, show frame ${trial.worst_frame}`, () => look(trial), "quiet small", {
          dataset: { trial: `${trial.tracker} ${trial.seed}` },
          ariaLabel: `Track ${trial.tracker} with seed ${trial.seed} again and show frame ${trial.worst_frame}`,
        });
  return card(
    "Trials",
    hint(
      "A trial keeps its errors only. Tracked again as a run of the session, with the same settings and seed, it can be looked into. A click on a curve or a bar above leads to its trial.",
    ),
    element(
      "div",
      { className: "scrolls" },
      table(
        [
          "Tracker",
          "Seed",
          "Mean error",
          "Worst frame",
          "Frames with a limb lost",
          "Look into its worst frame",
        ],
        trials.map((trial) => [
          element("td", {}, swatch(names, trial.tracker), trial.tracker),
          trial.seed,
          `${millimetres(trial.mean_mm)} mm`,
          `${millimetres(trial.worst_mm)} mm`,
          trial.lost_frames,
          element("td", { className: "look" }, frameOf(trial)),
        ]),
        "figures trials",
      ),
    ),
  );
}

function drawn(chart, choose) {
  const figure = element("figure", {});
  disposals.push(drawChart(figure, chart, echarts, choose));
  return figure;
}

function figures(result) {
  const names = result.trackers.map((one) => one.tracker);
  const best = Math.min(...result.trackers.map((one) => one.mean_mm));
  const measured = result.per_frame.frames.length;
  const moved = Math.max(1, measured - 1);
  const rows = result.trackers.map((one, at) => {
    const { low, high } = result.findings.numbers[at];
    const clean = one.seeds.filter((seed) => seed.lost_frames === 0).length;
    return [
      element("td", {}, swatch(names, one.tracker), one.tracker),
      element(
        "td",
        { className: one.mean_mm === best ? "chief" : "" },
        millimetres(one.mean_mm),
        element("small", {}, " mm"),
        low !== null &&
          low !== high &&
          element("small", {}, ` [${millimetres(low)}, ${millimetres(high)}]`),
      ),
      `${millimetres(one.worst_mm)} mm`,
      `${one.lost_frames} of ${measured * one.seeds.length}`,
      `${clean} of ${one.seeds.length}`,
      one.evaluations,
      `${((1000 * one.seconds) / one.seeds.length / moved).toPrecision(3)} ms`,
    ];
  });
  return table(
    [
      "Tracker",
      "Mean error [95 % over seeds]",
      "Worst frame",
      "Frames with a limb lost",
      "Runs without loss",
      "Evaluations a frame",
      "Search a frame",
    ],
    rows,
  );
}

const probability = (p) => (p < 1e-4 ? "p < 0.0001" : `p = ${Number(p.toPrecision(2))}`);
const together = (words) => element("span", { className: "together" }, words);

/** The sign tests, a sentence a pair, with their limits. */
function signTests(result) {
  const names = result.trackers.map((one) => one.tracker);
  if (!result.sign_tests.length) return lead("A single tracker has nothing to compare with.");
  const lines = result.sign_tests.map(({ first, second, frames, seeds }) => {
    const ahead = frames.better >= frames.worse;
    const [winner, other] = ahead ? [first, second] : [second, first];
    const won = ({ better, worse, ties }) => [ahead ? better : worse, better + worse + ties];
    const [[framesWon, framesAll], [seedsWon, seedsAll]] = [won(frames), won(seeds)];
    return element(
      "li",
      {},
      swatch(names, winner),
      element("b", {}, winner),
      " is nearer than ",
      element("b", {}, other),
      ` in ${framesWon} of ${framesAll} frames `,
      together(`(${probability(frames.p)})`),
      ` and with ${seedsWon} of ${seedsAll} seeds `,
      together(`(${probability(seeds.p)}${seeds.p < SIGNIFICANT ? ", significant" : ""}).`),
    );
  });
  const least = 0.5 ** (result.seeds.length - 1);
  const few =
    least > SIGNIFICANT
      ? ` With ${seedWords(result.seeds.length)} the seeds' p cannot fall below ${Number(least.toPrecision(2))}; six or more can show a difference at 5 %.`
      : "";
  return element(
    "ul",
    { className: "words" },
    lines,
    element(
      "li",
      { className: "caution" },
      `Sign tests, two-sided. Neighbouring frames are alike, so the frames' p is too small: it describes, it does not prove. Seeds are independent.${few}`,
    ),
  );
}

function settingsBox({ comparison: line, settings, body }) {
  const entries = line.trackers.map((name) => {
    const { weighting, ...knobs } = settings[name];
    const words = Object.entries(knobs)
      .map(([knob, value]) => `${knob} ${value}`)
      .join(", ");
    return [
      element("dt", {}, swatch(line.trackers, name), name),
      element("dd", {}, `${weighting}${words ? `: ${words}` : ""}`),
    ];
  });
  return card(
    "Settings",
    element(
      "dl",
      { className: "settings-list" },
      entries.flat(),
      element("dt", {}, "body"),
      element("dd", {}, body || "the session's"),
    ),
  );
}
