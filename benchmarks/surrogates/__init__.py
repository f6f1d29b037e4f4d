"""Benchmarks of joint laws and meta-models: accuracy on states and designs left out, error bars, cost."""
