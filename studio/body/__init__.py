"""The articulated body as tables: joints, limbs, markers; forward and inverse kinematics."""
