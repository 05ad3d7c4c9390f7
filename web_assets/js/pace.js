// Doing again what changes often: never twice at once, not more often than allowed, the last request always served.

/** A function that asks for `work` (may be asynchronous); requests that come meanwhile are served by one more call. */
export function paced(work, milliseconds) {
  let wanted = false;
  let busy = false;
  let last = -Infinity;
  const serve = async () => {
    if (busy || !wanted) return;
    busy = true;
    await new Promise((resolve) => setTimeout(resolve, Math.max(0, last + milliseconds - performance.now())));
    wanted = false;
    last = performance.now();
    try { await work(); } finally { busy = false; }
    serve();
  };
  return () => { wanted = true; serve(); };
}
