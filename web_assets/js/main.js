// The page starts here: its parts are wired to the state, the state to the server.

import { startCameras } from "./cameras.js";
import { startCorrecting } from "./correcting.js";
import { startCurtain } from "./curtain.js";
import { startData } from "./data.js";
import { startExporting } from "./exporting.js";
import { startHeader } from "./header.js";
import { startKeys, takeKey } from "./keys.js";
import { startLive } from "./live.js";
import { startLog } from "./log.js";
import { startPlayback } from "./playback.js";
import { startRail } from "./rail.js";
import { startSceneFrame } from "./scene_frame.js";
import { openSession, refreshSessions } from "./sessions.js";
import { get } from "./state.js";
import { startSurvival } from "./survival.js";
import { startTabs } from "./tabs.js";
import { startTheme } from "./theme.js";
import { startTimeline } from "./timeline.js";
import { startTracks } from "./tracks.js";
import { startVariance } from "./variance.js";
import { startWeights } from "./weights.js";

async function start() {
  startTheme();
  startLive();
  startHeader();
  startRail();
  startTimeline();
  startPlayback();
  startVariance();
  startSurvival();
  startWeights();
  startCameras();
  startLog();
  startExporting();
  startTabs();
  startKeys();
  startCurtain();
  startData();
  startTracks();
  startCorrecting();
  startSceneFrame(takeKey);
  await refreshSessions();
  const query = new URLSearchParams(location.search);
  const sessions = get("sessions") ?? [];
  const first = sessions.find((one) => one.name === query.get("session")) ?? sessions.find((one) => one.runs.length) ?? sessions[0];
  if (first) openSession(first.name, query.get("run") ?? undefined);
}

start();
