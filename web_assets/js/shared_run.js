// A run as a page of its own, without the studio: the body moving, the views of its search, its
// settings.

import { BodyDrawing } from "./body_drawing.js";
import { button, byId, card, element, fill, hint } from "./elements.js";
import { Figure } from "./figure.js";
import { countedIn } from "./layer_axis.js";
import { layerColour, startTheme } from "./theme.js";
import { records } from "./view_sheet.js";
import { ANSWER_VIEWS } from "./views_answer.js";
import { SEARCH_VIEWS } from "./views_search.js";
import { drawLimbs } from "./why_drawing.js";

const NEAR = 1150; // mm around the body that are seen
const FLOOR = 500; // mm between lines of the floor
const MOST_FLOOR = 40;
const ZOOM = { step: 1.15, least: 0.3, most: 12 };
const SPEEDS = [0.25, 0.5, 1, 2];

/** What is chosen: the frame of the scene and of all figures, a limb, a parameter. */
const at = { frame: 0, layer: null, limb: null, parameter: null, particle: null, camera: null };

/** The ends of all limbs by frame: [frame][limb][end] = [x, y, z] mm. */
function unpacked({ ends, limbs, frames, offset, step }) {
  const values = new DataView(bytesOf(ends).buffer);
  let place = 0;
  const next = (axis) => {
    const value = values.getInt16(place, true);
    place += 2;
    return value * step + offset[axis];
  };
  const point = () => [next(0), next(1), next(2)];
  return frames.map(() => limbs.map(() => [point(), point()]));
}

const LAYER_RATES = [1, 3, 10];
const POINT = { least: 1.2, more: 2.2, faint: 0.25, glass: 0.22 };

const bytesOf = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

/**
 * The particles of a frame by layer: [{beta, of, particles: [{tips: [[x, y, z]], parent,
 * weight}]}].
 */
function unpackedCloud({ offset, step, tips, layers }) {
  return layers.map(({ points, parents, weights, beta, of }) => {
    const values = new DataView(bytesOf(points).buffer);
    const heavy = bytesOf(weights);
    let place = 0;
    const next = (axis) => {
      const value = values.getInt16(place, true);
      place += 2;
      return value * step + offset[axis];
    };
    const particles = parents.map((parent, at) => ({
      parent,
      weight: heavy[at] / 255,
      tips: Array.from({ length: tips }, () => [next(0), next(1), next(2)]),
    }));
    return { beta, of, particles };
  });
}

/**
 * Points of a layer, its particles so far on their way (phase 0 to 1) from their parents' places.
 */
function pointsOf(layers, index, phase) {
  const colour = layerColour(index, layers.length);
  const before = layers[index - 1]?.particles;
  return layers[index].particles.flatMap(({ tips, parent, weight }) => {
    const from = before?.[parent]?.tips ?? tips;
    return tips.map((tip, end) => ({
      at: tip.map((value, axis) => from[end][axis] + phase * (value - from[end][axis])),
      colour,
      radius: POINT.least + POINT.more * weight,
      alpha: POINT.faint + (1 - POINT.faint) * weight,
    }));
  });
}

/** Middle of all ends of a frame, mm. */
function middleOf(limbs) {
  const points = limbs.flat();
  return [0, 1, 2].map(
    (axis) => points.reduce((sum, point) => sum + point[axis], 0) / points.length,
  );
}

/** The floor about the places where the body goes, and the cameras. */
function surroundings(bodies, cameras) {
  const points = bodies.flat(2);
  const [low, high] = [0, 1].map((end) =>
    [0, 1].map((axis) => {
      const value = points.reduce(
        (far, point) => (end ? Math.max(far, point[axis]) : Math.min(far, point[axis])),
        end ? -Infinity : Infinity,
      );
      return FLOOR * (end ? Math.ceil(value / FLOOR) + 1 : Math.floor(value / FLOOR) - 1);
    }),
  );
  const size =
    FLOOR *
    Math.max(
      1,
      Math.ceil((high[0] - low[0]) / FLOOR / MOST_FLOOR),
      Math.ceil((high[1] - low[1]) / FLOOR / MOST_FLOOR),
    );
  const lines = [];
  for (let x = low[0]; x <= high[0]; x += size)
    lines.push([[x, low[1], 0], [x, high[1], 0], "line"]);
  for (let y = low[1]; y <= high[1]; y += size)
    lines.push([[low[0], y, 0], [high[0], y, 0], "line"]);
  for (const { centre, corners } of cameras) {
    for (const [index, corner] of corners.entries())
      lines.push(
        [centre, corner, "camera-frame"],
        [corner, corners[(index + 1) % 4], "camera-frame"],
      );
  }
  return lines;
}

/** The body in 3-D with its frames. choose: called with {frame}. */
function sceneBox(data, choose) {
  const { scene, fps } = data;
  const bodies = unpacked(scene);
  const canvas = element("canvas", {
    className: "shared-scene",
    ariaLabel:
      "The body in three dimensions: drag or arrow keys turn it, the wheel brings it nearer",
  });
  canvas.setAttribute("role", "img");
  const drawing = new BodyDrawing(
    canvas,
    scene.limbs,
    bodies.flat(),
    surroundings(bodies, scene.cameras),
  );
  const whole = { ...drawing.reach };
  let zoom = 1;
  let timer = 0;
  const follow = element("input", { type: "checkbox", checked: true, onchange: () => draw() });
  const slider = element("input", {
    type: "range",
    min: 0,
    max: scene.frames.length - 1,
    step: 1,
    value: 0,
    ariaLabel: "Frame",
    oninput: () => choose({ frame: scene.frames[Number(slider.value)] }),
  });
  const output = element("output", {});
  const speed = element(
    "select",
    { ariaLabel: "Speed" },
    SPEEDS.map((one) => new Option(`${one}×`, String(one), one === 1, one === 1)),
  );
  const play = button(
    "Play",
    () => {
      if (timer) stop();
      else start();
    },
    "small",
  );

  // The layers of the frames whose particles are in the page.
  const clouds = new Map(data.clouds.map((one) => [one.frame, unpackedCloud(one)]));
  const layersNow = () => clouds.get(scene.frames[Number(slider.value)]) ?? null;
  let [layer, phase, layerTimer] = [0, 1, 0];
  const layerPlay = button(
    "Pause layers",
    () => {
      if (layerTimer) stopLayers();
      else startLayers();
    },
    "small",
  );
  const layerSlider = element("input", {
    type: "range",
    min: 0,
    step: 1,
    value: 0,
    ariaLabel: "Layer",
    oninput: () => {
      stopLayers();
      layer = Number(layerSlider.value);
      draw();
    },
  });
  const layerRate = element(
    "select",
    { ariaLabel: "Layers a second" },
    LAYER_RATES.map(
      (one) =>
        new Option(`${one} layer${one === 1 ? "" : "s"}/s`, String(one), one === 3, one === 3),
    ),
  );
  const layerWords = element("output", {});
  const jumps = element(
    "span",
    { className: "group" },
    [...clouds.keys()].map((frame) =>
      button(
        `frame ${frame}`,
        () => {
          choose({ frame });
          startLayers();
        },
        "small",
      ),
    ),
  );
  const layerLine = element(
    "div",
    { className: "shared-transport shared-layers" },
    layerPlay,
    layerRate,
    layerSlider,
    layerWords,
    jumps,
  );

  function startLayers() {
    if (!layersNow()) return;
    stop();
    cancelAnimationFrame(layerTimer);
    layerPlay.textContent = "Pause layers";
    let last = performance.now();
    const step = (now) => {
      phase += ((now - last) / 1000) * Number(layerRate.value);
      last = now;
      if (phase >= 1) {
        phase %= 1;
        layer = (layer + 1) % (layersNow()?.length ?? 1);
      }
      draw();
      layerTimer = requestAnimationFrame(step);
    };
    layerTimer = requestAnimationFrame(step);
  }
  function stopLayers() {
    cancelAnimationFrame(layerTimer);
    [layerTimer, phase] = [0, 1];
    layerPlay.textContent = "Play layers";
  }

  function start() {
    stopLayers();
    play.textContent = "Pause";
    if (Number(slider.value) >= scene.frames.length - 1) slider.value = "0";
    let [last, place] = [performance.now(), Number(slider.value)];
    const step = (now) => {
      // Frames that the page left out take their time, too.
      place +=
        ((now - last) / 1000) *
        fps *
        Number(speed.value) *
        Math.min(1, scene.frames.length / (scene.frames.at(-1) - scene.frames[0] + 1));
      last = now;
      if (place >= scene.frames.length - 1) {
        show(scene.frames.length - 1);
        stop();
        return;
      }
      if (Math.floor(place) !== Number(slider.value)) show(Math.floor(place));
      timer = requestAnimationFrame(step);
    };
    timer = requestAnimationFrame(step);
  }
  function stop() {
    cancelAnimationFrame(timer);
    timer = 0;
    play.textContent = "Play";
    choose({ frame: scene.frames[Number(slider.value)] });
  }
  function show(index) {
    slider.value = String(index);
    draw();
  }
  function draw() {
    const limbs = bodies[Number(slider.value)];
    drawing.reach = follow.checked
      ? { middle: middleOf(limbs), radius: NEAR / zoom }
      : { middle: whole.middle, radius: whole.radius / zoom };
    output.textContent = `frame ${scene.frames[Number(slider.value)]}`;
    const layers = layersNow();
    if (!layers) stopLayers();
    for (const one of [layerPlay, layerRate, layerSlider]) one.disabled = !layers;
    if (layers) {
      layer = Math.min(layer, layers.length - 1);
      [layerSlider.max, layerSlider.value] = [String(layers.length - 1), String(layer)];
      const { of, beta, particles } = layers[layer];
      const some = particles.length < of ? `${particles.length} of ${of}` : String(of);
      layerWords.textContent = `layer ${layer + 1} of ${layers.length} · ${some} particles${beta === null ? "" : ` · β ${beta.toPrecision(3)}`}`;
      drawing.over(pointsOf(layers, layer, phase), POINT.glass);
    } else {
      layerWords.textContent = "this frame's particles are not in the page";
      drawing.over([]);
    }
    drawing.show(limbs);
  }

  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      zoom = Math.min(
        ZOOM.most,
        Math.max(ZOOM.least, zoom * ZOOM.step ** -Math.sign(event.deltaY)),
      );
      draw();
    },
    { passive: false },
  );
  return {
    box: element(
      "section",
      { className: "card-box shared-box" },
      canvas,
      element(
        "div",
        { className: "shared-transport" },
        play,
        speed,
        slider,
        output,
        element("label", { className: "check" }, follow, "follow the body"),
      ),
      layerLine,
    ),
    startLayers,
    /** Show a frame, or the nearest that the page has. */
    go(frame) {
      const nearest = scene.frames.reduce(
        (best, one, index) =>
          Math.abs(one - frame) < Math.abs(scene.frames[best] - frame) ? index : best,
        0,
      );
      show(nearest);
    },
  };
}

/** A figure's place and what draws it. */
function figureOf(data, entry, choose, place) {
  const tables = Object.fromEntries(entry.tables.map((table) => [table.name, records(table)]));
  const labels = new Map(data.parameters.map(({ name, label }) => [name, label]));
  const drawings = { ...SEARCH_VIEWS, ...ANSWER_VIEWS };
  const counted = countedIn(entry, 1);
  // Of the run's layers over the frames the page has one parameter.
  const own = entry.view === "variance" && entry.of === "run" ? { parameter: data.parameter } : {};
  const known = (room) => ({
    ...at,
    ...own,
    ...counted,
    over: entry.of === "run",
    layers: counted.searchLayers * counted.searches,
    label: (name) => labels.get(name) ?? name,
    room,
    tried: null,
    score: data.score,
  });
  const whyTables = Object.fromEntries(
    [...data.why.tables, ...entry.tables].map((table) => [table.name, records(table)]),
  );
  const draw =
    entry.view === "why"
      ? (sheet, room) =>
          drawLimbs(
            sheet,
            { limbs: [], nearest: [], ...whyTables },
            { ...at, ...countedIn(data.why, 1) },
            room,
          )
      : (sheet, room) => drawings[entry.view][entry.of](sheet, tables, known(room));
  const made = new Figure(place);
  const empty = !entry.tables.some((table) => table.rows.length);
  made.show(
    empty
      ? null
      : {
          name: `${data.session}-${data.run}-${entry.view}${entry.of === "run" ? "" : `-frame${data.frame}`}`,
          title: entry.title,
          question: entry.question,
          caption: entry.caption,
          notes: entry.notes,
          tables: entry.tables,
          choose,
          link: null,
          draw,
        },
    entry.notes.join(" ") || "There are no numbers for this view.",
  );
  return made;
}

function whyBox({ why }) {
  return card(
    `Why is frame ${why.frame} as it is?`,
    why.notes.map((note) => hint(note)),
    why.findings.length
      ? element(
          "ul",
          { className: "words" },
          why.findings.map((one) =>
            element("li", { className: one.is_cause ? "chief" : "" }, one.words),
          ),
        )
      : hint("Nothing stands out in this frame."),
    why.remedies.length > 0 && [
      element("h3", {}, "What may help"),
      element(
        "ul",
        { className: "words" },
        why.remedies.map((one) => element("li", {}, element("b", {}, one.title), ` ${one.words}`)),
      ),
    ],
  );
}

function settingsBox({ settings }) {
  const value = ({ value: own, unit }) => `${own}${unit ? ` ${unit}` : ""}`;
  const groups = Map.groupBy(settings, (one) => one.group);
  const rows = (own) =>
    own.map((one) =>
      element(
        "tr",
        { className: one.moved ? "moved" : "", title: one.help },
        element("th", { scope: "row" }, one.label, " ", element("code", {}, one.name)),
        element("td", {}, value(one)),
      ),
    );
  const moved = settings.filter((one) => one.moved);
  return element(
    "details",
    { className: "card-box", open: false },
    element(
      "summary",
      {},
      `Settings (${moved.length ? `not at their defaults: ${moved.map((one) => `${one.label} ${value(one)}`).join(", ")}` : "all at their defaults"})`,
    ),
    element(
      "div",
      { className: "shared-settings" },
      [...groups].map(([group, own]) =>
        element("table", {}, element("caption", {}, group), element("tbody", {}, rows(own))),
      ),
    ),
  );
}

/** Draw the page. */
export function showSharedRun(data) {
  startTheme();
  at.frame = data.frame;
  const places = data.figures.map((entry) =>
    element("section", {
      className: "figure sweep-figure shared-figure",
      dataset: { key: `${entry.view}-${entry.of}` },
    }),
  );
  /** @type {Figure[]} */
  let figures = [];
  const choose = (/** @type {Record<string, any>} */ changes) => {
    Object.assign(at, changes);
    if (changes.frame !== undefined) scene.go(changes.frame);
    for (const one of figures) one.refresh();
  };
  const scene = sceneBox(data, choose);
  fill(
    byId("heading"),
    element("h1", {}, `${data.session} / ${data.run}`),
    element("p", { className: "lead" }, data.caption),
    element("p", { className: "hint" }, data.made),
  );
  fill(
    byId("shared"),
    element(
      "div",
      { className: "shared-top" },
      scene.box,
      element(
        "div",
        { className: "shared-side" },
        card(
          "",
          element(
            "dl",
            { className: "settings-list" },
            data.facts.flatMap(([name, value]) => [
              element("dt", {}, name),
              element("dd", {}, value),
            ]),
          ),
        ),
        whyBox(data),
      ),
    ),
    data.notes.map((note) => hint(note)),
    ...places,
    settingsBox(data),
  );
  figures = data.figures.map((entry, index) => figureOf(data, entry, choose, places[index]));
  scene.go(data.frame);
  if (!matchMedia("(prefers-reduced-motion: reduce)").matches) scene.startLayers();
}
