"""Whether a model can be a target: its file is read, its unit found, and no other target has the same mesh."""

from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.assets.scene_readers.front3d_models import metres_per_unit
from dataset_builder.digest import sha256_file
from dataset_builder.errors import UserError
from dataset_builder.importing.front3d_split import LEAST, TargetChoice
from dataset_builder.spec.usual_sizes import length, size_advice


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
        scale, fault, said = metres_per_unit(asset.mesh.size, choice.sizes)
        told = f"{fault}: {said}" if fault else "it has its declared size" if choice.sizes else "no size is declared"
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
