// The event socket: what the worker says reaches the state here, and only here.

import { addLine } from "./log.js";
import { say } from "./messages.js";
import { get, set } from "./state.js";

const RETRY_MILLISECONDS = 1500;
const handlers = {
  state: (event) => { set({ work: event }); if (event.state === "failed") say(event.message || "The run failed.", { remedy: event.hint, kind: "error" }); },
  acknowledged: (event) => { if (!event.ok) say(event.message, { remedy: event.hint, kind: "error" }); },
  log: (event) => isHere(event) && addLine(event),
};

const isHere = (event) => event.session === get("session") && event.run === get("run");

/** Register what else happens on an event type. */
export const onEvent = (type, handler) => {
  const before = handlers[type];
  handlers[type] = (event) => { before?.(event); handler(event, isHere(event)); };
};

/** Open the socket and keep it open. */
export function startLive() {
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/api/events`);
  socket.onopen = () => set({ connected: true });
  socket.onmessage = ({ data }) => {
    const event = JSON.parse(data);
    handlers[event.type]?.(event);
  };
  socket.onclose = () => { set({ connected: false }); setTimeout(startLive, RETRY_MILLISECONDS); };
}
