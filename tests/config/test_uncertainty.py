"""The `uncertainty` block: a level that its samples can show."""

import pytest
from pydantic import ValidationError

from pliant.config.noise import UncertaintyConfig


@pytest.mark.parametrize(("level", "least"), [(0.95, 18), (0.99, 98)])
def test_a_level_needs_samples_enough_to_see_it(level: float, least: int) -> None:
    assert UncertaintyConfig(level=level, samples=least).samples == least
    with pytest.raises(ValidationError, match=f"needs at least {least} samples, and there are {least - 1}"):
        UncertaintyConfig(level=level, samples=least - 1)
