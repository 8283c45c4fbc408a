"""What repair did to a mesh file, in words for the plan and the label."""

from collections.abc import Sequence

from dataset_builder.geometry.repair import PartRepair, RepairReport

NAMED = 3
"""How many parts are told of."""
DONE = {"welded": "vertices welded", "degenerate": "degenerate faces dropped", "duplicate": "duplicate faces dropped",
        "turned": "faces turned that wound against their neighbours", "inside_out": "closed pieces turned outwards"}
"""What may be done to a mesh, by the field that counts it."""
SHORT = {"degenerate": "degenerate", "duplicate": "duplicate", "turned": "turned", "inside_out": "inside out"}
"""What is told of parts; every exporter leaves vertices to be welded."""


def repair_text(report: RepairReport, names: Sequence[str]) -> str:
    """What was done to the whole mesh, and to the parts of a file, `names`, to which most was done but welding; empty
    where nothing was."""
    whole = _counted(report, DONE)
    if len(report.parts) < 2:
        return whole
    ranked = [(name, part) for name, part in zip(names, report.parts, strict=True) if _done(part)]
    ranked.sort(key=lambda pair: -_done(pair[1]))
    told = [f"{name}: {_counted(part, SHORT)}" for name, part in ranked[:NAMED]]
    more = len(ranked) - NAMED
    return "; ".join([whole, *told, *([f"and {more} more parts"] if more > 0 else [])])


def pieces_text(report: RepairReport) -> str:
    """How many pieces there are that share no edge, and how many of these are closed.

    `3 pieces, closed: 2`.
    """
    return f"{report.pieces:,} piece{'s' * (report.pieces != 1)}, closed: {report.closed:,}"


def repair_notes(report: RepairReport) -> list[str]:
    """What a person should look at: shapes that cannot be mended."""
    if not report.one_sided:
        return []
    return [f"pieces with one side only, like a Moebius strip, left so: {report.one_sided:,} (normals jump there, and "
            "noise along them)"]


def _done(part: PartRepair) -> int:
    return sum(getattr(part, field) for field in SHORT)


def _counted(part: PartRepair, words: dict[str, str]) -> str:
    return ", ".join(f"{getattr(part, field):,} {word}" for field, word in words.items() if getattr(part, field))
