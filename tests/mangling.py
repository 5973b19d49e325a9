"""Texts of files with some signs changed: what a reader takes or refuses in its own words."""

from __future__ import annotations

from random import Random


def mangled(text: str, chance: Random, signs: str, changes: int = 5, longest: int = 9) -> str:
    """A text in which up to some signs are replaced, and up to some runs of it left out or written twice.

    Args:
        text: of the file.
        chance: chooses.
        signs: that take the place of others.
        changes: how many there are at most.
        longest: length of what is left out or written twice.
    """
    letters = list(text)
    for _ in range(chance.randint(1, changes)):
        place = chance.randrange(len(letters))
        match chance.randrange(3):
            case 0:
                letters[place] = chance.choice(signs)
            case 1:
                del letters[place : place + chance.randint(1, longest)]
            case _:
                letters[place:place] = letters[chance.randrange(len(letters)) :][:longest]
    return "".join(letters)
