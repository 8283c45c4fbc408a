"""Small pictures of examples as they are finished, for a page."""

from base64 import b64encode
from io import BytesIO
from pathlib import Path

from dataset_builder.engine import rejected_pixels
from dataset_builder.engine.unit import Outcome
from dataset_builder.errors import UserError
from dataset_builder.shards.example import PREVIEW
from dataset_builder.shards.folder import WORK
from dataset_builder.shards.segment_members import members_of
from dataset_builder.shards.staging import Staging

SIZE = 320, 160
"""Most pixels of a picture, across and down."""


def small_picture(outcome: Outcome, folder: Path, staged: Staging) -> str:
    """Preview of an example that waits for its shard, or that was rejected and whose pixels were kept, as a data URI;
    empty where there is none at hand: nothing is fetched from far."""
    from PIL import Image

    try:
        data = _rejected(outcome, folder) if outcome.rejected else _staged(outcome, staged)
        stream = BytesIO()
        with Image.open(BytesIO(data)) as image:
            image.thumbnail(SIZE)
            image.convert("RGB").save(stream, "JPEG", quality=85)
    except (UserError, OSError, ValueError, KeyError, RuntimeError, MemoryError):
        # Whatever it is, the build knows better what to say of it
        return ""
    return f"data:image/jpeg;base64,{b64encode(stream.getvalue()).decode()}"


def _rejected(outcome: Outcome, folder: Path) -> bytes:
    return (folder / WORK / rejected_pixels.PICTURES / f"{outcome.ref.key}.png").read_bytes()


def _staged(outcome: Outcome, staged: Staging) -> bytes:
    if not staged.here:
        return b""
    segment, preview = staged.get(outcome.ref.key, outcome.digest).segment, f"{outcome.ref.key}.{PREVIEW}"
    return next((data for name, data in members_of(segment) if name == preview), b"")
