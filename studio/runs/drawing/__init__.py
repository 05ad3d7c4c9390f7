"""The studio's colours, and drawing onto pictures."""
