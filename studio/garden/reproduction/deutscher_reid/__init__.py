"""The figures and claims of Deutscher & Reid (2005), one file each or a few that belong together."""
