"""Whether a model can be a target: its file is read, its unit found, and no other target has the same mesh."""

from collections.abc import Sequence
from statistics import median

from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.digest import sha256_file
from dataset_builder.errors import UserError
from dataset_builder.importing.front3d_split import LEAST, TargetChoice
from dataset_builder.spec.usual_sizes import length, size_advice

UNITS = {1.0: "metres", 0.01: "centimetres"}
"""Scales that models of 3D-FUTURE need, and the units that they are in."""
ALIKE = 1.5
"""How many times a size may differ from the declared one, which is rounded and of some other release."""


class TargetCheck:
    """Called with one target after the other; remembers scales and meshes."""

    def __init__(self) -> None:
        self.scales: dict[str, tuple[float, str]] = {}
        """Of each model that held: metres per unit of its file, and what told it."""
        self.meshes: dict[str, str] = {}
        """First model of each mesh, by digest."""

    def __call__(self, choice: TargetChoice) -> str:
        """Why it cannot be a target; "" where it can."""
        path = choice.file
        try:
            asset = load_mesh_file(path, name=choice.jid, category=choice.category, licence="", up="y", max_texture=16)
            digest = sha256_file(path)
        except UserError as error:
            return "; ".join(problem.rule for problem in error.problems)
        except (OSError, ValueError) as error:
            return f"cannot be read: {error}"
        if (first := self.meshes.get(digest)) is not None:
            return f"the same mesh as {first}"
        scale, told = unit_of(asset.mesh.size, choice.size)
        size = [extent * scale for extent in asset.mesh.size]
        advice = size_advice((size[0], size[1], size[2]), category=choice.category, suffix=path.suffix, scale=scale,
                             up="y")
        if advice and advice.scale is not None:
            return advice.rule
        if max(size) < LEAST:
            return f"expected a target of at least {length(LEAST)}, got {length(max(size))}"
        self.meshes[digest] = choice.jid
        self.scales[choice.jid] = scale, told
        return ""


def unit_of(extents: Sequence[float], declared: Sequence[float]) -> tuple[float, str]:
    """Metres per unit of a file whose mesh has these extents, and what told it. The sides are compared by length, since
    their order varies.

    >>> unit_of((60, 55, 90), (0.6, 0.9, 0.55))
    (0.01, 'its extents are 100 times the declared size')
    """
    if not declared:
        scale = 0.01 if max(extents) > 10 else 1.0
        return scale, f"no size is declared; of extents of {max(extents):.3g} units {UNITS[scale]} are likely"
    factor = median(sorted(extents)[side] / max(sorted(declared)[side], 1e-6) for side in range(3))
    for scale in UNITS:
        if 1 / ALIKE <= factor * scale <= ALIKE:
            return scale, "its extents are " + ("the declared size" if scale == 1
                                                else f"{1 / scale:g} times the declared size")
    return 1.0, f"its extents are {factor:.3g} times the declared size, which fits no unit"
