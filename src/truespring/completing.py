"""Objects of the user's own in the place of ours: what they do not answer has the default of our base class."""

from typing import Any, TypeVar

T = TypeVar("T")


def completed(given: Any, base: type[T]) -> T:
    """Return `given` as an instance of `base`: attributes that it lacks are those of `base`.

    `base` takes no arguments to be made. `label`, where it is lacking, is the name of the class of `given`.
    """
    if isinstance(given, base):
        return given

    class Completed(base):  # type: ignore[valid-type, misc]
        def __getattribute__(self, name: str) -> Any:
            own = not name.startswith("__") and hasattr(given, name)
            return getattr(given, name) if own else super().__getattribute__(name)

    Completed.__name__ = type(given).__name__
    return Completed()
