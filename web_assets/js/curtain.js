// What lies over the scene when there is nothing to look at yet, or nobody to talk to.

import { post, runPath } from "./api.js";
import { importForm } from "./importing.js";
import { complain } from "./messages.js";
import { newRunForm } from "./new_run.js";
import { lacks, openSession, refreshSessions, wayPath } from "./rail.js";
import { get, watch } from "./state.js";

const curtain = document.getElementById("curtain");
const invitation = document.getElementById("invitation");

function card(heading, text, actions = [], { bar = false } = {}) {
  const box = document.createElement("div");
  box.className = "card";
  const title = Object.assign(document.createElement("h2"), { textContent: heading });
  const words = Object.assign(document.createElement("p"), { textContent: text });
  box.append(title, words);
  if (bar) {
    const progress = Object.assign(document.createElement("div"), { className: "progress unknown" });
    progress.append(document.createElement("i"));
    box.append(progress);
  }
  const row = Object.assign(document.createElement("div"), { className: "group" });
  for (const [label, act, primary] of actions) row.append(Object.assign(document.createElement("button"), { textContent: label, className: primary ? "primary" : "", onclick: act }));
  if (actions.length) box.append(row);
  curtain.replaceChildren(box);
  curtain.hidden = false;
}

/** A line above the scene that leaves the scene in view. */
function banner(text) {
  curtain.replaceChildren(Object.assign(document.createElement("p"), { textContent: text }));
  curtain.classList.add("banner");
  curtain.hidden = false;
}

/** A session without runs: the scene stays free, because its start pose is set there. */
function invite(entry) {
  if (entry.next_step) {
    const go = Object.assign(document.createElement("button"), { textContent: "Guided way", className: "primary small", onclick: () => { location.href = wayPath(entry); } });
    invitation.replaceChildren(`${entry.name}: ${lacks(entry)}.`, go);
    invitation.hidden = false;
    return;
  }
  const button = Object.assign(document.createElement("button"), { textContent: "New run", className: "primary small", onclick: () => newRunForm(entry) });
  invitation.replaceChildren("No run yet. Set where the search begins under “Pose” if the session has no start pose, then", button);
  invitation.hidden = false;
}

async function addSample() {
  try {
    const told = await post("/api/samples", { name: "walk" });
    await refreshSessions();
    openSession(told.name);
  } catch (error) { complain(error); }
}

function draw() {
  const sessions = get("sessions");
  const work = get("work");
  const entry = sessions?.find((one) => one.name === get("session"));
  curtain.classList.remove("banner");
  invitation.hidden = true;
  document.body.classList.toggle("disconnected", get("connected") === false);
  if (get("stranger")) return card("The studio was started again", "This page belongs to the one before. Open the address that the new one printed in its terminal.");
  if (get("connected") === false) return banner("Disconnected. What is shown is the last state; trying to reach the studio again …");
  if (sessions?.length === 0) return card("Nothing here yet", "Import the footage of your cameras, or start with the bundled walk.", [["Open the sample", addSample, true], ["From my own cameras", () => { location.href = "/way?new"; }], ["Import footage", importForm]]);
  if (work?.state === "lost" && work.session === get("session")) {
    const resume = () => post(`${runPath(work.session, work.run)}/start`).catch(complain);
    return card("The tracking process ended", `${work.message} What was tracked is kept. ${work.hint}`, [["Resume", resume, true]]);
  }
  if (work?.state === "compiling" && work.session === get("session")) return card("Compiling the kernels, once", "The first run on this machine takes about half a minute longer.", [], { bar: true });
  curtain.hidden = true;
  if (entry && !entry.runs.length) invite(entry);
}

/** Wire the curtain. */
export function startCurtain() {
  watch(["sessions", "session", "run", "work", "connected", "stranger"], draw);
}
