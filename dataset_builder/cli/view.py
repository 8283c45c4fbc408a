"""The verb `view`: what stands where in an example, before anything is built."""

import argparse
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

from dataset_builder.cli import common
from dataset_builder.errors import PlanError

if TYPE_CHECKING:
    from dataset_builder.label.example_plan import ExamplePlan
    from dataset_builder.planning.plan import Planner
    from dataset_builder.report.looking.shown_arrangement import ShownArrangement

VIEWS = Path("views")
"""Where views go unless `--out` says otherwise."""


def add(verbs: common.Verbs) -> None:
    """Add the verb."""
    verb = common.add_verb(verbs, "view", _view, "show what stands where in an example, and a quick preview of it")
    common.add_spec(verb)
    verb.add_argument("--example", type=common.example_index, default=0, metavar="N", help="which example (default: 0)")
    verb.add_argument("--out", type=common.out_folder, metavar="DIR",
                      help=f"folder for view.html and view.png (default: {VIEWS}/NAME-N)")
    verb.add_argument("--no-preview", action="store_true", help="render nothing")
    verb.add_argument("--open", action="store_true", help="open the page in the browser")
    common.add_backend(verb)


def _view(options: argparse.Namespace) -> int:
    from dataset_builder.files import write_atomic
    from dataset_builder.planning.plan import Planner
    from dataset_builder.rendering.scene.image_check import check_images
    from dataset_builder.report.arrangement_page import (
        arrangement_page,
        arrangement_panels,
        panels_png,
        preview_panels,
    )
    from dataset_builder.report.quick_render import QuickRender, quick_render
    from dataset_builder.spec.load import load_dataset

    loaded = load_dataset(options.spec, options.overrides)
    check_images(loaded)
    planner, name = Planner(loaded), loaded.dataset.name
    shown, plan, problems = _shown(planner, options.example)
    folder = options.out or VIEWS / f"{name}-{options.example}"
    title, page, picture = f"{name}: example {options.example}", folder / "view.html", folder / "view.png"
    console = common.plain_console()
    with ThreadPoolExecutor(1) as aside:
        # Kernels are compiled while the arrangement is drawn
        ahead = None if plan is None or options.no_preview else aside.submit(quick_render, loaded, plan,
                                                                             backend=options.backend)
        panels = arrangement_panels(shown)
        write_atomic(picture, panels_png(title, panels))
        console.print(f"picture: {picture}", highlight=False, soft_wrap=True)
        preview = ahead.result() if ahead else QuickRender()
    if preview.images:
        write_atomic(picture, panels_png(title, panels, preview_panels(preview)))
    write_atomic(page, arrangement_page(shown, title, plan, preview, problems).encode())
    console.print(f"page: {page}", highlight=False, soft_wrap=True)
    said = [f"in both: {preview.note}"] * bool(preview.images) + [f"no preview: {preview.missing}"] * bool(
        preview.missing)
    for line in said:
        console.print(line, highlight=False, soft_wrap=True)
    if options.open:
        import webbrowser

        webbrowser.open(page.resolve().as_uri())
    for text in problems:
        print(f"error: {text}", file=sys.stderr)
    return 2 if problems else 0


def _shown(planner: "Planner", index: int) -> "tuple[ShownArrangement, ExamplePlan | None, list[str]]":
    """What is shown of an example; where it cannot be planned, what stands there, and why not. Raises PlanError where
    nothing stands anywhere, either."""
    from dataset_builder.planning.plan import plan_example
    from dataset_builder.planning.precheck import meshes_named
    from dataset_builder.report.looking.shown_arrangement import shown_example, shown_room

    root = planner.loaded.path.parent
    with meshes_named(planner):
        try:
            plan = plan_example(planner.loaded, index, planner)
        except PlanError as error:
            if not 0 <= index < len(planner.examples):
                raise
            try:
                arrangement = planner.arrangement(planner.examples[index].view.pair)
            except PlanError:
                raise error from None
            return shown_room(arrangement, root), None, [str(problem) for problem in error.problems]
        return shown_example(plan, root), plan, []
