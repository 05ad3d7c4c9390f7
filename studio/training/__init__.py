"""Behaviour models out of recorded motion: reading, retargeting, oversampling, learning."""
