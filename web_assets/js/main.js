// The page starts here: its parts are wired to the state, the state to the server.

import { startAddress } from "./address.js";
import { startCameras } from "./cameras.js";
import { startComparing } from "./comparing.js";
import { startCorrecting } from "./correcting.js";
import { startCurtain } from "./curtain.js";
import { startData } from "./data.js";
import { startExporting } from "./exporting.js";
import { startHeader } from "./studio/header.js";
import { startLayerPlayback } from "./studio/layer_playback.js";
import { startLayerStrip } from "./studio/layer_strip.js";
import { startKeys, takeKey } from "./studio/keys.js";
import { startLive } from "./live.js";
import { startLog } from "./log.js";
import { startPalette } from "./palette.js";
import { startPlayback } from "./playback.js";
import { startRail } from "./rail.js";
import { startSceneFrame } from "./scene_frame.js";
import { refreshSessions } from "./sessions.js";
import { scenePointer, startSceneTools } from "./studio/scene_tools.js";
import { startTabs } from "./tabs.js";
import { startTheme } from "./theme.js";
import { startTimeline } from "./timeline.js";
import { startTracks } from "./tracks.js";
import { startViews } from "./views.js";
import { startWhy } from "./why.js";

async function start() {
  startTheme();
  startLive();
  startHeader();
  startRail();
  startTimeline();
  startPlayback();
  startLayerPlayback();
  startLayerStrip();
  startWhy();
  startViews();
  startComparing();
  startCameras();
  startLog();
  startExporting();
  startTabs();
  startKeys();
  startPalette();
  startCurtain();
  startData();
  startTracks();
  startCorrecting();
  startSceneTools();
  startSceneFrame(takeKey, scenePointer);
  await refreshSessions();
  startAddress();
}

start();
