"""The papers' figures and tables, sweeps and the benchmark."""
