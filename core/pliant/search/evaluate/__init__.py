"""What a trial of a search comes to."""
