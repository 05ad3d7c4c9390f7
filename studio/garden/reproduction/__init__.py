"""The papers' figures, tables and claims run again: the catalogue of experiments, their runner and their report."""
