"""The libraries of others that pages carry are what `tools/front` pins, whole, with their licences."""

import json
from hashlib import sha256
from pathlib import Path
from typing import Any

from dataset_builder.report.front.fill_page import HERE
from dataset_builder.report.front.pages import VIEWER

VENDOR = HERE / "vendor"
TOOLS = Path(__file__).parents[3] / "tools" / "front"
VERSIONS: list[dict[str, Any]] = json.loads((VENDOR / "versions.json").read_text(encoding="utf-8"))


def test_files_are_those_that_were_vendored() -> None:
    for entry in VERSIONS:
        assert sha256((VENDOR / entry["file"]).read_bytes()).hexdigest() == entry["sha256"], entry["file"]
        assert "Permission is hereby granted" in (VENDOR / entry["licence_file"]).read_text(encoding="utf-8")
    known = {entry[name] for entry in VERSIONS for name in ("file", "licence_file")}
    assert {path.name for path in VENDOR.iterdir()} == {*known, "versions.json"}


def test_versions_are_those_that_are_pinned() -> None:
    package = json.loads((TOOLS / "package.json").read_text(encoding="utf-8"))
    lock = json.loads((TOOLS / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    assert {entry["name"]: entry["version"] for entry in VERSIONS} == package["dependencies"]
    for entry in VERSIONS:
        assert lock[f"node_modules/{entry['name']}"]["version"] == entry["version"]
    assert all("integrity" in one and "resolved" not in one for name, one in lock.items() if name)


def test_what_pages_carry_is_small_and_may_stand_in_a_script() -> None:
    scripts = [*VENDOR.glob("*.js"), *(HERE / "scripts").glob("*.js")]
    assert sum(path.stat().st_size for path in VENDOR.iterdir()) < 1_500_000
    assert not [path.name for path in scripts if "</script" in path.read_text(encoding="utf-8").lower()]
    assert all((HERE / name).exists() for name in VIEWER)


def test_own_scripts_are_short() -> None:
    for path in (HERE / "scripts").iterdir():
        lines = path.read_text(encoding="utf-8").splitlines()
        assert len(lines) <= 250, path.name
        assert max(map(len, lines)) <= 120, path.name
