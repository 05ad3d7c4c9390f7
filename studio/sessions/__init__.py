"""What is kept on disk: manifests, importers, runs and their results."""
