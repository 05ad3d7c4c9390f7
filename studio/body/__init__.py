"""The articulated body as tables: joints, limbs, markers; forward and inverse kinematics; files of recorded motion.

A body of one's own is a changed `BodyDefinition` (`editing.py`), written as TOML and read again before anything is
made of it. A person's skeleton and recorded motion put on it are here too (`person.py`, `retargeting.py`).
"""
