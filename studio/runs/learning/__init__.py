"""Behaviour models from recorded motion: reading, retargeting, oversampling, learning."""
