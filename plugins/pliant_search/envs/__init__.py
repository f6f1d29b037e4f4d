"""The search as a gymnasium environment, and policies that an optimizer trains."""
