"""A lock that others wait for."""

from pathlib import Path
from threading import Event, Thread

import pytest

from dataset_builder.errors import OutputError
from dataset_builder.lock import locked


def test_who_waits_comes_after_and_who_does_not_is_told(tmp_path: Path) -> None:
    order, begun = list[str](), Event()

    def second() -> None:
        begun.set()
        with locked(tmp_path / "lock", folder=tmp_path, work="making", wait=True):
            order.append("second")

    waiting = Thread(target=second)
    with locked(tmp_path / "lock", folder=tmp_path, work="making"):
        with pytest.raises(OutputError, match="another making is running"), \
                locked(tmp_path / "lock", folder=tmp_path, work="making"):
            pass
        waiting.start()
        assert begun.wait(10)
        waiting.join(0.2)
        assert waiting.is_alive()
        order.append("first")
    waiting.join(10)
    assert order == ["first", "second"] and list(tmp_path.iterdir()) == []
