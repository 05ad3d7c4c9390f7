"""From pictures to backgrounds, masks, edge maps and distance maps; the visual hull (`volume`)."""
