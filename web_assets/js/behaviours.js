// The page of behaviour models: a list at the left; clusters as poses, transitions, entropies and a
// generated movement at the right.

import * as echarts from "../vendor/echarts.esm.min.js";
import { fault, fetchJson, patch, post, remove } from "./api.js";
import { drawAutomaton } from "./behaviour_automaton.js";
import {
  progressWords,
  showLearning,
  showLearningForm,
  updateLearning,
} from "./behaviour_learning.js";
import { walkCard } from "./behaviour_walk.js";
import { BodyDrawing } from "./body_drawing.js";
import { openForm } from "./studio/dialogs.js";
import {
  bar,
  button,
  byId,
  card,
  dotted,
  element,
  failure,
  fill,
  lead,
  NAME,
  nothing,
  pageHead,
} from "./elements.js";
import { drawChart } from "./findings_charts.js";
import { isGoing } from "./jobs.js";
import { askOnEach } from "./events.js";
import { complain, say } from "./messages.js";
import { paced } from "./pacing.js";
import { startTheme } from "./theme.js";

/** @import { Schemas } from "./api_types" */

const FIRST_CLUSTERS = 12;
const NATS_A_BIT = Math.LN2;
const PACE_MILLISECONDS = 300;

const content = byId("content");

let models = [];
let open = ""; // the model that is shown
let isNew = false; // whether the form, or what is being learnt, is shown
let learning = null; // how the model that is learnt, or was last, stands
let releases = []; // what the shown model has to release

/** @returns {`/api/behaviours/${string}`} */
const pathOf = (name) => `/api/behaviours/${encodeURIComponent(name)}`;
const bits = (nats) =>
  nats === null || nats === undefined ? "–" : `${(nats / NATS_A_BIT).toFixed(2)} bits`;
const percent = (share) => `${(100 * share).toFixed(share < 0.1 ? 1 : 0)} %`;
const column = (...children) => fill(content, element("div", { className: "column" }, ...children));

function drawList() {
  const running = isGoing(learning);
  const entry = (key, current, properties, name, mark, facts, ...more) => {
    const row = element(
      "button",
      { type: "button", className: "entry", dataset: { key }, ...properties },
      element("span", { className: "name" }, name),
      element("span", { className: "mark" }, mark),
      element("span", { className: "facts" }, facts),
      ...more,
    );
    if (current) row.ariaCurrent = "true";
    return row;
  };
  const rows = [
    running &&
      entry(
        "learning",
        isNew,
        { onclick: () => openNew().catch(complain) },
        learning.name,
        "learning",
        progressWords(learning),
        bar(learning.total ? learning.done / learning.total : 0),
      ),
    ...models.map((model) =>
      entry(
        `model ${model.name}`,
        model.name === open,
        { title: model.problem, onclick: () => show(model.name).catch(complain) },
        model.name,
        model.problem ? "unreadable" : model.body,
        model.problem ||
          dotted(`${model.clusters} clusters`, `${model.states} states`, `${model.frames} frames`),
      ),
    ),
  ].filter(Boolean);
  fill(byId("entries"), rows.length ? rows : element("p", { className: "empty" }, "No model yet."));
}

/**
 * Show a model's name or the form in the list, the title and the address; what was shown before is
 * released.
 */
function turnTo(name, title, query) {
  for (const release of releases) release();
  releases = [];
  open = name;
  isNew = query === "?new=";
  history.replaceState(null, "", query || location.pathname);
  document.title = title;
  drawList();
}

async function show(name) {
  turnTo(name, `${name} · Behaviours`, `?name=${encodeURIComponent(name)}`);
  column(lead("Reading…"));
  const known = models.find((model) => model.name === name);
  if (known?.problem) return column(heading(known), card("", failure({ message: known.problem })));
  const detail = await fetchJson(pathOf(name));
  if (open !== name) return;
  const entropies = element(
    "figure",
    { className: "entropies" },
    lead("Learning again with other memories…"),
  );
  if (detail.problem) {
    column(
      heading(detail.model),
      numbers(detail),
      card("", failure({ message: detail.problem })),
      entropyCard(entropies, detail),
    );
    return drawEntropies(entropies, name);
  }
  const automaton = element("div", {
    className: "drawing",
    role: "img",
    ariaLabel: "Transitions between clusters",
  });
  const cards = clusterCards(detail);
  const walk = walkCard(pathOf(name), detail);
  column(
    heading(detail.model),
    numbers(detail),
    card(
      "Elementary movements",
      lead(
        `The frame that each cluster's Gaussian finds most likely, most frequent first, with its share of the time and its mean duration. Arrows: where hands, feet and head go in ${detail.arrow_seconds} s at the cluster's mean change. Drag a body to turn all of them.`,
      ),
      cards.grid,
      cards.more,
    ),
    walk.box,
    element(
      "div",
      { className: "pair" },
      card(
        "Transitions",
        lead(
          "One dot for each cluster, its size by frequency; the stronger a line, the more probable the transition once the cluster is left. Choose a dot to see its pose.",
        ),
        automaton,
      ),
      entropyCard(entropies, detail),
    ),
  );
  releases.push(walk.close, drawAutomaton(automaton, detail, echarts, cards.choose), cards.close);
  await drawEntropies(entropies, name);
}

function entropyCard(figure, { context_lengths: lengths }) {
  const words = lengths
    .map((count, length) => `${count} of ${length}`)
    .filter((_, length) => lengths[length]);
  return card(
    "Memory and entropy",
    lead(
      "The automaton learnt again from four fifths of the recordings, and how many bits a frame it needs for them and for the rest. The memory is long enough where the lines stop falling, and too long where the test's rises.",
    ),
    figure,
    lead(`States by the length of their history, frames: ${words.join(", ")}.`),
  );
}

function heading(model) {
  const facts = model.problem
    ? "cannot be read"
    : dotted(
        `body ${model.body}`,
        `${model.frames} frames at ${model.fps} a second`,
        sourcesOf(model),
      );
  return pageHead(
    model.name,
    facts,
    element(
      "div",
      { className: "form-foot" },
      button("Rename…", () => renameForm(model.name)),
      button("Delete…", () => removeForm(model.name)),
    ),
  );
}

function renameForm(name) {
  openForm({
    heading: `Rename ${name}`,
    action: "Rename",
    intro: "Runs keep the copy of the model that they were made with.",
    rows: [[{ name: "name", label: "New name", value: name, ...NAME }]],
    send: async (values) => {
      if (values.name !== name) await patch(pathOf(name), { name: values.name });
      await refresh();
      show(values.name).catch(complain);
    },
  });
}

function removeForm(name) {
  openForm({
    heading: `Delete ${name}?`,
    action: "Delete",
    danger: true,
    rows: [],
    intro:
      "It goes to the trash of the studio, where it can be restored. Runs keep the copy that they were made with.",
    send: async () => {
      const { id } = await remove(pathOf(name));
      await refresh();
      await openFirst();
      say(`${name} is in the trash.`, {
        act: button("Restore", () => restore(id).catch(complain), "small"),
      });
    },
  });
}

async function restore(id) {
  const { model } = await post("/api/trash/restore", { entry: id });
  await refresh();
  await show(model);
}

function sourcesOf({ sources }) {
  const shown = sources.slice(0, 4).join(", ");
  return sources.length > 4
    ? `${shown} and ${sources.length - 4} more`
    : shown || "sources not named";
}

function numbers({ model, context_lengths: lengths }) {
  const facts = {
    clusters: model.clusters,
    states: model.states,
    memory: `${model.memory} frames`,
    "longest history": `${lengths.length - 1} frames`,
    "entropy, training": bits(model.entropy_train),
    "entropy, test": bits(model.entropy_test),
  };
  return element(
    "dl",
    { className: "facts-row" },
    Object.entries(facts).map(([name, value]) =>
      element("div", {}, element("dt", {}, name), element("dd", {}, value)),
    ),
  );
}

function clusterCards({ clusters, limbs }) {
  const drawings = new Map();
  const points = clusters.flatMap((cluster) => cluster.limbs);
  const grid = element("div", { className: "poses" });
  const pose = ({ cluster, share, stays, source, frame, limbs: own, arrows }) => {
    const canvas = element("canvas", { role: "img", ariaLabel: `Cluster ${cluster}` });
    const drawing = new BodyDrawing(canvas, limbs, points);
    drawing.show(own, arrows);
    drawings.set(cluster, drawing);
    return element(
      "figure",
      { className: "pose", title: source && `${source}, frame ${frame}`, dataset: { cluster } },
      canvas,
      element(
        "figcaption",
        {},
        element("b", {}, cluster),
        ` ${percent(share)} · ${stays.toFixed(stays < 10 ? 1 : 0)} frames`,
      ),
    );
  };
  const showAll = () => {
    grid.append(...clusters.slice(grid.childElementCount).map(pose));
    more.hidden = true;
  };
  const more = button(`All ${clusters.length} clusters`, showAll, "quiet", {
    hidden: clusters.length <= FIRST_CLUSTERS,
  });
  grid.append(...clusters.slice(0, FIRST_CLUSTERS).map(pose));
  return {
    grid,
    more,
    choose: (cluster) => {
      if (!drawings.has(cluster)) showAll();
      for (const one of /** @type {any} */ (grid.children))
        one.classList.toggle("chosen", one.dataset.cluster === String(cluster));
      grid.querySelector(".chosen")?.scrollIntoView({ block: "center", behavior: "smooth" });
    },
    close: () => {
      for (const drawing of drawings.values()) drawing.close();
    },
  };
}

async function drawEntropies(figure, name) {
  const { lines } = await fetchJson(`${pathOf(name)}/entropies`);
  if (open !== name) return;
  const series = lines.flatMap((line) =>
    [
      { kind: "train", values: line.train, dashed: true },
      { kind: "test", values: line.test, dashed: false },
    ]
      .filter(({ values }) => values.length)
      .map(({ kind, values, dashed }) => ({
        name: `${kind}, ε ${Number(line.epsilon.toPrecision(2))}`,
        x: line.memory,
        y: values.map((value) => value / NATS_A_BIT),
        group: `ε ${line.epsilon}`,
        dashed,
      })),
  );
  releases.push(
    drawChart(
      figure,
      {
        title: "Entropy over memory",
        kind: "lines",
        x: "memory (frames)",
        y: "entropy (bits a frame)",
        series,
      },
      echarts,
    ),
  );
}

async function refresh() {
  models = (await fetchJson("/api/behaviours")).models;
  drawList();
}

/** The form, or the progress of learning. */
async function openNew() {
  turnTo("", "Learn a behaviour · Capture studio", "?new=");
  const choices = await fetchJson("/api/learning");
  learning = choices.progress;
  if (isGoing(learning)) showProgress();
  else {
    const { sessions } = await fetchJson("/api/sessions");
    if (!isNew) return;
    showLearningForm(content, {
      choices,
      sessions,
      started: (progress) => {
        learning = progress;
        showProgress();
        drawList();
        look();
      },
    });
  }
  drawList();
}

function showProgress() {
  if (!updateLearning(content, learning))
    showLearning(content, learning, {
      cancel: () => remove("/api/learning").catch(complain),
      again: () => {
        learning = null;
        return openNew();
      },
    });
}

/**
 * Show how the learning stands; what was learnt opens, unless another model is being looked at.
 */
const look = paced(async () => {
  if (!isGoing(learning)) return;
  try {
    learning = (await fetchJson("/api/learning")).progress;
    if (learning?.learnt && learning.state === "done") {
      await refresh();
      say(
        `${learning.name} is learnt: ${learning.learnt.clusters} clusters, ${learning.learnt.states} states.`,
      );
      if (isNew) return await show(learning.name);
    } else if (isNew) showProgress();
    else if (learning?.state === "failed") complain(fault(learning.message, learning.hint));
    drawList();
  } catch (error) {
    complain(error);
  }
}, PACE_MILLISECONDS);

/** The first model that can be read, or the words that there is none. */
async function openFirst() {
  const first = models.find((model) => !model.problem) ?? models[0];
  if (first) return show(first.name);
  turnTo("", "Behaviours · Capture studio", "");
  fill(
    content,
    nothing(
      "No behaviour learnt yet",
      element(
        "p",
        {},
        "A behaviour model describes typical motion of a body: clusters of elementary movements, and an automaton for their order. It is learnt from recorded motion (AMC, BVH, C3D) or from earlier runs, and guides every tracker.",
      ),
      button("Learn one", () => openNew().catch(complain), "primary"),
      element("code", {}, "studio learn FILES... --body human25 --into dance"),
      element("p", {}, "Learnt models are shown here."),
    ),
  );
}

async function start() {
  startTheme();
  byId("new").onclick = () => openNew().catch(complain);
  try {
    learning = (await fetchJson("/api/learning")).progress;
    await refresh();
    askOnEach("learning", look);
    look();
    const query = new URLSearchParams(location.search);
    if (query.has("new")) return await openNew();
    const wanted = models.find((model) => model.name === query.get("name"));
    await (wanted ? show(wanted.name) : openFirst());
  } catch (error) {
    complain(error);
  }
}

start();
