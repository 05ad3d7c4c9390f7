"""The verbs: what a person lets the studio do, each declared once by the signature of its function.

`studio` hands them out for Python, `cli` makes the commands and `web` the bodies of requests of them.
"""
