"""Judged benchmark of the closed loop: truths of the evidence bed behind a simulated bench."""
