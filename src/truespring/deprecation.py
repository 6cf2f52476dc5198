"""Accept former names of arguments for one release, with a warning."""

import warnings
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")


def renamed_argument(
    former: str, name: str
) -> Callable[[Callable[Arguments, Returned]], Callable[Arguments, Returned]]:
    """Return a decorator that accepts the keyword `former` for `name`, with a DeprecationWarning."""

    def decorate(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
        @wraps(function)
        def accepting(*arguments: Arguments.args, **named: Arguments.kwargs) -> Returned:
            if former in named:
                if name in named:
                    raise TypeError(f"{function.__name__}() got both '{former}', which is deprecated, and '{name}'")
                text = f"{function.__name__}({former}=...) is deprecated, use {name}=..."
                warnings.warn(text, DeprecationWarning, stacklevel=2)
                named[name] = named.pop(former)
            return function(*arguments, **named)

        return accepting

    return decorate
