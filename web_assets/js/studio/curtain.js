// What lies over the scene: that there is nothing to look at yet, that the studio does not answer,
// that kernels are compiled, that the tracking process ended.

import { post, runPath } from "../api.js";
import { byId } from "../elements.js";
import { importForm } from "./importing.js";
import { complain } from "../messages.js";
import { newRunForm } from "./new_run.js";
import { lacks, openSession, refreshSessions, setupPath } from "../sessions.js";
import { follow, html, mount, useLayoutEffect } from "./component.js";
import { Action } from "./parts.js";

const go = (address) => {
  location.href = address;
};

async function addSample() {
  try {
    const { name } = await post("/api/samples", { name: "walk" });
    await refreshSessions();
    openSession(/** @type {string} */ (name));
  } catch (error) {
    complain(error);
  }
}

/** A heading, what it means and what can be done, in the middle of the scene. */
const Card = ({ heading, text, children = null }) => html`<div class="card">
  <h2>${heading}</h2>
  <p>${text}</p>
  ${children}
</div>`;

const FirstSteps = () => html`<${Card}
  heading="Nothing here yet"
  text="Import the footage of your cameras, or start with the bundled walk."
>
  <div class="group">
    <${Action} act=${addSample} kind="primary">Open the sample</${Action}>
    <${Action} act=${() => go("/way?new")}>From my own cameras</${Action}>
    <${Action} act=${() => importForm()}>Import footage</${Action}>
  </div>
<//>`;

const ProcessLost = ({ work }) => html`<${Card}
  heading="The tracking process ended"
  text=${`${work.message} Tracked frames are kept. ${work.hint}`}
>
  <div class="group">
    <${Action}
      kind="primary"
      act=${() => post(`${runPath(work.session, work.run)}/start`).catch(complain)}
    >Resume</${Action}>
  </div>
<//>`;

const Compiling = () => html`<${Card}
  heading="Compiling the kernels, once"
  text="The first run on this machine takes about half a minute longer."
>
  <div class="progress unknown"><i></i></div>
<//>`;

const STRANGER =
  "This page belongs to the previous start. " +
  "Open the address that the new one printed in its terminal.";
const Stranger = () => html`<${Card}
  heading="The studio was started again"
  text=${STRANGER}
/>`;

/** What covers the scene, if anything does. `banner`: a line that leaves the scene in view. */
function covering(sessions, session, work, connected, stranger) {
  const here = work?.session === session;
  if (stranger) return { content: html`<${Stranger} />` };
  if (connected === false) {
    const words = "Disconnected. The last state is shown; trying to reach the studio again …";
    return { content: html`<p>${words}</p>`, banner: true };
  }
  if (sessions?.length === 0) return { content: html`<${FirstSteps} />` };
  if (work?.state === "lost" && here) return { content: html`<${ProcessLost} work=${work} />` };
  if (work?.state === "compiling" && here) return { content: html`<${Compiling} />` };
  return null;
}

function Curtain() {
  const connected = follow("connected");
  const shown = covering(
    follow("sessions"),
    follow("session"),
    follow("work"),
    connected,
    follow("stranger"),
  );
  useLayoutEffect(() => {
    document.body.classList.toggle("disconnected", connected === false);
  }, [connected]);
  if (!shown) return null;
  return html`<div class=${shown.banner ? "curtain banner" : "curtain"} id="curtain">
    ${shown.content}
  </div>`;
}

/** A session without runs: the scene stays free, because its start pose is set there. */
function Invitation() {
  const [sessions, session, connected] = [
    follow("sessions"),
    follow("session"),
    follow("connected"),
  ];
  const entry = sessions?.find((one) => one.name === session);
  if (!entry || entry.runs.length || connected === false || follow("stranger")) return null;
  return html`<div class="what-if" id="invitation">
    ${
      entry.next_step
        ? html`${`${entry.name}: ${lacks(entry)}.`}
            <${Action} kind="primary small" act=${() => go(setupPath(entry))}>Guided set-up</${Action}>`
        : html`No run yet. Set a start pose under “Pose” if the session has none, then
            <${Action} kind="primary small" act=${() => newRunForm(entry)}>New run</${Action}>`
    }
  </div>`;
}

/** Show what lies over the scene. */
export const startCurtain = () =>
  mount(byId("curtain-place"), html`<${Invitation} /><${Curtain} />`);
