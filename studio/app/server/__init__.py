"""Pages, JSON API, one WebSocket of events, and the relay to the scene."""
