"""The last few values made, by key: what neighbours in a dataset share is made once, and memory stays bounded."""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable
from typing import Any, Generic, TypeVar

from dataset_builder.assets.asset import Asset

Value = TypeVar("Value")


class Recent(Generic[Value]):
    """At most so many values, and so many bytes of them where `size` tells how many one has; the last one always.

    No result may depend on what is kept.
    """

    def __init__(self, most: int, most_bytes: int = 0, size: Callable[[Value], int] = lambda value: 0):
        self._most, self._most_bytes, self._size = most, most_bytes, size
        self._kept, self._sizes, self._bytes = OrderedDict[Hashable, Value](), dict[Hashable, int](), 0

    def get(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """The value of `key`, made where it is not kept."""
        if key not in self._kept:
            self._kept[key] = value = make()
            self._sizes[key] = self._size(value)
            self._bytes += self._sizes[key]
        self._kept.move_to_end(key)
        while len(self._kept) > 1 and (len(self._kept) > self._most or self._bytes > self._most_bytes > 0):
            dropped, _ = self._kept.popitem(last=False)
            self._bytes -= self._sizes.pop(dropped)
        return self._kept[key]

    def cache_clear(self) -> None:
        """Keep nothing, as `functools.lru_cache` calls it."""
        self._kept.clear()
        self._sizes.clear()
        self._bytes = 0


def bytes_of(assets: Iterable[Asset]) -> int:
    """Bytes of all arrays of some assets, of which several may share one."""
    held: list[Any] = [part for asset in assets for part in (asset.mesh, *(each.texture for each in asset.materials))]
    arrays = {id(array): array for one in held if one is not None
              for name in type(one).__dataclass_fields__ if hasattr(array := getattr(one, name), "nbytes")}
    return sum(array.nbytes for array in arrays.values())
