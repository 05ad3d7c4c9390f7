"""What is set up before a run: masks, cameras turned, the subject and its start pose.

Masks that the studio makes itself are files like those that come with footage: a person's by the network of
`evidence/person_network.py` (`person_masks.py`), an animal's before known backgrounds (`animal_masks.py`), anything's
by brush strokes (`stroke_masks.py`, `evidence/stroke_cut.py`), each camera's best source (`best_source.py`, by
agreement and edges), or one of several subjects (`subject_masks.py`). `sessions/background_files.py` puts each kind
in a folder of its own, lets the manifest name them and remembers the given ones. `contrast.py` says where
subject and background are alike, which agreement cannot see.

Of several subjects `subject_masks.py` cuts out all but one: their pieces of the hull are followed over time, each
pixel goes to whose piece lies behind it. Beside the masks lies where another subject is in front (`hidden/`): there
the refinement gets no border. `subject_sessions.py` makes a session of each, so that a run has one body.

The network's joints, triangulated (`person_landmarks.py`), are a witness against which a run is measured; nothing
that tracks reads them.
"""
