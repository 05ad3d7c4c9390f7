// Live cameras: which, what they show now, how far apart their pictures come; record them, or track
// what they see.

import { fetchJson, post } from "./api.js";
import {
  button,
  byId,
  card,
  check,
  dotted,
  element,
  failure,
  field,
  fill,
  number,
  offer,
  pageHead,
  text,
} from "./elements.js";
import { isGoing } from "./jobs.js";
import { complain } from "./messages.js";
import { sessionWords, studioPath } from "./sessions.js";
import { startTheme } from "./theme.js";

const LOOK_MILLISECONDS = 1000;
const PICTURE_MILLISECONDS = 200;
const PREVIEW_HEIGHT = 270;
const EXAMPLES = "http://10.0.0.7:8080/video · rtsp://… · /dev/video0";
const STATES = { connecting: "calm", running: "good", stopped: "bad", ended: "calm" };

/** @typedef {import("./api_types").Schemas["CamerasStanding"]} View */
/** @type {View | null} */
let view = null;
let looking = 0;

const going = () => isGoing(view?.recording);
const plain = (value, digits = 1) =>
  value === null || value === undefined ? "–" : value.toFixed(digits);
const clock = (seconds) =>
  `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;

const rows = element("div", { className: "camera-rows" });
const open = button("Show cameras", show, "primary");
const grid = element("div", { className: "camera-grid" });
const spread = element("p", { className: "lead spread", role: "status" });
const outcome = element("div", { className: "recording-outcome" });
const session = element("select", {
  title: "The session whose calibration belongs to these cameras",
});
const name = text({ placeholder: "recording-1", maxLength: 64 });
const seconds = number("", { min: 1, max: 86400, placeholder: "until stopped" });
const track = check(
  "Track while recording",
  {},
  "With that session's person, empty room and start pose; the recording becomes a session in which the run can be tracked again bit for bit",
);
const record = button("Record", begin, "primary record");
const stop = button("Stop", () => post("/api/recordings/stop").catch(complain), "record");
const form = element(
  "div",
  { className: "recording-form" },
  field("Calibration of", session, { title: session.title }),
  field("Becomes session", name),
  field("Seconds", seconds),
  track,
  record,
  stop,
);

/** A row for a camera's name and address; a new empty one follows the last that is filled. */
function addRow() {
  const address = text({
    ariaLabel: "Address",
    placeholder: EXAMPLES,
    className: "camera-address",
    spellcheck: false,
    autocomplete: "off",
    oninput: () => {
      if (row === rows.lastElementChild && address.value) addRow();
    },
    onkeydown: (event) => {
      if (event.key === "Enter") open.click();
    },
  });
  const row = element(
    "div",
    { className: "camera-row" },
    text({
      ariaLabel: "Name in the calibration",
      placeholder: `cam${rows.children.length + 1}`,
      className: "camera-name",
      maxLength: 40,
    }),
    address,
    button(
      "×",
      () => {
        row.remove();
        if (!rows.children.length) addRow();
      },
      "icon quiet",
      { ariaLabel: "Remove this camera" },
    ),
  );
  rows.append(row);
}

/** What is written in the rows; addresses may hold passwords, so they are kept nowhere. */
const written = () =>
  [...rows.children]
    .map((line, index) => {
      const [own, address] = [...line.querySelectorAll("input")].map((input) => input.value.trim());
      return { name: own || `cam${index + 1}`, address };
    })
    .filter((camera) => camera.address);

async function show() {
  try {
    showAll(await post("/api/cameras/preview", { cameras: written() }));
  } catch (error) {
    complain(error);
  }
}

/** Show how all stands, with new cards where other cameras are shown than before. @param {View} now */
function showAll(now) {
  const namesOf = (/** @type {View | null} */ one) =>
    one?.cameras.map((camera) => camera.name).join();
  const isOther = namesOf(view) !== namesOf(now);
  view = now;
  if (isOther) drawCards(now);
  update(now);
}

/** A card a camera: its picture, and how it stands. @param {View} view */
function drawCards(view) {
  fill(
    grid,
    view.cameras.map((camera) => {
      const image = element("img", {
        alt: `Live picture of ${camera.name}`,
        className: "camera-picture",
        hidden: true,
      });
      const made = element(
        "figure",
        { className: "camera-card", dataset: { name: camera.name } },
        element(
          "div",
          { className: "camera-frame" },
          image,
          element("p", { className: "camera-silence" }),
        ),
        element(
          "figcaption",
          {},
          element("b", {}, camera.name),
          element("span", { className: "badge" }),
          element("span", { className: "camera-facts" }),
        ),
      );
      follow(made, image, camera.name);
      return made;
    }),
  );
}

/** Ask for one picture after the other while the card is there and seen. */
function follow(made, image, camera) {
  const next = () => {
    if (!made.isConnected) return;
    const here = view?.cameras.find((one) => one.name === camera);
    if (document.hidden || here?.state !== "running")
      return void setTimeout(next, LOOK_MILLISECONDS / 2);
    image.src = `/api/cameras/${encodeURIComponent(camera)}.jpg?height=${PREVIEW_HEIGHT}&at=${Date.now()}`;
  };
  image.onload = () => {
    image.hidden = false;
    setTimeout(next, PICTURE_MILLISECONDS);
  };
  image.onerror = () => setTimeout(next, LOOK_MILLISECONDS);
  setTimeout(next, 0);
}

/** @param {View} view */
function updateCard(view, made) {
  const camera = view.cameras.find((one) => one.name === made.dataset.name);
  if (!camera) return;
  const running = camera.state === "running";
  made.classList.toggle("silent", !running);
  Object.assign(made.querySelector(".badge"), {
    textContent:
      camera.state === "stopped" ? `stopped ${plain(camera.seconds, 0)} s` : camera.state,
    className: `badge ${STATES[camera.state]}`,
  });
  made.querySelector(".camera-silence").textContent = running
    ? ""
    : camera.message || (camera.state === "connecting" ? "Waiting for its first picture…" : "");
  made.querySelector(".camera-facts").textContent = running
    ? dotted(
        `${plain(camera.fps)} fps`,
        `${plain(camera.age === null ? null : 1000 * camera.age, 0)} ms old`,
        `${camera.width} × ${camera.height}`,
      )
    : camera.age === null
      ? camera.shown
      : `last picture ${plain(camera.age)} s old`;
}

/** @param {View} view */
function spreadWords(view) {
  const { sets, median, most, worst, apart, lagging } = view.spread;
  if (view.cameras.length < 2 || !sets) return "";
  const words = `Pictures of one moment arrive ${plain(median)} ms apart (95 %: ${plain(most)}, worst ${plain(worst)}).`;
  return apart
    ? `${words} ${apart} of the last ${sets} sets are more than half a frame apart${lagging ? `: ${lagging} lags` : ""}.`
    : words;
}

/** @param {View} view */
function update(view) {
  for (const made of grid.children) updateCard(view, made);
  spread.textContent = spreadWords(view);
  spread.classList.toggle("warn", view.spread.apart > 0);
  const is = going();
  for (const input of document.querySelectorAll(
    /** @type {"input"} */ (".camera-rows :is(input, button), .recording-form :is(input, select)"),
  ))
    input.disabled = is;
  open.disabled = record.hidden = is;
  form.classList.toggle("going", is);
  record.disabled = !view.cameras.length;
  stop.hidden = !is;
  stop.disabled = view.recording?.step === "importing";
  drawOutcome(view.recording);
}

async function begin() {
  try {
    const recording = await post("/api/recordings", {
      name: name.value.trim() || name.placeholder,
      calibration: session.value,
      track: track.querySelector("input")?.checked ?? false,
      ...(seconds.value ? { seconds: Number(seconds.value) } : {}),
    });
    if (view) showAll({ ...view, recording });
  } catch (error) {
    complain(error);
  }
}

/** @param {View["recording"]} recording */
function drawOutcome(recording) {
  if (!recording) return fill(outcome);
  const { state, step, session: made, seconds: passed, limit, words, notes, run } = recording;
  if (state === "failed") return fill(outcome, failure(recording));
  const live = going() && step !== "importing";
  const counter = element(
    "span",
    { className: `counter ${live ? "live" : ""}` },
    limit ? `${clock(passed)} / ${clock(limit)}` : clock(passed),
  );
  const target = run ? `${made} / ${run}` : made;
  fill(
    outcome,
    element(
      "p",
      { className: "recording-line", role: "status" },
      live && element("i", { className: "red-dot" }),
      counter,
      element("span", {}, dotted(step, words)),
    ),
    (state === "done" || run) &&
      element(
        "p",
        {},
        element(
          "a",
          { href: studioPath(made, run) },
          state === "done" ? `Open ${target}` : `Watch ${target} being tracked`,
        ),
      ),
    notes.length > 0 &&
      element(
        "ul",
        { className: "words" },
        notes.map((note) => element("li", { className: "caution" }, note)),
      ),
  );
}

/** Ask how all stands, over and over; only while the page is looked at or something is recorded. */
async function look() {
  if (!document.hidden || going()) {
    const turn = ++looking;
    try {
      const answer = await fetchJson("/api/cameras");
      if (turn === looking) showAll(answer);
    } catch (error) {
      if (!view) complain(error);
    }
  }
  setTimeout(look, going() ? LOOK_MILLISECONDS / 3 : LOOK_MILLISECONDS);
}

async function start() {
  startTheme();
  const { sessions } = await fetchJson("/api/sessions");
  offer(
    session,
    sessions
      .filter((one) => one.cameras && !one.problem)
      .map((one) => [one.name, sessionWords(one)]),
  );
  session.value = new URLSearchParams(location.search).get("session") ?? session.value;
  const taken = new Set(sessions.map((one) => one.name));
  let free = 1;
  while (taken.has(`recording-${free}`)) free += 1;
  name.placeholder = `recording-${free}`;
  addRow();
  fill(
    byId("content"),
    element(
      "div",
      { className: "column live-cameras" },
      pageHead(
        "Live cameras",
        "Cameras of this machine or network, recorded together with a timestamp for every picture. Give each the name that it has in the calibration.",
      ),
      card("Cameras", rows, element("div", {}, open)),
      spread,
      grid,
      card("Recording", form, outcome),
    ),
  );
  await look();
}

start().catch(complain);
