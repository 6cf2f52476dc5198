"""Cache results of functions per object, for the lifetime of the object."""

from collections.abc import Callable
from functools import update_wrapper
from typing import Concatenate, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

Owner = TypeVar("Owner")
Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def remembered(
    function: Callable[Concatenate[Owner, Arguments], Result],
) -> Callable[Concatenate[Owner, Arguments], Result]:
    """Cache a function by its first argument, held weakly, and its other arguments, which must be hashable.

    Results must not refer to the first argument, which would otherwise never be freed.
    """
    cache: WeakKeyDictionary[Owner, dict[object, Result]] = WeakKeyDictionary()

    def remembering(owner: Owner, /, *arguments: Arguments.args, **named: Arguments.kwargs) -> Result:
        results = cache.setdefault(owner, {})
        key = arguments, tuple(sorted(named.items()))
        if key not in results:
            results[key] = function(owner, *arguments, **named)
        return results[key]

    return update_wrapper(remembering, function)
