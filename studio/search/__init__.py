"""The search itself: trackers, what they weigh poses by, what a body tends to do, and their settings."""
