"""How far off a run's joints may be: the run drawn again and tracked, and intervals from the errors there.

`twin.py` draws the run as footage of a body that moves as the run found, with masks that are wrong as the run's own are
(`mask_faults.py`), and tracks it with the run's settings; there the truth is known. `conformal.py` makes half widths of
these errors that hold for frames that resemble their neighbours. `half_widths.py` keeps them with the run and says when
they are not to be had.
"""
