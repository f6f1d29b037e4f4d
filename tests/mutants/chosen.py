"""Mutants chosen by hand: what once survived, and places where a wrong sign, factor or lock would be felt last."""

from __future__ import annotations

from tests.mutants.mutant import Mutant

CHOSEN: tuple[Mutant, ...] = ()
