"""The viser window: body, particle clouds, cameras and panels."""
