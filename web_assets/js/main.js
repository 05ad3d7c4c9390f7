// The page starts here: its parts are wired to the state, the state to the server.

import { startAddress } from "./address.js";
import { startCameras } from "./cameras.js";
import { startComparing } from "./comparing.js";
import { startCorrecting } from "./correcting.js";
import { startWhatIf } from "./what_if.js";
import { startCurtain } from "./studio/curtain.js";
import { startData } from "./data.js";
import { startExporting } from "./exporting.js";
import { startHeader } from "./studio/header.js";
import { startLayerPlayback } from "./studio/layer_playback.js";
import { startLayerStrip } from "./studio/layer_strip.js";
import { startKeys, takeKey } from "./studio/keys.js";
import { startLive } from "./live.js";
import { startLog } from "./log.js";
import { startPalette } from "./palette.js";
import { startRail } from "./studio/rail.js";
import { startMissing } from "./studio/missing.js";
import { startNotes } from "./studio/notes.js";
import { startWorkList } from "./studio/work_list.js";
import { startSceneFrame } from "./scene_frame.js";
import { refreshSessions } from "./sessions.js";
import { startTabs } from "./tabs.js";
import { startTheme } from "./theme.js";
import { startTimeline } from "./studio/timeline.js";
import { startTracks } from "./tracks.js";
import { startViews } from "./views.js";
import { startCourseColumn } from "./studio/course_column.js";
import { startFirstSteps } from "./studio/first_steps.js";
import { startScenePictures } from "./studio/scene_pictures.js";
import { startWhy } from "./why.js";

async function start() {
  startTheme();
  startLive();
  startHeader();
  startRail();
  startTimeline();
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
  startWhatIf();
  startMissing();
  startWorkList();
  startNotes();
  startData();
  startTracks();
  startCorrecting();
  startCourseColumn();
  startFirstSteps();
  startScenePictures();
  startSceneFrame(takeKey);
  await refreshSessions();
  startAddress();
}

start();
