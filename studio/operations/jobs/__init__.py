"""The tracking process: its commands, events and settings mailbox."""
