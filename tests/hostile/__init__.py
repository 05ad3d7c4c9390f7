"""Sessions made to harm whoever opens them, and what the studio's commands and addresses do with them."""
