"""One run: a session and settings through the frame loop into a results store."""
