// What the tracking process does with a run, by the state that its newest event says.

/** @import { MessageOf, Schemas } from "./api_types" */
/** @typedef {MessageOf<"state">} Work */

/** @type {Schemas["RunState"][]} */
const SEARCHING = ["tracking", "compiling"];
/** @type {Schemas["RunState"][]} */
const BUSY = [...SEARCHING, "reannealing"];

/** Whether frames are tracked, or will be once kernels are compiled. @param {Work | null} work */
export const isSearching = (work) => work !== null && SEARCHING.includes(work.state);
/** Whether it searches a frame, be it stored afterwards or not. @param {Work | null} work */
export const isBusy = (work) => work !== null && BUSY.includes(work.state);
