// One comparison: how far it is, or what came of it: table, error curves, sign tests in words, settings.

import * as echarts from "../vendor/echarts.esm.min.js";
import { button, duration, element } from "./elements.js";
import { drawChart } from "./findings_charts.js";
import { seriesColour } from "./theme.js";

const BADGES = { running: "good", cancelling: "warn", queued: "calm", done: "calm", interrupted: "warn", cancelled: "calm", failed: "bad" };
const SIGNIFICANT = 0.05;

let disposals = [];

/** Take the charts of the comparison before away. */
export function clearComparison() {
  for (const dispose of disposals) dispose();
  disposals = [];
}

const millimetres = (value) => value.toFixed(1);
const swatch = (names, name) => element("i", { className: "swatch", style: `background: ${seriesColour(names.indexOf(name))}` });

/** The marks of a list: what it is doing. */
export const badge = (status) => element("span", { className: `badge ${BADGES[status] ?? "calm"}`, textContent: status });

/** Show a comparison in `content`. actions: {cancel, resume, again, remove}. */
export function showComparison(content, detail, actions) {
  clearComparison();
  const { comparison: line, result } = detail;
  const column = element("div", { className: "column findings" }, head(detail, actions), result ? null : progressBox(line, actions));
  if (result) column.append(...resultBoxes(detail));
  column.append(settingsBox(detail));
  content.replaceChildren(column);
}

/** What of a running comparison changes from second to second. */
export function updateProgress(content, line) {
  const bar = content.querySelector(".long-progress i");
  if (!bar) return;
  bar.style.width = `${line.total ? (100 * line.done) / line.total : 0}%`;
  content.querySelector(".progress-words").textContent = progressWords(line);
}

function head({ comparison: line, fps }, actions) {
  const facts = [`${line.evaluations} evaluations a frame`, `${line.seeds} ${line.seeds === 1 ? "seed" : "seeds"} each`, `frames ${line.first} to ${line.last - 1} at ${fps} per second`, line.created.slice(0, 16).replace("T", " ")];
  const path = `/api/comparisons/${encodeURIComponent(line.session)}/${encodeURIComponent(line.name)}`;
  const going = ["queued", "running", "cancelling"].includes(line.status);
  const download = (words, file) => { const link = element("a", { className: "download", href: `${path}/${file}`, textContent: words }); link.setAttribute("download", ""); return link; };
  return element("header", { className: "head" },
    element("div", {}, element("h1", {}, line.trackers.join(", "), " on ", line.session), element("p", { className: "lead" }, line.name, " · ", facts.join(" · "))),
    element("div", { className: "group" },
      line.status === "done" && download("JSON", "result.json"), line.status === "done" && download("CSV", "frames.csv"),
      button("Again…", actions.again), !going && button("Delete…", actions.remove, "quiet")));
}

function progressWords(line) {
  if (line.status === "cancelling") return "Cancelling; what is measured stays.";
  const left = line.seconds_left === null ? (line.done ? "" : ", the first ones read the footage") : `, about ${duration(line.seconds_left)} left`;
  return `${line.done} of ${line.total} trials${left}${line.step ? ` · last: ${line.step}` : ""}`;
}

function progressBox(line, actions) {
  const going = ["queued", "running", "cancelling"].includes(line.status);
  const words = {
    interrupted: "The studio ended before the comparison did. What is measured is kept.",
    cancelled: "Cancelled. What is measured is kept, and it can go on.", failed: line.problem,
  };
  const bar = element("div", { className: "long-progress" }, element("i", { style: `width: ${line.total ? (100 * line.done) / line.total : 0}%` }));
  return element("section", { className: "card-box" },
    element("div", { className: "form-foot" }, badge(line.status), element("span", { className: "progress-words", textContent: going ? progressWords(line) : words[line.status] ?? "" }),
      element("span", { className: "spring" }), line.status === "running" && button("Cancel", actions.cancel), !going && button("Go on", actions.resume, "primary")),
    bar, !going && element("p", { className: "hint", textContent: `${line.done} of ${line.total} trials are done.` }));
}

function resultBoxes(detail) {
  const { result } = detail;
  const [curves, seeds] = result.findings.charts;
  return [
    element("section", { className: "card-box" }, element("div", { className: "scrolls" }, table(detail))),
    element("section", { className: "card-box" }, drawn(curves)),
    element("section", { className: "pair" }, element("div", { className: "card-box" }, element("h2", { textContent: "Who is nearer" }), tests(result)),
      element("div", { className: "card-box" }, drawn(seeds))),
  ];
}

function drawn(chart) {
  const figure = element("figure", {});
  disposals.push(drawChart(figure, chart, echarts));
  return figure;
}

function table({ result }) {
  const names = result.trackers.map((one) => one.tracker);
  const best = Math.min(...result.trackers.map((one) => one.mean_mm));
  const measured = result.per_frame.frames.length;
  const moved = Math.max(1, measured - 1);
  const cell = (content, className = "") => element("td", { className }, content);
  const rows = result.trackers.map((one, at) => {
    const { low, high } = result.findings.numbers[at];
    const clean = one.seeds.filter((seed) => seed.lost_frames === 0).length;
    const interval = low !== null && low !== high ? element("small", {}, ` [${millimetres(low)}, ${millimetres(high)}]`) : "";
    return element("tr", {}, element("td", {}, swatch(names, one.tracker), one.tracker),
      element("td", { className: one.mean_mm === best ? "chief" : "" }, millimetres(one.mean_mm), element("small", {}, " mm"), interval),
      cell(`${millimetres(one.worst_mm)} mm`), cell(`${one.lost_frames} of ${measured * one.seeds.length}`), cell(`${clean} of ${one.seeds.length}`),
      cell(String(one.evaluations)), cell(`${((1000 * one.seconds) / one.seeds.length / moved).toPrecision(3)} ms`));
  });
  const heads = ["Tracker", "Mean error [95 % over seeds]", "Worst frame", "Frames with a limb lost", "Runs without loss", "Evaluations a frame", "Search a frame"];
  return element("table", { className: "figures" }, element("thead", {}, element("tr", {}, ...heads.map((one) => element("th", { textContent: one })))), element("tbody", {}, ...rows));
}

const probability = (p) => (p < 1e-4 ? "p < 0.0001" : `p = ${Number(p.toPrecision(2))}`);

const together = (words) => element("span", { className: "together", textContent: words });

/** The sign tests, a sentence a pair, and what they may not be taken for. */
function tests(result) {
  const names = result.trackers.map((one) => one.tracker);
  if (!result.sign_tests.length) return element("p", { className: "lead", textContent: "One tracker alone has nobody to be compared with." });
  const lines = result.sign_tests.map(({ first, second, frames, seeds }) => {
    const ahead = frames.better >= frames.worse;
    const [winner, other] = ahead ? [first, second] : [second, first];
    const [won, all] = [ahead ? frames.better : frames.worse, frames.better + frames.worse + frames.ties];
    const [seedsWon, seedsAll] = [ahead ? seeds.better : seeds.worse, seeds.better + seeds.worse + seeds.ties];
    const sure = seeds.p < SIGNIFICANT;
    return element("li", {}, swatch(names, winner), element("b", { textContent: winner }), " is nearer than ", element("b", { textContent: other }),
      ` in ${won} of ${all} frames `, together(`(${probability(frames.p)})`), ` and with ${seedsWon} of ${seedsAll} seeds `, together(`(${probability(seeds.p)}${sure ? ", significant" : ""}).`));
  });
  const least = 0.5 ** (result.seeds.length - 1);
  const few = least > SIGNIFICANT ? ` With ${result.seeds.length} ${result.seeds.length === 1 ? "seed" : "seeds"} the seeds' p cannot fall below ${Number(least.toPrecision(2))}; six or more can show a difference at 5 %.` : "";
  return element("ul", { className: "words" }, ...lines,
    element("li", { className: "caution", textContent: `Sign tests, two-sided. Frames that follow each other are alike, so the frames' p is smaller than it should be: it describes, it does not prove. Seeds are independent.${few}` }));
}

function settingsBox({ comparison: line, settings, body }) {
  const entries = line.trackers.flatMap((name) => {
    const { weighting, ...knobs } = settings[name];
    const words = Object.entries(knobs).map(([knob, value]) => `${knob} ${value}`).join(", ");
    return [element("dt", {}, swatch(line.trackers, name), name), element("dd", { textContent: `${weighting}${words ? `: ${words}` : ""}` })];
  });
  return element("section", { className: "card-box" }, element("h2", { textContent: "Settings" }),
    element("dl", { className: "settings-list" }, ...entries, element("dt", { textContent: "body" }), element("dd", { textContent: body || "the session's" })));
}
