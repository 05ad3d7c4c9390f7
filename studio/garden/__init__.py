"""The papers' experiments, the suite's recipes, benchmarks: they use the house, and only two commands use them."""
