"""What `import dataset_builder` offers: a dataset in Python, from its spec to its pixels.

Each function imports what it needs when it is called, so that this module costs nothing and a reader needs no renderer.
Where a library is not installed, all of them raise UserError with what to install.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

from dataset_builder.extras import missing_named

if TYPE_CHECKING:
    import numpy as np

    from dataset_builder.errors import Problem
    from dataset_builder.label.example_plan import ExamplePlan
    from dataset_builder.planning.plan import Planner
    from dataset_builder.shards.manifest import Manifest
    from dataset_builder.shards.verify_shard import Depth
    from dataset_builder.spec.resolve import LoadedSpec

_RENDERING = Lock()
"""One thread renders at a time: scenes of two would take each other's places."""

DATASETS = Path("datasets")
"""Where datasets are built unless another folder is named."""


@missing_named()
def load_spec(path: Path | str, overrides: Sequence[str] = ()) -> "LoadedSpec":
    """The dataset spec at `path` with every file that it names, checked.

    overrides: `key.path=value` strings, as `--set` takes them. Raises UserError with every broken rule of every file.
    """
    from dataset_builder.spec.load import load_dataset

    return load_dataset(path, overrides)


@missing_named()
def plan(spec: "LoadedSpec", example: int) -> "ExamplePlan":
    """The plan of one example by its index in the dataset: every number drawn, nothing rendered.

    Raises UserError where there is no such example or where it cannot be planned.
    """
    from dataset_builder.planning.plan import plan_example
    from dataset_builder.planning.precheck import meshes_named

    planner = _planner(spec)
    with meshes_named(planner):
        return plan_example(spec, example, planner)


@missing_named()
def render_example(spec: "LoadedSpec", example: "int | ExamplePlan", *, backend: str = "auto") -> dict[str, Any]:
    """One example in memory, by its index or by a plan: what `open_dataset` reads of it once the dataset is built.

    Layers by name, (H, W, C) float32, and the label under `meta`, bit for bit; only how far denoised layers may be
    trusted, which a build measures on other examples, is left out. Gates are not applied. A field that the example
    needs is made first and kept as long as the process lives. backend: auto | cuda | llvm,
    one for the life of the process. Raises UserError where the example cannot be planned or rendered.
    """
    from dataset_builder.engine.field_tasks import passing_shelf
    from dataset_builder.engine.unit import example_of
    from dataset_builder.rendering.backend import activate
    from dataset_builder.rendering.examples import render_view
    from dataset_builder.shards.example import as_read

    chosen = plan(spec, example) if isinstance(example, int) else example
    with _RENDERING:
        activate(backend)
        rendered, = render_view([chosen], spec.path.parent, fields=passing_shelf([chosen], spec.path.parent, backend))
    return as_read(example_of(rendered), dtype=spec.dataset.storage.dtype)


@missing_named()
def build(spec: "LoadedSpec", out: Path | str | None = None, *, workers: int | None = None, backend: str = "auto",
          examples: Sequence[int] = (), replace: bool = False,
          progress: Callable[[int, int], None] | None = None) -> "Manifest | None":
    """Build a dataset, or go on with an interrupted build; its manifest, in which rejected examples are named.

    out: folder, `datasets/NAME` where none is given. workers: processes that render, None for one per core, or a single
    one on a GPU; a script that asks for several needs the usual `if __name__ == "__main__":`. backend: auto | cuda |
    llvm. examples: indices of those to stage, without publishing anything; the result is None then. replace: another
    dataset or major version in the folder may go, and examples of another backend. progress: called with how many
    examples are done, and of how many. Raises UserError where the spec, the folder or the disk refuses; what was
    finished before is kept, and the dataset that was there stays until the new one is whole.
    """
    from dataset_builder.builder import build as events

    manifest, done, wanted = None, 0, 0
    folder = DATASETS / spec.dataset.name if out is None else Path(out)
    for event in events(spec, folder, backend=backend, workers=workers, only=examples, replace_other=replace):
        wanted, done = wanted if event.wanted is None else event.wanted, done + len(event.outcomes)
        manifest = event.manifest or manifest
        if progress and (event.outcomes or event.wanted is not None):
            progress(done, wanted)
    return manifest


@missing_named()
def verify(folder: Path | str, *, depth: "Depth" = "pixels", splits: Sequence[str] = (), workers: int = 1,
           progress: Callable[[int, int], None] = lambda done, of: None) -> "list[Problem]":
    """Everything that is wrong with a dataset's files, examples and identities; empty where nothing is.

    depth: size | shard | member | pixels, each of which looks at all that the one before does (docs/integrity.md).
    splits: those whose shards are looked at, all where empty. workers: processes; a script that asks for several needs
    the usual `if __name__ == "__main__":`. progress: called with bytes of shards looked at, and of how many. Raises
    UserError where there is no such depth or split.
    """
    from dataset_builder.shards.verify import verify as problems

    return problems(Path(folder), depth=depth, splits=splits, workers=workers, told=progress)


def tone_mapped(*images: "np.ndarray") -> "np.ndarray":
    """Linear (H, W, 3) or (H, W, 1) images of one height side by side under one exposure, (H, sum of W, 3) uint8 sRGB.

    For people to look at: values above white are clipped.
    """
    from dataset_builder.tonemap import side_by_side

    return side_by_side(images)


@lru_cache(maxsize=2)
def _planner(spec: "LoadedSpec") -> "Planner":
    """One for all examples of a spec, since neighbours share much of their plans."""
    from dataset_builder.planning.plan import Planner

    return Planner(spec)
