// The guide takes the theme that every page remembers.

import { startTheme } from "./theme.js";

startTheme();
