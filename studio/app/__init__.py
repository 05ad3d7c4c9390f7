"""The browser's side: the server of pages and API, and the 3-D scene."""
