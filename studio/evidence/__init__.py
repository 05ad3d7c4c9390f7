"""From pictures to masks, edge maps and distance maps; the visual hull (`volume`).

`EvidenceMaker.view` (`pipeline.py`) makes a frame's evidence of one camera: the picture, its raw mask (`raw_mask`: a
file's, by brightness, or by a background model of `backgrounds.py`), the mask cleaned, the edges' map. A frame's views
together are a `FrameEvidence`, which likelihoods weigh poses by.
"""
