"""The search itself: trackers, what they weigh poses by, what a body tends to do, and their settings.

Nothing here knows files, sessions or cameras' pictures: a tracker is given a function of poses, a likelihood is given
evidence. Randomness is keyed by (seed, frame, layer), so that every frame can be searched again bit for bit.
"""
