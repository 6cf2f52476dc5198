"""Entries that installed packages add to the tables of the library, by entry points.

A package declares an entry in its pyproject.toml, and pip install makes it known:

    [project.entry-points."truespring.rules"]
    my-rule = "my_package.rules:MY_RULE"

The packages are searched at the first look beyond the library's own entries, and an entry is imported when it is asked
for. See docs/extending.md.
"""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Generic, TypeVar

from truespring.errors import PluginError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

Entry = TypeVar("Entry")


class PluginWarning(UserWarning):
    """An entry of an installed package is left out: its name is taken, or it cannot be loaded."""


class Table(Mapping[str, Entry], Generic[Entry]):
    """Entries of the library by name, followed by those of installed packages.

    An entry of a package that has the name of one of the library is left out, with a PluginWarning. One that cannot be
    loaded raises PluginError if it is asked for by name, and is otherwise left out with a PluginWarning.

    Attributes:
        group: group of entry points, such as "truespring.rules".
        own: the entries of the library.
        kind: the class of entries.
    """

    def __init__(self, group: str, own: Mapping[str, Entry], kind: type[Entry]) -> None:
        self.group, self.own, self.kind = group, MappingProxyType(dict(own)), kind
        self._loaded: dict[str, Entry] = {}
        self._failed: set[str] = set()

    @cached_property
    def _found(self) -> dict[str, "list[EntryPoint]"]:
        """The entry points of installed packages by name, without those of names that the library has."""
        found: dict[str, list[EntryPoint]] = {}
        for point in entry_points(self.group):
            if point.name in self.own:
                warnings.warn(
                    f"{_owner(point)}: {self.group} '{point.name}' is left out, truespring has an entry of this name: "
                    "rename it",
                    PluginWarning,
                    stacklevel=2,
                )
            else:
                found.setdefault(point.name, []).append(point)
        return found

    def __getitem__(self, name: str) -> Entry:
        if name in self.own:
            return self.own[name]
        if name not in self._loaded:
            if name not in self._found:
                raise KeyError(name)
            self._loaded[name] = self._load(name)
        return self._loaded[name]

    def __contains__(self, name: object) -> bool:
        return name in self.own or name in self._found

    def __iter__(self) -> Iterator[str]:
        yield from self.own
        yield from filter(self._loads, self._found)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def _loads(self, name: str) -> bool:
        """Return whether an entry of a package can be loaded; warn once if not."""
        if name in self._failed:
            return False
        try:
            self[name]
        except PluginError as error:
            self._failed.add(name)
            warnings.warn(f"left out: {error}", PluginWarning, stacklevel=3)
            return False
        return True

    def _load(self, name: str) -> Entry:
        point, *others = self._found[name]
        if others:
            owners = " and ".join(_owner(one) for one in self._found[name])
            raise PluginError(f"{self.group} '{name}' is in {owners}: uninstall one of them, or rename the entry")
        what = f"{_owner(point)}: {self.group} '{name}' = {point.value}"
        try:
            entry = point.load()
        except Exception as error:
            raise PluginError(
                f"{what} cannot be loaded: {type(error).__name__}: {error}: repair the package, or uninstall it"
            ) from error
        if not isinstance(entry, self.kind):
            raise PluginError(f"{what} is a {type(entry).__name__}, must be a {self.kind.__name__}: see extending.md")
        return entry


class Names(Sequence[str]):
    """The names of the entries of a table that fulfil a condition, found when they are used."""

    def __init__(self, table: Table[Entry], condition: Callable[[Entry], bool]) -> None:
        self._table, self._condition = table, condition

    @property
    def _names(self) -> tuple[str, ...]:
        return tuple(name for name, entry in self._table.items() if self._condition(entry))

    def __getitem__(self, place: int | slice) -> str | tuple[str, ...]:  # type: ignore[override]
        return self._names[place]

    def __len__(self) -> int:
        return len(self._names)

    def __contains__(self, name: object) -> bool:
        own = isinstance(name, str) and name in self._table.own
        return self._condition(self._table.own[str(name)]) if own else name in self._names

    def __repr__(self) -> str:
        return repr(self._names)


def entry_points(group: str) -> "tuple[EntryPoint, ...]":
    """Return the entry points of installed packages in a group, in the order of their names."""
    from importlib.metadata import entry_points as installed

    return tuple(sorted(installed(group=group), key=lambda point: (point.name, _owner(point))))


def _owner(point: "EntryPoint") -> str:
    """Return the package of an entry point, and its version."""
    return "an unknown package" if point.dist is None else f"package {point.dist.name} {point.dist.version}"
