"""Answers that are computed once for each object and kept as long as it lives."""

from collections.abc import Callable
from functools import update_wrapper
from typing import Concatenate, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

Owner = TypeVar("Owner")
Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")


def remembered(
    function: Callable[Concatenate[Owner, Arguments], Answer],
) -> Callable[Concatenate[Owner, Arguments], Answer]:
    """Return a function that keeps its answers, by object and hashable arguments, as long as the object lives.

    The answers must not hold the object themselves.
    """
    kept: WeakKeyDictionary[Owner, dict[object, Answer]] = WeakKeyDictionary()

    def remembering(owner: Owner, /, *arguments: Arguments.args, **named: Arguments.kwargs) -> Answer:
        answers = kept.setdefault(owner, {})
        key = arguments, tuple(sorted(named.items()))
        if key not in answers:
            answers[key] = function(owner, *arguments, **named)
        return answers[key]

    return update_wrapper(remembering, function)
