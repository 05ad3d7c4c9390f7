"""The `studio` command: commands to calls, no logic."""
