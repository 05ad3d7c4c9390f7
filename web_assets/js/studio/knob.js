// A knob of the open run, to be turned from a sentence or a strip: the shown frame is searched
// again with it.

import { fetchJson, patch, runPath } from "../api.js";
import { complain } from "../messages.js";
import { paced } from "../pacing.js";
import { get } from "../state.js";
import { follow, useEffect, useMemo, useState } from "./component.js";

const SEND_MILLISECONDS = 120;

/**
 * @typedef {{ value: number, low: number, high: number, step: number, turn: (value: number) => void
 *   }} Turned
 */

/**
 * The knob's value now, its range, and what turns it; null while it is not known or the run has
 * none of this name.
 * @param {string} name
 * @returns {Turned | null}
 */
export function useKnob(name) {
  const session = follow("session");
  const run = follow("run");
  const settings = follow("settings");
  const [known, setKnown] = useState(/** @type {any} */ (null));
  const [turned, setTurned] = useState(/** @type {number | null} */ (null));

  useEffect(() => {
    let isOld = false;
    setKnown(null);
    setTurned(null);
    if (!session || !run) return undefined;
    fetchJson(`${runPath(session, run)}/settings`)
      .then((answer) => {
        const knob = answer.knobs.find((one) => one.name === name);
        if (!isOld && knob) setKnown({ ...knob, value: answer.moved[name] ?? answer.values[name] });
      })
      .catch(complain);
    return () => {
      isOld = true;
    };
  }, [session, run, name]);

  // What was turned elsewhere, on the scene's panel for instance.
  useEffect(() => {
    const now = settings?.session === session && settings?.run === run && settings.values?.[name];
    if (typeof now === "number") setTurned(now);
  }, [settings]);

  const send = useMemo(() => {
    let wanted = 0;
    const later = paced(async () => {
      const path = runPath(get("session"), get("run"));
      await patch(`${path}/settings?frame=${get("frame")}`, { [name]: wanted }).catch(complain);
    }, SEND_MILLISECONDS);
    return (/** @type {number} */ value) => {
      wanted = value;
      later();
    };
  }, [session, run, name]);

  if (!known) return null;
  const turn = (/** @type {number} */ value) => {
    const held = Math.min(known.high ?? value, Math.max(known.low ?? value, value));
    const kept = Number(held.toFixed(4));
    setTurned(kept);
    send(kept);
  };
  return {
    value: turned ?? known.value,
    low: known.low,
    high: known.high,
    step: known.step || 1,
    turn,
  };
}
