"""Sessions on disk: manifests, importers, runs and their results."""
