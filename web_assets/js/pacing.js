// Doing again what changes often, at a pace that leaves room for everything else.

const LEAST_PAUSE_MILLISECONDS = 100;
const LONGEST_PAUSE_MILLISECONDS = 500;

const requested = new Set();
let busy = false;

const nextFrame = () => new Promise((resolve) => requestAnimationFrame(resolve));
const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

function drawAll() {
  const drawings = [...requested];
  requested.clear();
  for (const draw of drawings) {
    try {
      draw();
    } catch (error) {
      console.error(error);
    }
  }
}

async function serve() {
  busy = true;
  while (requested.size) {
    await nextFrame();
    const began = performance.now();
    drawAll();
    // The next frame begins when this one has been handed over: only then it is known how long the
    // drawing took.
    await nextFrame();
    const took = performance.now() - began;
    await pause(Math.min(LONGEST_PAUSE_MILLISECONDS, Math.max(LEAST_PAUSE_MILLISECONDS, took)));
  }
  busy = false;
}

/**
 * Call `draw` soon: all drawings together, before a frame of the screen, the newest request of each
 * only. However often they are requested, every other frame and a pause are left to everything
 * else, so a machine that draws slowly still answers.
 */
export function drawSoon(draw) {
  requested.add(draw);
  if (!busy) serve();
}

/**
 * What is asked about one subject at a time: a question about another aborts it, one about the same
 * is asked (`again`) once it is answered, so that what changes all the time is shown as often as
 * answers come.
 * @param {() => void} again
 */
export function askingAbout(again) {
  /** @type {{ subject: string, control: AbortController, more: boolean } | null} */
  let now = null;
  const stop = () => {
    now?.control.abort();
    now = null;
  };
  /** @param {string} subject @param {(signal: AbortSignal) => Promise<void>} work */
  const ask = async (subject, work) => {
    if (now?.subject === subject) {
      now.more = true;
      return;
    }
    stop();
    const own = { subject, control: new AbortController(), more: false };
    now = own;
    try {
      await work(own.control.signal);
    } finally {
      if (now === own) now = null;
    }
    if (own.more && !own.control.signal.aborted) again();
  };
  return { ask, stop };
}

/**
 * A function that requests `work` (may be asynchronous): never twice at once, not more often than
 * allowed, the last request always served.
 */
export function paced(work, milliseconds) {
  let wanted = false;
  let busy = false;
  let last = -Infinity;
  const again = async () => {
    if (busy || !wanted) return;
    busy = true;
    await pause(Math.max(0, last + milliseconds - performance.now()));
    wanted = false;
    last = performance.now();
    try {
      await work();
    } finally {
      busy = false;
    }
    again();
  };
  return () => {
    wanted = true;
    again();
  };
}
