"""What every room stands on: geometry, knobs, registry, errors, progress, processes, files of unknown origin, Numba's
options.
"""
