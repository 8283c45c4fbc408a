"""Small pictures of what a build has just finished: of what is staged, of what was refused, of nothing else."""

from base64 import b64decode
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

from dataset_builder.engine.unit import Outcome
from dataset_builder.planning.catalogue import ExampleRef, PairRef, ViewRef
from dataset_builder.report.example_sheet import png_of
from dataset_builder.report.small_pictures import small_picture
from dataset_builder.shards.example import Member
from dataset_builder.shards.manifest import Rejected
from dataset_builder.shards.segment import segment
from dataset_builder.shards.staging import Staging

DIGEST = "0" * 64
RED, BLUE = (200, 30, 30), (20, 40, 180)


def outcome(*, reason: str = "") -> Outcome:
    view = ViewRef(number=0, camera=0, pair=PairRef(split="train", object=0, scene=0))
    ref = ExampleRef(index=7, view=view, light=0, level=0)
    rejected = Rejected(key=ref.key, view=view.name, gate="coverage", reason=reason) if reason else None
    return Outcome(ref=ref, rejected=rejected, digest=DIGEST)


def plain(colour: tuple[int, int, int]) -> bytes:
    """A PNG twice as wide as high, larger than a small picture."""
    return png_of(np.full((400, 800, 3), colour, np.uint8))


def shown(source: str) -> Image.Image:
    assert source.startswith("data:image/jpeg;base64,")
    return Image.open(BytesIO(b64decode(source.partition(",")[2])))


def test_a_staged_example_shows_its_preview(tmp_path: Path) -> None:
    members = [Member(name="00000007.json", data=b"{}", pixel_digest=""),
               Member(name="00000007.preview.png", data=plain(RED), pixel_digest="")]
    staged = Staging(tmp_path)
    staged.put("00000007", DIGEST, segment(members), {"key": "00000007"})
    picture = shown(small_picture(outcome(), tmp_path, staged))
    assert picture.size == (320, 160)
    np.testing.assert_allclose(np.asarray(picture).mean(axis=(0, 1)), RED, atol=4)


def test_a_refused_example_shows_what_was_kept_of_it_or_nothing(tmp_path: Path) -> None:
    refused = outcome(reason="too small")
    assert small_picture(refused, tmp_path, Staging(tmp_path)) == ""
    kept = tmp_path / ".build" / "rejected" / "00000007.png"
    kept.parent.mkdir(parents=True)
    kept.write_bytes(plain(BLUE))
    picture = shown(small_picture(refused, tmp_path, Staging(tmp_path)))
    np.testing.assert_allclose(np.asarray(picture).mean(axis=(0, 1)), BLUE, atol=4)
    kept.write_bytes(b"no picture")
    assert small_picture(refused, tmp_path, Staging(tmp_path)) == ""


def test_what_was_published_meanwhile_has_no_picture(tmp_path: Path) -> None:
    assert small_picture(outcome(), tmp_path, Staging(tmp_path)) == ""
