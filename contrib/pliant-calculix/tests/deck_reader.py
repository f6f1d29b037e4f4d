"""A reader of decks, written apart from the writer: keywords, options, data lines."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class Card:
    keyword: str
    options: dict[str, str]
    words: list[list[str]] = field(default_factory=list)


def read(text: str) -> list[Card]:
    """Return cards with their data; a line that ends in a comma is continued in the next."""
    cards: list[Card] = []
    goes_on = False
    for line in text.splitlines():
        if line.startswith("**"):
            continue
        if line.startswith("*"):
            assert not goes_on, f"a keyword after a comma: {line}"
            head, *rest = [part.strip() for part in line[1:].split(",")]
            options = {k.strip().upper(): v.strip() for k, _, v in (part.partition("=") for part in rest)}
            cards.append(Card(head.upper(), options))
            continue
        words = [w.strip() for w in line.rstrip(",").split(",")]
        if goes_on:
            cards[-1].words[-1] += words
        else:
            cards[-1].words.append(words)
        goes_on = line.endswith(",")
    return cards


def named(cards: list[Card], keyword: str, **options: str) -> Card:
    """Return the only card with this keyword and these options."""
    found = [
        c for c in cards if c.keyword == keyword and all(c.options.get(k) == v for k, v in options.items())
    ]
    assert len(found) == 1, f"{len(found)} cards *{keyword} {options}"
    return found[0]
