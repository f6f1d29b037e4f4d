"""What searches cost."""
