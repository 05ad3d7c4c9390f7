"""What every room stands on: geometry, knobs, registry, errors, progress, files of unknown origin, Numba's options."""
