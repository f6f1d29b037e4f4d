"""What a study's `search` block states."""
