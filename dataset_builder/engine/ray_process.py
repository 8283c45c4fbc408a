"""What a process of a Ray cluster does: units, one after the other, and telling how far it is."""

import sys
from collections.abc import Callable, Sequence
from faulthandler import cancel_dump_traceback_later, dump_traceback_later
from math import inf
from typing import Any

from dataset_builder.engine.node import Delivery, Hands


class News:
    """What processes tell, until it is asked for."""

    def __init__(self) -> None:
        self._told = list[Any]()

    def put(self, news: Any) -> None:
        """Keep one."""
        self._told.append(news)

    def take(self) -> list[Any]:
        """All since the last time."""
        told, self._told = self._told, []
        return told


_hands: dict[Any, Hands] = {}
"""Of this process: for what it is ready, by what stands for the shipment."""


def do(shipment: list[Any], work: Callable[..., Any], units: Sequence[Any], staged: Sequence[frozenset[str]],
        distrusted: frozenset[str], news: Any, limits: Sequence[float]) -> list[Delivery]:
    """In a process of a machine: do units, up to the first that fails; end the process where one takes longer than its
    limit, in seconds."""
    import ray

    told = () if news is None else (lambda each: news.put.remote(each),)
    found = list[Delivery]()
    try:
        if shipment[0] is not None and shipment[0] not in _hands:
            _hands.clear()
            _hands[shipment[0]] = Hands.ready(ray.get(shipment[0]), ray.get)
        for unit, there, limit in zip(units, staged, limits, strict=True):
            if limit < inf:
                # Needs nothing of the interpreter, which may hang, too
                dump_traceback_later(limit, exit=True, file=sys.stderr)
            found.append(Delivery(result=work(unit, *told)) if shipment[0] is None else
                         _hands[shipment[0]].work(work, unit, there, told, distrusted))
    except Exception as error:  # noqa: BLE001
        # As `local` hands on whatever a worker raises
        found.append(Delivery(error=error))
    finally:
        cancel_dump_traceback_later()
    return found
