"""Images of a glTF file -> texels: which of a texture's images is taken, and the formats that they may have."""

import io
from dataclasses import dataclass, field

import numpy as np
from PIL import Image

from dataset_builder.assets.image_maps import ImageFile, read_texels
from dataset_builder.assets.readers.gltf_file import GltfFile
from dataset_builder.assets.readers.gltf_values import Entry
from dataset_builder.digest import sha256_bytes
from dataset_builder.extras import missing_named

BASIS = "KHR_texture_basisu"
READ_BY_PILLOW = ("EXT_texture_webp", "EXT_texture_avif")
KTX2 = b"\xabKTX 20\xbb\r\n\x1a\n"
MOST_TEXELS = 2**27
"""Of an image in KTX2, which says its size before anything is decoded."""
KEPT = 4
"""Images that are kept decoded, for materials that share them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GltfImages:
    """Texels by texture."""

    gltf: GltfFile
    max_size: int
    used: set[int] = field(default_factory=set)
    """Images that were taken so far."""
    digests: dict[int, str] = field(default_factory=dict)
    """SHA-256 of the bytes of these images."""
    _texels: dict[tuple[int, bool], np.ndarray] = field(default_factory=dict)

    def texels(self, texture: Entry, *, srgb: bool) -> np.ndarray:
        """(H, W, 4) float32 of a texture, linear, in [0, 1]. Raises UserError for what cannot be read."""
        image = self.image_of(texture)
        if (image, srgb) not in self._texels:
            entry = self.gltf.lists["images"][image]
            name = f"{self.gltf.path}: {entry.title}"
            content = self._content(entry)
            self.digests[image] = sha256_bytes(content)
            if content.startswith(KTX2):
                content = _png_of(entry, content)
            elif not _is_known(content):
                entry.refuse("expected a PNG, JPEG, WebP, AVIF or KTX2 image, got one that starts with "
                             f"{content[:8]!r}", "convert it to PNG")
            if len(self._texels) >= KEPT:
                del self._texels[next(iter(self._texels))]
            self._texels[image, srgb] = read_texels(ImageFile(name=name, content=content), srgb=srgb,
                                                    max_size=self.max_size)
            self.used.add(image)
        return self._texels[image, srgb]

    def image_of(self, texture: Entry) -> int:
        """The image of a texture: WebP or AVIF, or its PNG or JPEG, or, where nothing else is there, KTX2."""
        images = self.gltf.lists["images"]
        places = [found for name in READ_BY_PILLOW if (found := texture.extension(name)) is not None]
        places.append(texture)
        if (basis := texture.extension(BASIS)) is not None:
            places.append(basis)
        for place in places:
            if (image := place.index("source", images, "images")) is not None:
                return image
        others = ", ".join(texture.entry("extensions").value) or "no extension"
        return texture.refuse(f"expected an image, got none that is read ({others})", "convert its image to PNG")

    def _content(self, image: Entry) -> bytes:
        if image.has("uri"):
            return self.gltf.external(image)
        number = image.index("bufferView", self.gltf.lists["bufferViews"], "bufferViews")
        if number is None:
            image.refuse("expected a uri or a bufferView, got neither")
        return self.gltf.view(number).tobytes()


def _is_known(content: bytes) -> bool:
    """By its first bytes; what the file says of the type is often wrong."""
    return (content.startswith((b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"))
            or (content[:4] == b"RIFF" and content[8:12] == b"WEBP") or content[4:12] in (b"ftypavif", b"ftypavis"))


def _png_of(entry: Entry, content: bytes) -> bytes:
    """A KTX2 image, supercompressed by Basis Universal, as PNG."""
    with missing_named():
        import opengl_basisu
    try:
        found = opengl_basisu.open(content)
        if found.width * found.height > MOST_TEXELS:
            entry.refuse(f"expected at most {MOST_TEXELS:,} texels, got {found.width:,} x {found.height:,}")
        texels = found.transcode("rgba8").data
    except (ValueError, IndexError, MemoryError) as error:
        entry.refuse(f"expected a KTX2 image by Basis Universal, got: {error}", "convert it to PNG")
    stream = io.BytesIO()
    Image.fromarray(np.asarray(texels)).save(stream, "PNG", compress_level=1)
    return stream.getvalue()
