// The event socket: what the worker says reaches the state here, and only here.

import { addLine } from "./log.js";
import { say } from "./messages.js";
import { get, set } from "./state.js";
import { eventSocket } from "./window.js";

const RETRY_MILLISECONDS = 1500;
const STRANGER_MILLISECONDS = 15000;
const handlers = {
  state: (event) => {
    const before = get("work");
    set({ work: event });
    const isSaid = before?.state === "failed" && before.run === event.run && before.message === event.message;
    if (event.state === "failed" && !isSaid) say(event.message || "The run failed.", { remedy: event.hint, kind: "error" });
  },
  acknowledged: (event) => { if (!event.ok) say(event.message, { remedy: event.hint, kind: "error" }); },
  log: (event) => isHere(event) && addLine(event),
};

const isHere = (event) => event.session === get("session") && event.run === get("run");

/** Register what else happens on an event type. */
export const onEvent = (type, handler) => {
  const before = handlers[type];
  handlers[type] = (event) => { before?.(event); handler(event, isHere(event)); };
};

/** Hand an event on that came another way. */
export const tell = (event) => handlers[event.type]?.(event);

/** Whether the studio that answers here still knows this browser; one that was started anew does not. */
async function isKnown() {
  const answer = await fetch("/api/worker").catch(() => null);
  return answer === null || answer.status !== 403;
}

/** Open the socket and keep it open. */
export function startLive() {
  const socket = eventSocket();
  socket.onopen = () => set({ connected: true, stranger: false });
  socket.onmessage = ({ data }) => {
    const event = JSON.parse(data);
    handlers[event.type]?.(event);
  };
  socket.onclose = async () => {
    set({ connected: false });
    set({ stranger: !(await isKnown()) });
    setTimeout(startLive, get("stranger") ? STRANGER_MILLISECONDS : RETRY_MILLISECONDS);
  };
}
