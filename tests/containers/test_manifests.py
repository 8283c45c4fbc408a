"""Kubernetes manifests: their fields exist, their commands are ours, and what must agree between them does."""

import os
import re
import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from ruamel.yaml import YAML

from dataset_builder.cli.main import parser
from tests.containers.kubernetes_fields import schema

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "containers"
MANIFESTS = sorted(FOLDER.glob("*.yaml"))
INSTALLED = "/opt/dataset-builder"
"""Where the image has the repository."""


def read(path: Path) -> dict[str, Any]:
    manifest: dict[str, Any] = YAML(typ="safe").load(path)
    return manifest


def pods(of: Any) -> Iterator[dict[str, Any]]:
    """Every pod template below a value."""
    if isinstance(of, dict):
        if "containers" in of:
            yield of
        of = list(of.values())
    for value in of if isinstance(of, list) else []:
        yield from pods(value)


def typed(command: list[str], folder: Path, **variables: str) -> list[str]:
    """What `dataset-builder` is called with by a container's command, parts named `a` and `b` being there."""
    tool = folder / "dataset-builder"
    tool.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    tool.chmod(0o755)
    text = [word.replace("/data/parts/*", f"{folder}/parts/*") for word in command]
    for name in ("a", "b"):
        (folder / "parts" / name).mkdir(parents=True)
    told = subprocess.run(text, env={"PATH": f"{folder}:{os.environ['PATH']}", **variables}, capture_output=True,
                          text=True, check=True)
    return told.stdout.splitlines()


def require_ours(words: list[str]) -> None:
    """The command line is one of ours, and its spec is one of the repository's."""
    options = parser().parse_args(words)
    assert str(options.spec).startswith(f"{INSTALLED}/")
    assert (ROOT / options.spec.relative_to(INSTALLED)).is_file()


@pytest.mark.parametrize("path", MANIFESTS, ids=lambda path: path.stem)
def test_fields_exist(path: Path) -> None:
    manifest = read(path)
    jsonschema.validate(manifest, schema(manifest["apiVersion"], manifest["kind"]))
    for pod in pods(manifest):
        named = {volume["name"] for volume in pod["volumes"]}
        claims = {volume["persistentVolumeClaim"]["claimName"] for volume in pod["volumes"]}
        assert claims == {read(FOLDER / "volume.yaml")["metadata"]["name"]}
        for container in pod["containers"]:
            assert {mount["name"] for mount in container["volumeMounts"]} <= named
            # Required of GPUs; and pods of which this is true are evicted last
            assert container["resources"]["requests"] == container["resources"]["limits"]
    wrong = dict(manifest, spec={**manifest["spec"], "replica": 1})
    with pytest.raises(jsonschema.ValidationError, match="replica"):
        jsonschema.validate(wrong, schema(manifest["apiVersion"], manifest["kind"]))


def test_the_command_of_the_cluster_is_ours() -> None:
    spec = read(FOLDER / "rayjob.yaml")["spec"]
    tool, *words = shlex.split(spec["entrypoint"])
    assert tool == "dataset-builder"
    require_ours(words)
    pinned = re.search(r"^ray==(.+)$", (ROOT / "constraints.txt").read_text(), re.MULTILINE)
    assert pinned is not None and pinned[1] == spec["rayClusterSpec"]["rayVersion"]


def test_the_parts_of_the_job_are_all_parts_and_are_merged(tmp_path: Path) -> None:
    spec = read(FOLDER / "indexed-job.yaml")["spec"]
    command = next(pods(spec))["containers"][0]["command"]
    count = spec["completions"]
    for index in (0, count - 1):
        (tmp_path / f"{index}").mkdir()
        words = typed(command, tmp_path / f"{index}", JOB_COMPLETION_INDEX=f"{index}")
        require_ours(words)
        assert words[words.index("--part") + 1] == f"{index + 1}/{count}"
        assert words[words.index("--out") + 1] == f"/data/parts/{index + 1}"
    merge = next(pods(read(FOLDER / "merge-job.yaml")))["containers"][0]["command"]
    (tmp_path / "merge").mkdir()
    words = typed(merge, tmp_path / "merge")
    require_ours(words)
    assert words[2:4] == [f"{tmp_path}/merge/parts/a", f"{tmp_path}/merge/parts/b"]


def test_pods_run_as_the_user_of_the_image() -> None:
    user = re.search(r"useradd --uid (\d+)", (FOLDER / "Dockerfile").read_text())
    assert user is not None
    for path in MANIFESTS:
        for pod in pods(read(path)):
            assert set(pod["securityContext"].values()) == {int(user[1])}
