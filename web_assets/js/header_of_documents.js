// What the header of every document page has: the work in the background, wherever it was begun.

import { startEvents } from "./events.js";
import { startWorkList } from "./studio/work_list.js";

startEvents();
startWorkList();
