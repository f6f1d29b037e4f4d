"""The two published design studies, repeated in full: `make study-shape` and `make study-gripper`."""
