"""What is set up before a run: masks, cameras turned, the subject and its start pose."""
