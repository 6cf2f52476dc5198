"""Checks of sentences by their numbers and key words, so that the wording stays free."""


def in_order(text: str, *parts: str) -> bool:
    """Return whether all parts occur in a text in this order, without overlap, upper and lower case alike."""
    place = 0
    for part in parts:
        found = text.casefold().find(part.casefold(), place)
        if found < 0:
            return False
        place = found + len(part)
    return True
