"""The papers' experiments, recipes that are drawn from a seed, benchmarks.

They use the house; only two command modules of `cli` use them.
"""
