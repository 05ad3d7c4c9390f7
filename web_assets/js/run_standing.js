// How the open run stands, in a word or two: what the tracking process does with it, else what is stored of it. The
// process may have been at another run last: how that ended says nothing of this one.

const SEARCHING = ["tracking", "compiling", "paused", "reannealing"];

/**
 * The state of the open run for the dot and the words in the header.
 * @param {{ session: string | null, run: string | null, work: any, summary: any, connected: any }} now
 * @returns {{ state: string, words: string }} words: "" where the tracking process's own are right
 */
export function standingOf({ session, run, work, summary, connected }) {
  if (connected === false) return { state: "disconnected", words: "disconnected, reconnecting" };
  const here = Boolean(work) && work.session === session && work.run === run && Boolean(run);
  if (here && (work.state !== "idle")) return { state: work.state, words: "" };
  if (work && !here && SEARCHING.includes(work.state)) return { state: work.state, words: "" };
  if (!session) return { state: "idle", words: "idle" };
  if (!run) return { state: "idle", words: "no run" };
  if (!summary) return { state: "idle", words: "idle" };
  const [done, all] = [summary.frames.length, summary.last - summary.first];
  if (!done) return { state: "idle", words: "not tracked yet" };
  return done < all ? { state: "idle", words: `${done} of ${all} frames` } : { state: "finished", words: "finished" };
}
