// Live cameras: which, what they show now, how far apart their pictures come; record them, or track what they see.

import { fetchJson, post } from "./api.js";
import { button, element } from "./elements.js";
import { complain } from "./messages.js";
import { startTheme } from "./theme.js";
import { isGoing } from "./jobs.js";

const content = document.getElementById("content");
const LOOK_MILLISECONDS = 1000;
const PICTURE_MILLISECONDS = 200;
const PREVIEW_HEIGHT = 270;
const EXAMPLES = "http://10.0.0.7:8080/video · rtsp://… · /dev/video0";
const STATES = { connecting: "calm", running: "good", stopped: "bad", ended: "calm" };

let sessions = [];
let told = null;
let looking = 0;

const going = () => isGoing(told?.recording);
const number = (value, digits = 1) => (value === null || value === undefined ? "–" : value.toFixed(digits));
const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;

/** The rows of names and addresses; a new empty one follows the last that is filled. */
const rows = element("div", { className: "camera-rows" });
const open = button("Show cameras", show, "primary");
const grid = element("div", { className: "camera-grid" });
const spread = element("p", { className: "lead spread", role: "status" });
const form = element("div", { className: "recording-form" });
const outcome = element("div", { className: "recording-outcome" });

function row(name = "", address = "") {
  const label = element("input", { type: "text", value: name, ariaLabel: "Name in the calibration", placeholder: `cam${rows.children.length + 1}`, className: "camera-name", maxLength: 40 });
  const place = element("input", { type: "text", value: address, ariaLabel: "Address", placeholder: EXAMPLES, className: "camera-address", spellcheck: false, autocomplete: "off" });
  const drop = button("×", () => { line.remove(); if (!rows.children.length) row(); }, "icon quiet");
  drop.setAttribute("aria-label", "Remove this camera");
  const line = element("div", { className: "camera-row" }, label, place, drop);
  place.oninput = () => { if (line === rows.lastElementChild && place.value) row(); };
  place.onkeydown = (event) => { if (event.key === "Enter") open.click(); };
  rows.append(line);
}

/** What is written in the rows; addresses may hold passwords, so they are kept nowhere. */
const written = () => [...rows.children].map((line, index) => {
  const [name, address] = [...line.querySelectorAll("input")].map((input) => input.value.trim());
  return { name: name || `cam${index + 1}`, address };
}).filter((camera) => camera.address);

async function show() {
  try {
    told = await post("/api/cameras/preview", { cameras: written() });
    drawCards();
    update();
  } catch (error) { complain(error); }
}

/** A card a camera: its picture, and how it stands. */
function drawCards() {
  grid.replaceChildren(...told.cameras.map((camera) => {
    const picture = element("img", { alt: `What ${camera.name} sees now`, className: "camera-picture" });
    const frame = element("div", { className: "camera-frame" }, picture, element("p", { className: "camera-silence" }));
    const card = element("figure", { className: "camera-card" }, frame, element("figcaption", {}, element("b", { textContent: camera.name }), element("span", { className: "badge" }), element("span", { className: "camera-facts" })));
    card.dataset.name = camera.name;
    picture.hidden = true;
    follow(card, picture, camera.name);
    return card;
  }));
}

/** Ask for one picture after the other while the card is there and seen. */
function follow(card, picture, name) {
  const next = () => {
    if (!card.isConnected) return;
    const here = told.cameras.find((camera) => camera.name === name);
    if (document.hidden || here?.state !== "running") return void setTimeout(next, LOOK_MILLISECONDS / 2);
    picture.src = `/api/cameras/${encodeURIComponent(name)}.jpg?height=${PREVIEW_HEIGHT}&at=${Date.now()}`;
  };
  picture.onload = () => { picture.hidden = false; setTimeout(next, PICTURE_MILLISECONDS); };
  picture.onerror = () => setTimeout(next, LOOK_MILLISECONDS);
  setTimeout(next, 0);
}

function updateCard(card) {
  const camera = told.cameras.find((one) => one.name === card.dataset.name);
  if (!camera) return;
  const badge = card.querySelector(".badge");
  badge.textContent = camera.state === "stopped" ? `stopped ${number(camera.seconds, 0)} s` : camera.state;
  badge.className = `badge ${STATES[camera.state]}`;
  const running = camera.state === "running";
  card.classList.toggle("silent", !running);
  card.querySelector(".camera-silence").textContent = running ? "" : camera.message || (camera.state === "connecting" ? "Waiting for its first picture…" : "");
  const facts = running ? [`${number(camera.fps)} fps`, `${number(1000 * camera.age, 0)} ms old`, `${camera.width} × ${camera.height}`] : [camera.age === null ? camera.shown : `last picture ${number(camera.age, 1)} s old`];
  card.querySelector(".camera-facts").textContent = facts.join(" · ");
}

function spreadWords() {
  const { sets, median, most, worst, apart, lagging } = told.spread;
  if (told.cameras.length < 2 || !sets) return "";
  const words = `Pictures of one moment come ${number(median)} ms apart (95 %: ${number(most)}, worst ${number(worst)}).`;
  return apart ? `${words} ${apart} of the last ${sets} sets are more than half a frame apart${lagging ? `: ${lagging} lags` : ""}.` : words;
}

function update() {
  for (const card of grid.children) updateCard(card);
  spread.textContent = spreadWords();
  spread.classList.toggle("warn", told.spread.apart > 0);
  const is = going();
  for (const input of rows.querySelectorAll("input, button")) input.disabled = is;
  open.disabled = is;
  form.classList.toggle("going", Boolean(is));
  record.hidden = Boolean(is);
  record.disabled = !told.cameras.length;
  stop.hidden = !is;
  stop.disabled = told.recording?.step === "importing";
  for (const input of form.querySelectorAll("input, select")) input.disabled = Boolean(is);
  drawOutcome();
}

const session = element("select", { title: "The session whose calibration belongs to these cameras" });
const name = element("input", { type: "text", placeholder: "take-1", maxLength: 64 });
const seconds = element("input", { type: "number", min: 1, max: 86400, placeholder: "until stopped" });
const track = element("input", { type: "checkbox" });
const record = button("Record", begin, "primary record");
const stop = button("Stop", async () => { try { await post("/api/recordings/stop"); } catch (error) { complain(error); } }, "record");

async function begin() {
  const wish = { name: name.value.trim() || name.placeholder, calibration: session.value, track: track.checked };
  if (seconds.value) wish.seconds = Number(seconds.value);
  try {
    told.recording = await post("/api/recordings", wish);
    update();
  } catch (error) { complain(error); }
}

function drawOutcome() {
  const recording = told.recording;
  if (!recording) return outcome.replaceChildren();
  const { state, step, session: made, seconds: passed, limit, words, notes, message, hint, run } = recording;
  const link = run ? `/?session=${encodeURIComponent(made)}&run=${encodeURIComponent(run)}` : `/?session=${encodeURIComponent(made)}`;
  if (state === "failed") return outcome.replaceChildren(element("p", { className: "wrong", role: "alert" }, message, element("span", { className: "hint", textContent: ` ${hint}` })));
  const shown = isGoing(recording) && step !== "importing";
  const counter = element("span", { className: `counter ${shown ? "live" : ""}`, textContent: limit ? `${clock(passed)} / ${clock(limit)}` : clock(passed) });
  const line = element("p", { className: "recording-line", role: "status" }, shown ? element("i", { className: "red-dot" }) : null, counter, element("span", { textContent: [step, words].filter(Boolean).join(" · ") }));
  const places = state === "done" || run ? element("p", {}, element("a", { href: link, textContent: run ? `Watch ${made} / ${run} being tracked` : `Open ${made}` })) : null;
  if (places && state === "done") places.firstChild.textContent = `Open ${made}${run ? ` / ${run}` : ""}`;
  outcome.replaceChildren(line, ...(places ? [places] : []), ...(notes.length ? [element("ul", { className: "words" }, ...notes.map((note) => element("li", { className: "caution", textContent: note })))] : []));
}

/** Ask how all stands, over and over; only while the page is looked at or something is recorded. */
async function look() {
  if (!document.hidden || going()) {
    const turn = ++looking;
    try {
      const answer = await fetchJson("/api/cameras");
      if (turn === looking) {
        const before = told?.cameras.map((camera) => camera.name).join();
        told = answer;
        if (before !== told.cameras.map((camera) => camera.name).join()) drawCards();
        update();
      }
    } catch (error) { if (!told) complain(error); }
  }
  setTimeout(look, going() ? LOOK_MILLISECONDS / 3 : LOOK_MILLISECONDS);
}

async function start() {
  startTheme();
  const answer = await fetchJson("/api/sessions");
  sessions = answer.sessions ?? answer;
  session.replaceChildren(...sessions.filter((one) => one.cameras && !one.problem).map((one) => new Option(one.title && one.title !== one.name ? `${one.name} (${one.title})` : one.name, one.name)));
  const wanted = new URLSearchParams(location.search).get("session");
  if (wanted) session.value = wanted;
  const taken = new Set(sessions.map((one) => one.name));
  let free = 1;
  while (taken.has(`take-${free}`)) free += 1;
  name.placeholder = `take-${free}`;
  row();
  const labelled = (words, input, hint = "") => element("label", { title: hint }, words, input);
  form.append(
    labelled("Calibration of", session, "The session whose calibration belongs to these cameras"),
    labelled("Becomes session", name),
    labelled("Seconds", seconds),
    element("label", { className: "check", title: "With that session's person, empty room and start pose; the recording becomes a session in which the run can be tracked again bit for bit" }, track, "Track while recording"),
    record, stop);
  const head = element("div", { className: "head" }, element("div", {}, element("h1", { textContent: "Live cameras" }), element("p", { className: "lead", textContent: "Cameras of this machine or network, recorded all at once with the time at which each picture came. Name each as its calibration does." })));
  content.replaceChildren(element("div", { className: "column live-cameras" }, head,
    element("section", { className: "card-box" }, element("h2", { textContent: "Cameras" }), rows, element("div", {}, open)),
    spread, grid,
    element("section", { className: "card-box" }, element("h2", { textContent: "Recording" }), form, outcome)));
  await look();
}

start().catch(complain);
