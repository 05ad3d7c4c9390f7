// The event socket of the guided way: whoever listens is told, and can stop.

import { eventSocket } from "./window.js";

const RETRY_MILLISECONDS = 1500;
const listeners = new Map();

/** Call `handler(event)` on every event of a type; returns what stops that. */
export function listen(type, handler) {
  if (!listeners.has(type)) listeners.set(type, new Set());
  listeners.get(type).add(handler);
  return () => listeners.get(type).delete(handler);
}

/** Open the socket and keep it open. */
export function startWayEvents() {
  const socket = eventSocket();
  socket.onmessage = ({ data }) => {
    const event = JSON.parse(data);
    for (const handler of [...(listeners.get(event.type) ?? [])]) handler(event);
  };
  socket.onclose = () => setTimeout(startWayEvents, RETRY_MILLISECONDS);
}
