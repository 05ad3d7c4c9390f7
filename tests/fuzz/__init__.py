"""Files that no program would write, read by everything that reads files: each is refused in words, or read.

`python -m fuzz` (from tests/; `make fuzz`) reads mutations of the small valid files in `seeds/`, by seed. A new format
is a folder there and its line in `formats.py`. A file that once did harm goes to `corpus/FORMAT/`.
"""
