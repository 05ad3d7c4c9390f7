"""What a body tends to do: clusters of elementary movements, and an automaton over them."""
