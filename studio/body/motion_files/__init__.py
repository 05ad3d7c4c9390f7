"""Files of recorded motion, read and written: BVH, ASF/AMC, C3D, TRC, and arrays of the AMP humanoid."""
