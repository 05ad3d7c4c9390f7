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
 * Call `handler(event)` on every event, whatever its type; returns what stops that.
 * @param {(event: Message) => void} handler
 */
export function listenToAll(handler) {
  forAll.add(handler);
  return () => {
    forAll.delete(handler);
  };
}

/** @type {Set<(isOpen: boolean) => void>} */
const forGaps = new Set();

/**
 * Call `handler(isOpen)` whenever events may have been missed: the socket is open (again), or lost,
 * or was too slow. Who has to know how things stand asks then. Returns what stops that.
 * @param {(isOpen: boolean) => void} handler
 */
export function listenToGaps(handler) {
  forGaps.add(handler);
  return () => {
    forGaps.delete(handler);
  };
}

/** @param {boolean} isOpen */
const sayGap = (isOpen) => {
  for (const handler of [...forGaps]) handler(isOpen);
};

/**
 * Call `ask()` on every event of a type, and when the socket is open again after events may have
 * been missed; returns what stops that.
 * @param {MessageType} type
 * @param {() => void} ask
 */
export function askOnEach(type, ask) {
  const stops = [listen(type, ask), listenToGaps((isOpen) => isOpen && ask())];
  return () => {
    for (const stop of stops) stop();
  };
}

/**
 * Open the socket and keep it open. opened, closed: called then; `closed` resolves with the pause
 * before the next try.
 */
export function startEvents(opened = () => {}, closed = async () => RETRY_MILLISECONDS) {
  const socket = eventSocket();
  socket.onopen = () => {
    opened();
    sayGap(true);
  };
  socket.onmessage = ({ data }) => {
    const event = JSON.parse(data);
    for (const handler of [...(listeners.get(event.type) ?? []), ...forAll]) handler(event);
    if (event.type === "dropped") sayGap(true);
  };
  socket.onclose = async () => {
    sayGap(false);
    setTimeout(startEvents, await closed(), opened, closed);
  };
}
