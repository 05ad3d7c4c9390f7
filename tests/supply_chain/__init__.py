"""What the studio is made of that others wrote: `python -m supply_chain` (from tests/; part of `make audit`) lists each
part with its licence, and writes all of them as a software bill of materials (CycloneDX).
"""
