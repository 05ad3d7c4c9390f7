"""The verbs of the command line for Python and notebooks; `studio` itself hands them out."""
