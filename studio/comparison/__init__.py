"""Trackers compared fairly on a session with truth: plan, trials, findings, and what is kept of them on disk."""
