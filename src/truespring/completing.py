"""Complete objects of users, such as models and solvers, by the defaults of a base class."""

from typing import Any, TypeVar

T = TypeVar("T")


def completed(custom: Any, base: type[T]) -> T:
    """Return `custom` as an instance of `base`: attributes that it lacks are those of `base`.

    `base` must take no arguments. The default of `label` is the class name of `custom`.
    """
    if isinstance(custom, base):
        return custom

    class Completed(base):  # type: ignore[valid-type, misc]
        def __getattribute__(self, name: str) -> Any:
            has = not name.startswith("__") and hasattr(custom, name)
            return getattr(custom, name) if has else super().__getattribute__(name)

    Completed.__name__ = type(custom).__name__
    return Completed()
