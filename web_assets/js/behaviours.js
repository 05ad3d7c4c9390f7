// The page of behaviour models: a list at the left; clusters as poses, who follows whom, entropies and a walk at the right.

import * as echarts from "../vendor/echarts.esm.min.js";
import { fetchJson } from "./api.js";
import { drawAutomaton } from "./behaviour_automaton.js";
import { walkCard } from "./behaviour_walk.js";
import { BodyDrawing } from "./body_drawing.js";
import { element } from "./elements.js";
import { drawChart } from "./findings_charts.js";
import { complain } from "./messages.js";
import { startTheme } from "./theme.js";

const FIRST_CLUSTERS = 12;
const NATS_A_BIT = Math.LN2;

const list = document.getElementById("entries");
const content = document.getElementById("content");

let models = [];
let open = "";
let closing = [];    // what the shown model has to let go of

const pathOf = (name) => `/api/behaviours/${encodeURIComponent(name)}`;
const bits = (nats) => (nats === null || nats === undefined ? "–" : `${(nats / NATS_A_BIT).toFixed(2)} bits`);
const percent = (share) => `${(100 * share).toFixed(share < 0.1 ? 1 : 0)} %`;

function nothing() {
  list.replaceChildren(element("p", { className: "empty", textContent: "No model yet." }));
  content.replaceChildren(element("div", { className: "nothing" },
    element("h1", { textContent: "No behaviour learnt yet" }),
    element("p", { textContent: "A behaviour model says what a body tends to do: clusters of elementary movements, and an automaton that orders them. It is learnt from recorded motion (AMC, BVH, C3D) or from earlier runs, and guides every tracker." }),
    element("code", { textContent: "studio learn FILES... --body human25 --into dance" }),
    element("p", { textContent: "What was learnt is shown here." })));
}

function entryOf(model) {
  const row = element("button", { type: "button", className: "entry" },
    element("span", { className: "name", textContent: model.name }),
    element("span", { className: "mark", textContent: model.problem ? "unreadable" : model.body }),
    element("span", { className: "facts", textContent: model.problem || `${model.clusters} clusters · ${model.states} states · ${model.frames} frames` }));
  if (model.name === open) row.setAttribute("aria-current", "true");
  row.title = model.problem;
  row.onclick = () => show(model.name).catch(complain);
  return row;
}

async function show(name) {
  open = name;
  list.replaceChildren(...models.map(entryOf));
  history.replaceState(null, "", `?name=${encodeURIComponent(name)}`);
  document.title = `${name} · Behaviours`;
  for (const close of closing) close();
  closing = [];
  content.replaceChildren(element("div", { className: "column" }, element("p", { className: "lead", textContent: "Reading…" })));
  const told = await fetchJson(pathOf(name));
  if (open !== name) return;
  const entropies = element("figure", { className: "entropies" }, element("p", { className: "lead", textContent: "Learning again with other memories…" }));
  const automaton = element("div", { className: "drawing", role: "img", ariaLabel: "Which cluster follows which" });
  const cards = clusterCards(told);
  const walk = walkCard(pathOf(name), told);
  closing.push(walk.close);
  content.replaceChildren(element("div", { className: "column" },
    heading(told.model), numbers(told),
    element("section", { className: "card-box" }, element("h2", { textContent: "Elementary movements" }),
      element("p", { className: "lead", textContent: `The frame that each cluster's Gaussian finds most likely, most frequent first, with its share of the time and how long it is stayed in. Arrows: where hands, feet and head go in ${told.arrow_seconds} s at the cluster's mean change. Drag a body to turn all of them.` }),
      cards.grid, cards.more),
    walk.box,
    element("div", { className: "pair" },
      element("section", { className: "card-box" }, element("h2", { textContent: "What follows what" }),
        element("p", { className: "lead", textContent: "One dot a cluster, as large as it is frequent; a line as strong as the transition is probable once the cluster is left. Choose a dot to see its pose." }), automaton),
      element("section", { className: "card-box" }, element("h2", { textContent: "Memory and entropy" }),
        element("p", { className: "lead", textContent: "The automaton learnt again from four fifths of the recordings, and how many bits a frame it needs to say them and the rest. A memory is long enough where the lines end falling, too long where that of the test rises." }), entropies, lengths(told)))));
  closing.push(drawAutomaton(automaton, told, echarts, (cluster) => cards.choose(cluster)), cards.close);
  await drawEntropies(entropies, name);
}

function heading(model) {
  return element("div", { className: "head" }, element("div", {},
    element("h1", { textContent: model.name }),
    element("p", { className: "lead", textContent: `body ${model.body} · ${model.frames} frames at ${model.fps} a second · ${sourcesOf(model)}` })));
}

function sourcesOf({ sources }) {
  const shown = sources.slice(0, 4).join(", ");
  return sources.length > 4 ? `${shown} and ${sources.length - 4} more` : shown || "sources not named";
}

function numbers({ model, context_lengths: lengths }) {
  const facts = [["clusters", model.clusters], ["states", model.states], ["memory", `${model.memory} frames`], ["longest history", `${lengths.length - 1} frames`],
    ["entropy, training", bits(model.entropy_train)], ["entropy, test", bits(model.entropy_test)]];
  return element("dl", { className: "facts-row" }, ...facts.map(([name, value]) => element("div", {}, element("dt", { textContent: name }), element("dd", { textContent: value }))));
}

function clusterCards(told) {
  const drawings = new Map();
  const points = told.clusters.flatMap((cluster) => cluster.limbs);
  const grid = element("div", { className: "poses" });
  const card = (cluster) => {
    const canvas = element("canvas", { role: "img", ariaLabel: `Cluster ${cluster.cluster}` });
    const made = element("figure", { className: "pose", title: cluster.source && `${cluster.source}, frame ${cluster.frame}` }, canvas,
      element("figcaption", {}, element("b", { textContent: cluster.cluster }), ` ${percent(cluster.share)} · ${cluster.stays.toFixed(cluster.stays < 10 ? 1 : 0)} frames`));
    made.dataset.cluster = cluster.cluster;
    const drawing = new BodyDrawing(canvas, told.limbs, points);
    drawing.show(cluster.limbs, cluster.arrows);
    drawings.set(cluster.cluster, drawing);
    return made;
  };
  const more = element("button", { type: "button", className: "quiet", textContent: `All ${told.clusters.length} clusters` });
  const showAll = () => {
    grid.append(...told.clusters.slice(grid.childElementCount).map(card));
    more.hidden = true;
  };
  grid.append(...told.clusters.slice(0, FIRST_CLUSTERS).map(card));
  more.hidden = told.clusters.length <= FIRST_CLUSTERS;
  more.onclick = showAll;
  return {
    grid, more,
    choose: (cluster) => {
      if (!drawings.has(cluster)) showAll();
      for (const one of grid.children) one.classList.toggle("chosen", one.dataset.cluster === String(cluster));
      grid.querySelector(".chosen")?.scrollIntoView({ block: "center", behavior: "smooth" });
    },
    close: () => { for (const drawing of drawings.values()) drawing.close(); },
  };
}

function lengths(told) {
  const words = told.context_lengths.map((count, length) => `${count} of ${length}`).filter((_, length) => told.context_lengths[length]);
  return element("p", { className: "lead", textContent: `States by the length of their history, frames: ${words.join(", ")}.` });
}

async function drawEntropies(figure, name) {
  const { lines } = await fetchJson(`${pathOf(name)}/entropies`);
  if (open !== name) return;
  const inBits = (values) => values.map((value) => value / NATS_A_BIT);
  const series = lines.flatMap((line) => [["train", line.train, true], ["test", line.test, false]].filter(([, values]) => values.length)
    .map(([kind, values, dashed]) => ({ name: `${kind}, ε ${Number(line.epsilon.toPrecision(2))}`, x: line.memory, y: inBits(values), group: `ε ${line.epsilon}`, dashed })));
  closing.push(drawChart(figure, { title: "Entropy over memory", kind: "lines", x: "memory (frames)", y: "entropy (bits a frame)", series }, echarts));
}

async function start() {
  startTheme();
  try {
    models = (await fetchJson("/api/behaviours")).models;
    if (!models.length) return nothing();
    const wanted = new URLSearchParams(location.search).get("name");
    const first = models.find((model) => model.name === wanted) ?? models.find((model) => !model.problem) ?? models[0];
    await show(first.name);
  } catch (error) { complain(error); }
}

start();
