"""Behaviour models: clusters of elementary movements, and an automaton over them."""
