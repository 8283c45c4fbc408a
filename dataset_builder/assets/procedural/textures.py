"""Seamless textures drawn from a generator: final colours, for a material whose factors are 1."""

import numpy as np
from scipy.spatial import cKDTree

from dataset_builder.assets.asset import Texture

SIZE = 128


def grid(size: int) -> tuple[np.ndarray, np.ndarray]:
    """u and v in (0, 1) at the texel centres of a (size, size) image whose row 0 is at v = 1."""
    centres = (np.arange(size) + 0.5) / size
    return np.meshgrid(centres, centres[::-1])


def smooth_noise(rng: np.random.Generator, size: int, *, u_scale: float, v_scale: float) -> np.ndarray:
    """(size, size) noise of mean 0 and deviation 1, blurred by Gaussians of `u_scale` and `v_scale` tiles.

    White noise filtered in the Fourier domain, hence periodic by construction.
    """
    frequencies = np.fft.fftfreq(size) * size
    low_pass = [np.exp(-2 * (np.pi * scale * frequencies) ** 2) for scale in (v_scale, u_scale)]
    spectrum = np.fft.fft2(rng.standard_normal((size, size))) * np.outer(*low_pass)
    spectrum[0, 0] = 0
    field = np.fft.ifft2(spectrum).real
    return field / max(float(field.std()), 1e-12)


def cells(rng: np.random.Generator, size: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Distance to the nearest and to the second of `count` random points on the torus, each (size, size), in tiles."""
    tree = cKDTree(rng.uniform(size=(count, 2)), boxsize=1.0)
    u, v = grid(size)
    distance, _ = tree.query(np.stack([u, v], axis=-1).reshape(-1, 2), k=2)
    return distance[:, 0].reshape(size, size), distance[:, 1].reshape(size, size)


def normals_of(height: np.ndarray, *, relief: float) -> np.ndarray:
    """(H, W, 3) float32 unit normals of a periodic height map (H, W); `relief` is the height of 1 in tiles."""
    size = len(height)
    du = (np.roll(height, -1, axis=1) - np.roll(height, 1, axis=1)) * size / 2
    dv = (np.roll(height, 1, axis=0) - np.roll(height, -1, axis=0)) * size / 2
    normal = np.stack([-relief * du, -relief * dv, np.ones_like(height)], axis=-1)
    return (normal / np.linalg.norm(normal, axis=-1, keepdims=True)).astype(np.float32)


def mix(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """(H, W, 3) blend of two colours (3,) by `share` (H, W), clipped to [0, 1]."""
    weight = np.clip(share, 0, 1)[..., None]
    return first * (1 - weight) + second * weight


def plausible(colour: np.ndarray) -> np.ndarray:
    """Reflectances within what paints, cloths and woods have (0.03 to 0.85), float32."""
    return np.clip(colour, 0.03, 0.85).astype(np.float32)


def wood(rng: np.random.Generator, light: np.ndarray, dark: np.ndarray, *, rings: int = 9, gloss: float = 0.45,
         size: int = SIZE) -> Texture:
    """Plain-sawn wood, grain along v: `rings` growth rings across a tile, between colours `light` and `dark` (3,)."""
    u, _ = grid(size)
    sway = 0.55 * smooth_noise(rng, size, u_scale=0.16, v_scale=0.30)
    phase = np.mod(u * rings + sway, 1.0)
    ring = phase**2.2 * np.clip((1 - phase) / 0.12, 0, 1)
    fibres = smooth_noise(rng, size, u_scale=0.003, v_scale=0.05)
    broad = smooth_noise(rng, size, u_scale=0.12, v_scale=0.4)
    share = 0.30 + 0.55 * ring + 0.10 * fibres + 0.10 * broad
    rough = np.clip(gloss + 0.06 * fibres + 0.05 * ring, 0.05, 1).astype(np.float32)
    return Texture(base_color=plausible(mix(light, dark, share)), roughness=rough)


def weave(rng: np.random.Generator, warp: np.ndarray, weft: np.ndarray, *, threads: int = 32,
          size: int = SIZE) -> Texture:
    """Plain weave of `threads` (even) warp and weft threads per tile, in two colours (3,), some thicker than others."""
    u, v = grid(size)
    across, along = np.abs(np.sin(np.pi * threads * u)), np.abs(np.sin(np.pi * threads * v))
    over = (np.floor(threads * u) + np.floor(threads * v)) % 2 == 0
    height = np.where(over, across * (0.6 + 0.4 * along), along * (0.6 + 0.4 * across))
    slub = smooth_noise(rng, size, u_scale=0.006, v_scale=0.08) + smooth_noise(rng, size, u_scale=0.08, v_scale=0.006)
    colour = np.where(over[..., None], warp, weft) * (0.72 + 0.28 * height + 0.045 * slub)[..., None]
    return Texture(base_color=plausible(colour), normal=normals_of(height, relief=0.25 / threads))


def nap(rng: np.random.Generator, colour: np.ndarray, *, size: int = SIZE) -> Texture:
    """Velvet: one colour (3,), brushed this way and that."""
    broad = smooth_noise(rng, size, u_scale=0.06, v_scale=0.10)
    fine = smooth_noise(rng, size, u_scale=0.004, v_scale=0.008)
    return Texture(base_color=plausible(colour * (1 + 0.08 * broad + 0.07 * fine)[..., None]))


def leather(rng: np.random.Generator, colour: np.ndarray, *, size: int = SIZE) -> Texture:
    """Grained leather: small cells with dark, duller creases between."""
    first, second = cells(rng, size, 420)
    crease = np.clip((second - first) / 0.018, 0, 1)
    worn = smooth_noise(rng, size, u_scale=0.12, v_scale=0.12)
    base = colour * (0.80 + 0.20 * crease + 0.05 * worn)[..., None]
    rough = np.clip(0.62 - 0.20 * crease + 0.03 * worn, 0.2, 1).astype(np.float32)
    return Texture(base_color=plausible(base), roughness=rough, normal=normals_of(crease, relief=0.0016))


def plaster(rng: np.random.Generator, colour: np.ndarray, *, size: int = SIZE) -> Texture:
    """Trowelled plaster: nearly one colour (3,), a little uneven."""
    scales = ((0.09, 1.0), (0.03, 0.6), (0.01, 0.4))
    layers = [weight * smooth_noise(rng, size, u_scale=scale, v_scale=scale) for scale, weight in scales]
    height = np.sum(layers, axis=0)
    return Texture(base_color=plausible(colour * (1 + 0.012 * height)[..., None]),
                   normal=normals_of(height, relief=0.0004))


def brushed(rng: np.random.Generator, colour: np.ndarray, *, gloss: float = 0.3, size: int = SIZE) -> Texture:
    """Brushed metal: fine scratches along v in roughness and, faintly, in colour."""
    scratch = smooth_noise(rng, size, u_scale=0.003, v_scale=0.12)
    rough = np.clip(gloss + 0.07 * scratch, 0.08, 1).astype(np.float32)
    return Texture(base_color=plausible(colour * (1 + 0.03 * scratch)[..., None]), roughness=rough,
                   metallic=np.ones_like(rough))


def stone(rng: np.random.Generator, ground: np.ndarray, vein: np.ndarray, *, size: int = SIZE) -> Texture:
    """Polished stone with veins: thin level lines of a warped noise."""
    field = smooth_noise(rng, size, u_scale=0.11, v_scale=0.16) + 0.35 * smooth_noise(rng, size, u_scale=0.03,
                                                                                      v_scale=0.03)
    line = np.exp(-((field / 0.13) ** 2))
    cloud = smooth_noise(rng, size, u_scale=0.08, v_scale=0.08)
    return Texture(base_color=plausible(mix(ground * (1 + 0.03 * cloud)[..., None], vein, 0.75 * line)))


def tiles(rng: np.random.Generator, colour: np.ndarray, *, per_side: int = 3, size: int = 2 * SIZE) -> Texture:
    """Square ceramic tiles, `per_side` along each side of the texture, glossy, with dull grey joints."""
    u, v = grid(size)
    column, row = np.floor(u * per_side).astype(int), np.floor(v * per_side).astype(int)
    to_edge = np.minimum.reduce([np.mod(c * per_side, 1.0) for c in (u, 1 - u, v, 1 - v)])
    body = np.clip((to_edge - 0.010) / 0.014, 0, 1)
    tone = 1 + 0.05 * rng.standard_normal((per_side, per_side))[row, column]
    mottled = 1 + 0.03 * smooth_noise(rng, size, u_scale=0.02, v_scale=0.02)
    base = mix(np.full(3, 0.30), colour * (tone * mottled)[..., None], body)
    rough = (0.75 - 0.57 * body).astype(np.float32)
    return Texture(base_color=plausible(base), roughness=rough, normal=normals_of(body, relief=0.004 / per_side))


def planks(rng: np.random.Generator, light: np.ndarray, dark: np.ndarray, *, boards: int = 8,
           size: int = 2 * SIZE) -> Texture:
    """Floor of `boards` boards side by side along v, two lengths each, every board sawn from another place."""
    u, v = grid(size)
    column = np.floor(u * boards).astype(int)
    start = rng.uniform(size=boards)[column]
    piece = np.floor(np.mod(v + start, 1.0) * 2).astype(int)
    along = np.mod((v + start) * 2, 1.0)
    across = np.mod(u * boards, 1.0)
    shift = rng.integers(0, size, size=(boards, 2, 2))[column, piece]
    source = wood(rng, light, dark, rings=28, size=size).base_color
    rows, columns = np.indices((size, size))
    sawn = source[(rows + shift[..., 0]) % size, (columns + shift[..., 1]) % size]
    tone = 1 + 0.11 * rng.standard_normal((boards, 2))[column, piece]
    to_edge = np.minimum(np.minimum(across, 1 - across) / boards, np.minimum(along, 1 - along) / 2)
    body = np.clip(to_edge * size / 1.5, 0, 1)
    base = sawn * (np.clip(tone, 0.7, 1.3) * (0.45 + 0.55 * body))[..., None]
    rough = (0.62 - 0.20 * body).astype(np.float32)
    return Texture(base_color=plausible(base), roughness=rough, normal=normals_of(body, relief=0.0012))


def book_cloth(rng: np.random.Generator, *, per_side: int = 8, size: int = SIZE) -> Texture:
    """Patches of different cloth, `per_side` squared; the one at (0, 0) has
    the colour of paper. A book takes one, so that many books share a material."""
    bindings = np.array([(0.30, 0.06, 0.045), (0.035, 0.06, 0.15), (0.05, 0.12, 0.07), (0.55, 0.47, 0.34),
                         (0.20, 0.10, 0.05), (0.05, 0.05, 0.055), (0.45, 0.28, 0.07), (0.66, 0.63, 0.56),
                         (0.08, 0.20, 0.24), (0.36, 0.17, 0.12)])
    colour = bindings[rng.integers(len(bindings), size=(per_side, per_side))]
    colour = colour * rng.uniform(0.75, 1.2, size=(per_side, per_side, 1))
    colour[0, 0] = (0.70, 0.66, 0.56)
    u, v = grid(size)
    grainy = 1 + 0.05 * smooth_noise(rng, size, u_scale=0.004, v_scale=0.004)
    patch = colour[np.floor(v * per_side).astype(int), np.floor(u * per_side).astype(int)]
    return Texture(base_color=plausible(patch * grainy[..., None]))
