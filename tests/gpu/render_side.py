"""One side of a comparison, in a process of its own, since a process renders with one variant.

    python -m tests.gpu.render_side BACKEND REQUESTS.json OUT.npz

A request has plans (a spec, overrides, indices), a word that their seeds are changed by, and which layers. The file
holds every layer by request and example, and figures: bytes in use after each example, and broken identities.
"""

import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.plan import Planner
from dataset_builder.rendering import plugins
from dataset_builder.rendering.backend import activate, active
from dataset_builder.rendering.device import bytes_in_use
from dataset_builder.rendering.examples import Rendered, render_view
from dataset_builder.seeding import derive_seed
from dataset_builder.shards.identities import check_layers, identity_table
from dataset_builder.spec.load import load_dataset

FAULT = "TEST_GPU_FAULT"
"""A layer and a factor that the second side multiplies it by, such as `i_t 1.05`: to see that tests can fail."""


def planned(request: dict[str, Any], replica: int) -> tuple[list[ExamplePlan], Path]:
    """The plans of a request, with its seeds and layers."""
    loaded = load_dataset(Path(request["spec"]), request["overrides"])
    planner, found = Planner(loaded), []
    for index in request["examples"]:
        plan = planner.example(planner.examples[index])
        seed, word = plan.render.seed, request["word"]
        seed = str(derive_seed(int(seed), word, replica)) if word else seed
        layers = tuple(pair for pair in plan.render.layers if not request["layers"] or pair[0] in request["layers"])
        found.append(plan.model_copy(update={"render": plan.render.model_copy(update={"seed": seed,
                                                                                      "layers": layers})}))
    return found, loaded.path.parent


def faulty(rendered: Rendered) -> dict[str, np.ndarray]:
    """The layers, one of them wrong where that is asked for."""
    layers = dict(rendered.layers)
    if fault := os.environ.get(FAULT):
        name, factor = fault.split()
        layers |= {name: layers[name] * float(factor)} if name in layers else {}
    return layers


def rendered(asked: dict[str, Any], found: dict[str, np.ndarray], name: str) -> dict[str, Any]:
    """Render the examples of one request; layers go to `found`."""
    figures: dict[str, Any] = {"used": [], "broken": [], "titles": {}}
    tolerances = {rule: tolerance for rule, _, tolerance in identity_table("float32", True)}
    for replica in range(asked["repeat"]):
        plans, root = planned(asked, replica)
        for plan in plans:
            example = next(render_view([plan], root))
            layers = faulty(example)
            found |= {f"{name}/{plan.key}/{layer}/{replica}": image for layer, image in layers.items()}
            figures["titles"][plan.key] = f"{plan.target.object.name} in {plan.room.name}"
            masks = {layer: image for layer, image in example.evidence.items() if layer.startswith("mask")}
            figures["broken"] += [f"{plan.key}: {item.identity}: {item.reason}" for item in
                                  check_layers({**masks, **layers}, dict(plan.render.layers), tolerances)]
            figures["used"].append(bytes_in_use())
    return figures


def main(backend: str, requests: Path, out: Path) -> None:
    """Render, and write what was found."""
    activate(backend)
    plugins.register()
    found: dict[str, np.ndarray] = {}
    figures = {name: rendered(asked, found, name)
               for name, asked in json.loads(requests.read_text(encoding="utf-8")).items()}
    np.savez(out, figures=np.array(json.dumps({"active": active(), **figures})), **found)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]))
