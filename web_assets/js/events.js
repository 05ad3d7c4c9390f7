// The studio's events: one socket a page, opened again when it breaks; whoever listens can stop.

import { eventSocket } from "./window.js";

const RETRY_MILLISECONDS = 1500;
/** @import { Message, MessageOf, MessageType } from "./api_types" */
/** @type {Map<string, Set<(event: any) => void>>} */
const listeners = new Map();

/**
 * Call `handler(event)` on every event of a type; returns what stops that.
 * @template {MessageType} T
 * @param {T} type
 * @param {(event: MessageOf<T>) => void} handler
 */
export function listen(type, handler) {
  const those = listeners.get(type) ?? new Set();
  listeners.set(type, those.add(handler));
  return () => {
    those.delete(handler);
  };
}

/** @type {Set<(event: Message) => void>} */
const forAll = new Set();

/**
 * Call `handler(event)` on every event, whatever its type.
 * @param {(event: Message) => void} handler
 */
export const listenToAll = (handler) => forAll.add(handler);

/**
 * Open the socket and keep it open. opened, closed: called then; `closed` resolves with the pause
 * before the next try.
 */
export function startEvents(opened = () => {}, closed = async () => RETRY_MILLISECONDS) {
  const socket = eventSocket();
  socket.onopen = opened;
  socket.onmessage = ({ data }) => {
    const event = JSON.parse(data);
    for (const handler of [...(listeners.get(event.type) ?? []), ...forAll]) handler(event);
  };
  socket.onclose = async () => setTimeout(startEvents, await closed(), opened, closed);
}
