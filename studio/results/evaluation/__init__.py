"""Distance from the truth: marker errors, lost limbs."""
