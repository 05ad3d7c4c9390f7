"""Trackers compared fairly on a session with truth: plan, trials, findings, and their files."""
