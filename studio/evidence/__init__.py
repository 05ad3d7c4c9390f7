"""From pictures to backgrounds, masks and edge maps."""
