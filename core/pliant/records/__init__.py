"""Frozen records that pass between the stages: design → FEM data → law → chain → rollout → score.

Import them from their own files (`pliant.records.chain`), so that a stage's code fingerprint
contains only what it uses.
"""
