// What lies over the scene: that there is nothing to look at yet, that the studio does not answer.

import { post, runPath } from "./api.js";
import { bar, button, byId, element, fill } from "./elements.js";
import { importForm } from "./importing.js";
import { complain } from "./messages.js";
import { newRunForm } from "./new_run.js";
import { lacks, openSession, refreshSessions, setupPath } from "./sessions.js";
import { get, watch } from "./state.js";

const curtain = byId("curtain");
const invitation = byId("invitation");

function cover(heading, text, ...below) {
  fill(curtain, element("div", { className: "card" }, element("h2", {}, heading), element("p", {}, text), ...below));
  curtain.hidden = false;
}

const group = (...buttons) => element("div", { className: "group" }, ...buttons);

/** A line above the scene that leaves the scene in view. */
function banner(text) {
  fill(curtain, element("p", {}, text));
  curtain.classList.add("banner");
  curtain.hidden = false;
}

/** A session without runs: the scene stays free, because its start pose is set there. */
function invite(entry) {
  if (entry.next_step) fill(invitation, `${entry.name}: ${lacks(entry)}.`, button("Guided set-up", () => { location.href = setupPath(entry); }, "primary small"));
  else fill(invitation, "No run yet. Set a start pose under “Pose” if the session has none, then", button("New run", () => newRunForm(entry), "primary small"));
  invitation.hidden = false;
}

async function addSample() {
  try {
    const { name } = await post("/api/samples", { name: "walk" });
    await refreshSessions();
    openSession(name);
  } catch (error) { complain(error); }
}

function draw() {
  const sessions = get("sessions");
  const work = get("work");
  const entry = sessions?.find((one) => one.name === get("session"));
  curtain.classList.remove("banner");
  invitation.hidden = true;
  document.body.classList.toggle("disconnected", get("connected") === false);
  if (get("stranger")) return cover("The studio was started again", "This page belongs to the previous start. Open the address that the new one printed in its terminal.");
  if (get("connected") === false) return banner("Disconnected. The last state is shown; trying to reach the studio again …");
  if (sessions?.length === 0) {
    return cover("Nothing here yet", "Import the footage of your cameras, or start with the bundled walk.",
      group(button("Open the sample", addSample, "primary"), button("From my own cameras", () => { location.href = "/way?new"; }), button("Import footage", () => importForm())));
  }
  if (work?.state === "lost" && work.session === get("session")) {
    const resume = () => post(`${runPath(work.session, work.run)}/start`).catch(complain);
    return cover("The tracking process ended", `${work.message} Tracked frames are kept. ${work.hint}`, group(button("Resume", resume, "primary")));
  }
  if (work?.state === "compiling" && work.session === get("session")) return cover("Compiling the kernels, once", "The first run on this machine takes about half a minute longer.", bar(0, "progress unknown"));
  curtain.hidden = true;
  if (entry && !entry.runs.length) invite(entry);
}

/** Wire what lies over the scene. */
export function startCurtain() {
  watch(["sessions", "session", "run", "work", "connected", "stranger"], draw);
}
