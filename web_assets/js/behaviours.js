// The page of behaviour models: a list at the left; clusters as poses, who follows whom, entropies and a walk at the right.

import * as echarts from "../vendor/echarts.esm.min.js";
import { fetchJson, patch, post, remove } from "./api.js";
import { drawAutomaton } from "./behaviour_automaton.js";
import { learningChoices, progressWords, showLearning, showLearningForm, updateLearning } from "./behaviour_learning.js";
import { walkCard } from "./behaviour_walk.js";
import { BodyDrawing } from "./body_drawing.js";
import { openForm } from "./dialogs.js";
import { button, element } from "./elements.js";
import { drawChart } from "./findings_charts.js";
import { complain, say } from "./messages.js";
import { startTheme } from "./theme.js";
import { isGoing } from "./jobs.js";

const FIRST_CLUSTERS = 12;
const NATS_A_BIT = Math.LN2;
const POLL_MILLISECONDS = 700;
// What the address says instead of a model's name.
const NEW = Symbol("new");

const list = document.getElementById("entries");
const content = document.getElementById("content");

let models = [];
let open = "";       // a model's name, or NEW
let learning = null; // how the model that is learnt, or was last, stands
let timer = null;
let closing = [];    // what the shown model has to let go of

const pathOf = (name) => `/api/behaviours/${encodeURIComponent(name)}`;
const bits = (nats) => (nats === null || nats === undefined ? "–" : `${(nats / NATS_A_BIT).toFixed(2)} bits`);
const percent = (share) => `${(100 * share).toFixed(share < 0.1 ? 1 : 0)} %`;

function nothing() {
  content.replaceChildren(element("div", { className: "nothing" },
    element("h1", { textContent: "No behaviour learnt yet" }),
    element("p", { textContent: "A behaviour model says what a body tends to do: clusters of elementary movements, and an automaton that orders them. It is learnt from recorded motion (AMC, BVH, C3D) or from earlier runs, and guides every tracker." }),
    element("button", { type: "button", className: "primary", textContent: "Learn one", onclick: () => openNew().catch(complain) }),
    element("code", { textContent: "studio learn FILES... --body human25 --into dance" }),
    element("p", { textContent: "What was learnt is shown here." })));
}

function drawList() {
  const running = isGoing(learning);
  const rows = [...(running ? [learningEntry()] : []), ...models.map(entryOf)];
  list.replaceChildren(...(rows.length ? rows : [element("p", { className: "empty", textContent: "No model yet." })]));
}

/** The line of the model in the making. */
function learningEntry() {
  const row = element("button", { type: "button", className: "entry" },
    element("span", { className: "name", textContent: learning.name }), element("span", { className: "mark", textContent: "learning" }),
    element("span", { className: "facts", textContent: progressWords(learning) }),
    element("span", { className: "progress" }, element("i", { style: `width: ${learning.total ? (100 * learning.done) / learning.total : 0}%` })));
  if (open === NEW) row.setAttribute("aria-current", "true");
  row.onclick = () => openNew().catch(complain);
  return row;
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

function letGo() {
  for (const close of closing) close();
  closing = [];
}

async function show(name) {
  open = name;
  drawList();
  history.replaceState(null, "", `?name=${encodeURIComponent(name)}`);
  document.title = `${name} · Behaviours`;
  letGo();
  content.replaceChildren(element("div", { className: "column" }, element("p", { className: "lead", textContent: "Reading…" })));
  const known = models.find((model) => model.name === name);
  if (known?.problem) return content.replaceChildren(element("div", { className: "column" }, heading(known), sentence(known.problem)));
  const told = await fetchJson(pathOf(name));
  if (open !== name) return;
  if (told.problem) {
    const figure = element("figure", { className: "entropies" }, element("p", { className: "lead", textContent: "Learning again with other memories…" }));
    content.replaceChildren(element("div", { className: "column" }, heading(told.model), numbers(told), sentence(told.problem), entropyCard(figure, told)));
    return drawEntropies(figure, name);
  }
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
      entropyCard(entropies, told))));
  closing.push(drawAutomaton(automaton, told, echarts, (cluster) => cards.choose(cluster)), cards.close);
  await drawEntropies(entropies, name);
}

function entropyCard(figure, told) {
  return element("section", { className: "card-box" }, element("h2", { textContent: "Memory and entropy" }),
    element("p", { className: "lead", textContent: "The automaton learnt again from four fifths of the recordings, and how many bits a frame it needs to say them and the rest. A memory is long enough where the lines end falling, too long where that of the test rises." }), figure, lengths(told));
}

/** Why there is nothing to be seen. */
const sentence = (words) => element("section", { className: "card-box" }, element("p", { className: "wrong", textContent: words }));

function heading(model) {
  const facts = model.problem ? "it cannot be read" : `body ${model.body} · ${model.frames} frames at ${model.fps} a second · ${sourcesOf(model)}`;
  return element("div", { className: "head" }, element("div", {},
    element("h1", { textContent: model.name }), element("p", { className: "lead", textContent: facts })),
  element("div", { className: "form-foot" }, button("Rename…", () => askForName(model.name)), button("Delete…", () => askToRemove(model.name))));
}

function askForName(name) {
  openForm({
    heading: `Rename ${name}`, action: "Rename", intro: "Runs keep the copy of the model that they were made with.",
    rows: [[{ name: "name", label: "New name", value: name, required: true, pattern: "[A-Za-z0-9_\\-]{1,64}", title: "Letters, digits, - and _, up to 64" }]],
    send: async (values) => {
      if (values.name !== name) await patch(pathOf(name), { name: values.name });
      await refresh();
      show(values.name).catch(complain);
    },
  });
}

function askToRemove(name) {
  openForm({
    heading: `Delete ${name}?`, action: "Delete", danger: true, rows: [], intro: "It goes to the trash of the studio, where it can be restored. Runs keep the copy that they were made with.",
    send: async () => {
      const thrown = await remove(pathOf(name));
      await refresh();
      await openFirst();
      offerBack(thrown);
    },
  });
}

/** Say what was thrown away, with the way back. */
function offerBack(thrown) {
  say(`${thrown.name} is in the trash.`);
  const back = button("Restore", async () => {
    try {
      const { model } = await post("/api/trash/restore", { entry: thrown.id });
      await refresh();
      show(model).catch(complain);
    } catch (error) { complain(error); }
    toast.remove();
  }, "small");
  const toast = document.getElementById("toasts").lastChild;
  toast.append(back);
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

async function refresh() {
  models = (await fetchJson("/api/behaviours")).models;
  drawList();
}

/** The form, or how far what is being learnt is. */
async function openNew() {
  letGo();
  open = NEW;
  history.replaceState(null, "", "?new=");
  document.title = "Learn a behaviour · Capture studio";
  const choices = await learningChoices();
  learning = choices.progress;
  if (isGoing(learning)) showProgress();
  else await openLearningForm(choices);
  drawList();
}

async function openLearningForm(choices) {
  const { sessions } = await fetchJson("/api/sessions");
  if (open !== NEW) return;
  showLearningForm(content, { choices, sessions, started: (progress) => { learning = progress; showProgress(); drawList(); watchLearning(); } });
}

function showProgress() {
  if (updateLearning(content, learning)) return;
  showLearning(content, learning, {
    cancel: () => remove("/api/learning").catch(complain),
    again: () => { learning = null; return openNew(); },
  });
}

/** Ask how far it is while something is learnt; what was learnt opens, unless another model is being looked at. */
function watchLearning() {
  clearTimeout(timer);
  if (!isGoing(learning)) return;
  timer = setTimeout(async () => {
    try {
      learning = (await learningChoices()).progress;
      if (learning.state === "done") {
        await refresh();
        say(`${learning.name} is learnt: ${learning.learnt.clusters} clusters, ${learning.learnt.states} states.`);
        if (open === NEW) return await show(learning.name);
      } else if (open === NEW) showProgress();
      else if (learning.state === "failed") complain(Object.assign(new Error(learning.message), { hint: learning.hint }));
      drawList();
    } catch (error) { complain(error); }
    watchLearning();
  }, POLL_MILLISECONDS);
}

/** The first model that can be read, or the words that there is none. */
async function openFirst() {
  const first = models.find((model) => !model.problem) ?? models[0];
  if (first) return show(first.name);
  letGo();
  open = "";
  history.replaceState(null, "", location.pathname);
  nothing();
}

async function start() {
  startTheme();
  document.getElementById("new").onclick = () => openNew().catch(complain);
  try {
    learning = (await learningChoices()).progress;
    await refresh();
    watchLearning();
    const wish = new URLSearchParams(location.search);
    if (wish.has("new")) return await openNew();
    const wanted = models.find((model) => model.name === wish.get("name"));
    await (wanted ? show(wanted.name) : openFirst());
  } catch (error) { complain(error); }
}

start();
