"""Pliant engine 'mujoco_warp': thousands of chains settle at once on a GPU, by MuJoCo Warp."""
