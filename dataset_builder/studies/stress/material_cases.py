"""Materials at the ends of their ranges, glass included: no light is gained, and hardly any is lost."""

import math
from dataclasses import replace

import numpy as np

from dataset_builder.assets.asset import Material
from dataset_builder.rendering.scene.triangle_soup import merge
from dataset_builder.studies.stress.bench import Picture, Shot, judged, render, sigmas
from dataset_builder.studies.stress.case import SIGMAS, Case, CaseMeasured, Size, hard_case
from dataset_builder.studies.stress.scenes import WIDE, ball, box, camera, floor, light, lit_by, matte, quad

SKY = lit_by(light("dome"))
ENERGY = "energy lost or gained, relative"
WHITE = (1.0, 1.0, 1.0)
MIRROR = Material(name="mirror", base_color=WHITE, roughness=0.0, metallic=1.0)
GLASS = Material(name="glass", base_color=WHITE, roughness=0.0, transmission=1.0)
SEEN = camera((0, -4, 1), fov=26)
DEEP = 64
ROUGH = math.sqrt(0.1)
ROUGH_BALL = 0.9492
"""Mean of I over the frame of `SEEN` with a sphere of Mitsuba's own `roughdielectric` (GGX, alpha 0.1, index 1.5) under
a sky of 1, `path` of depth 64 at 1024 spp: single scattering between microfacets loses the rest."""


def furnace(material: Material, size: Size, *, max_depth: int = DEEP, spp: int = 1) -> Picture:
    """A ball under a sky of radiance 1, seen so that it fills the middle of the frame."""
    return render(ball(material), SKY, Shot(camera=SEEN, max_depth=max_depth, spp=spp * size.spp), size)


def kept(picture: Picture, expected: float | np.ndarray = 1.0) -> float:
    """Relative deviation of the mean of I over the object from the mean of what is expected."""
    inside = picture.mask > 1 - 1e-6
    truth = np.broadcast_to(expected, picture.i.shape)[inside].mean()
    return abs(float(picture.i[inside].mean() / truth) - 1) if inside.any() else math.inf


def beyond(picture: Picture) -> tuple[str, ...]:
    """D + R <= 1 wherever the object is."""
    most = float((picture.d + picture.r).max())
    return () if most <= 1 + 1e-3 else (f"expected D + R <= 1, got {most:g}",)


@hard_case(name="material/albedo-0", bound=0.0, figure="largest I",
           expectation="a black object reflects nothing, while its S is that of any convex object: the sky",
           failure="NaN where 0 is divided by 0: lobes are sampled in proportion to what they reflect")
def albedo_zero(size: Size) -> CaseMeasured:
    """Both lobes are zero. A box, since flat faces see no other: on a smooth-shaded ball facets hide a little sky."""
    picture = render(box(matte(0.0), (-1, -1, -1), (1, 1, 1), 1), SKY, Shot(camera=SEEN), size)
    inside = picture.mask > 1 - 1e-6
    off = sigmas(picture.shading, np.ones_like(picture.s), where=inside)
    also = () if off <= SIGMAS else (f"S: expected 1, got it {off:.1f} standard errors off",)
    return judged(picture, picture.image[:, inside].max(), also=also)


@hard_case(name="material/albedo-1", bound=SIGMAS, figure="worst |z| of pixels and picture",
           expectation="a white ball under a white sky cannot be told from the sky: I = S = 1",
           failure="a ball that shows: a wrong density, a lost or doubled sample")
def albedo_one(size: Size) -> CaseMeasured:
    """The open white furnace."""
    picture = furnace(matte(1.0), size)
    inside = picture.mask > 1 - 1e-6
    return judged(picture, sigmas(picture.image, np.ones_like(picture.i), where=inside))


@hard_case(name="material/closed-white-furnace", bound=0.01, figure=ENERGY,
           expectation="in a closed white room with a black lamp, paths of 64 edges find its radiance everywhere",
           failure="darkness in proportion to depth: paths are cut, or roulette removes more than it restores")
def closed_white_furnace(size: Size) -> CaseMeasured:
    """Walls of albedo 1 lose nothing, so in equilibrium all that arrives anywhere is what the lamp, which absorbs all,
    sends. A path misses the lamp 63 times with a probability of 1e-4."""
    room = box(matte(1.0), (-1, -1, -1), (1, 1, 1), 1)
    lamp = lit_by(light("sphere", 1.0, position=(0.35, 0.35, 0), size=0.6))
    shot = Shot(camera=camera((-0.8, -0.9, 0.8), (-0.9, 0.9, -0.8), 20), max_depth=DEEP)
    picture = render(room, lamp, shot, size)
    return judged(picture, max(kept(picture), abs(float(picture.s.mean()) - 1)))


@hard_case(name="material/white-cup", bound=0.01, figure=ENERGY,
           expectation="down in a white cup twice as deep as wide, I = S = 1 under a sky of 1",
           failure="a dark bottom: long paths are lost")
def white_cup(size: Size) -> CaseMeasured:
    """Open at the top, seen from above; light needs many bounces down."""
    cup = merge([floor(matte(1.0), half=0.5, instance=1), *(
        quad(matte(1.0), corner, along, (0, 0, 2)) for corner, along in (
            ((-0.5, -0.5, 0), (1, 0, 0)), ((0.5, -0.5, 0), (0, 1, 0)), ((0.5, 0.5, 0), (-1, 0, 0)),
            ((-0.5, 0.5, 0), (0, -1, 0))))])
    shot = Shot(camera=camera((0.05, 0, 3), (0, 0.05, 0), 12), max_depth=DEEP, spp=2 * size.spp)
    picture = render(cup, SKY, shot, size)
    return judged(picture, max(kept(picture), abs(float(picture.s.mean()) - 1)))


def undiffuse(picture: Picture, where: np.ndarray | None = None) -> tuple[str, ...]:
    """D = 0 on pixels (H, W): nothing is scattered below the surface of metal and of clear glass."""
    most = float(np.abs(picture.d if where is None else picture.d[where]).max(initial=0.0))
    return () if most <= 1e-6 else (f"D: expected 0, got {most:g}",)


def metal(size: Size, roughness: float) -> CaseMeasured:
    """White metal in the furnace sends back all, which is R, and D = 0."""
    picture = furnace(replace(MIRROR, roughness=roughness), size, max_depth=2)
    return judged(picture, max(kept(picture), kept(picture, picture.r)), diffuse=False,
                  also=(*undiffuse(picture), *beyond(picture)))


roughness_zero = Case(
    name="material/roughness-0", bound=0.01, figure=ENERGY, measure=lambda size: metal(size, 0.0),
    expectation="white metal of roughness 0 reflects R, which is all, to within 1%",
    failure="black or blazing metal: the lobe is narrower than float32 resolves")

roughness_tiny = Case(
    name="material/roughness-1e-4", bound=0.01, figure=ENERGY, measure=lambda size: metal(size, 1e-4),
    expectation="white metal of roughness 1e-4 reflects R, which is all, to within 1%",
    failure="as for roughness 0, or a step between the two")

roughness_one = Case(
    name="material/roughness-1", bound=0.01, figure=ENERGY, measure=lambda size: metal(size, 1.0),
    expectation="white metal of roughness 1 reflects R, which is all, to within 1%",
    failure="a dark ball: light lost between facets, or R that is not what the surface does")


@hard_case(name="material/metallic-1", bound=1e-6, figure="largest D, or I not in the specular part",
           expectation="metal under a lamp has no diffuse part: D = 0, and I is all specular",
           failure="metal with a milky film")
def metallic_one(size: Size) -> CaseMeasured:
    """Half rough gold, lamp and floor about it."""
    gold = Material(name="gold", base_color=(1.0, 0.8, 0.3), roughness=0.5, metallic=1.0)
    scene = merge([ball(gold), floor(height=-1)])
    lamp = lit_by(light("area", 8, position=(1.5, -2, 2), direction=(-1.5, 2, -2), size=0.8))
    picture = render(scene, lamp, Shot(camera=SEEN), size)
    inside = (picture.mask > 1 - 1e-6) & picture.same
    off = np.abs(picture.image - picture.specular)[:, inside].max() / picture.image[:, inside].max()
    return judged(picture, max(off, float(picture.d[inside].max())), diffuse=False)


@hard_case(name="material/perfect-mirror", bound=0.01, figure="deviation from what is mirrored, relative",
           expectation="a mirror shows a sunlit wall with the wall's own radiance",
           failure="a dark or grainy mirror image: the lobe and its density disagree where both are huge")
def perfect_mirror(size: Size) -> CaseMeasured:
    """The wall faces the sun: its radiance is albedo E / pi everywhere, of which the mirror reflects R."""
    ground = floor(MIRROR, instance=1)
    wall = quad(matte(0.5), (-WIDE, 3, 0), (2 * WIDE, 0, 0), (0, 0, WIDE))
    shot = Shot(camera=camera((0, -3, 2), (0, 0, 0), 20), max_depth=3)
    picture = render(merge([ground, wall]), lit_by(light("sun", math.pi, direction=(0, 1, 0))), shot, size)
    seen = picture.mask > 1 - 1e-6
    truth = 0.5 * picture.r[seen].mean()
    return judged(picture, abs(float(picture.i[seen].mean() / truth) - 1), diffuse=False)


def layered(material: Material, size: Size) -> CaseMeasured:
    """No more comes out than goes in, and I is D S and R of the sky."""
    picture = furnace(material, size, max_depth=2)
    return judged(picture, kept(picture, picture.d + picture.r), diffuse=False, also=beyond(picture))


@hard_case(name="material/coat", bound=0.01, figure=ENERGY,
           expectation="white plastic under a clear coat reflects D + R, and no more than it receives",
           failure="varnish that glows: the coat's light is added and not subtracted from the base")
def coated(size: Size) -> CaseMeasured:
    """Full weight, smooth coat over a glossy base."""
    return layered(Material(name="coat", base_color=WHITE, roughness=0.4, coat=1.0, coat_roughness=0.1), size)


@hard_case(name="material/sheen", bound=0.01, figure=ENERGY,
           expectation="white cloth with a white sheen reflects D + R, and no more than it receives",
           failure="rims that glow: fibres add light at grazing angles")
def sheened(size: Size) -> CaseMeasured:
    """Full sheen, the roughest and the most glancing."""
    return layered(Material(name="sheen", base_color=WHITE, specular=0.0, sheen=WHITE, sheen_roughness=0.3), size)


@hard_case(name="material/everything", bound=0.05, figure=ENERGY,
           expectation="half metal, half glass, coated and with sheen: finite, and no more than it receives",
           failure="NaN or energy out of nothing where lobes meet")
def everything(size: Size) -> CaseMeasured:
    """All lobes at once, at the middle of their ranges; what comes out is at most 1 and most of it."""
    mixed = Material(name="all", base_color=WHITE, roughness=0.3, metallic=0.5, transmission=0.5, coat=0.5,
                     coat_roughness=0.2, sheen=(0.5, 0.5, 0.5), sheen_roughness=0.4)
    picture = furnace(mixed, size, spp=4)
    inside = picture.mask > 1 - 1e-6
    mean = float(picture.i[inside].mean())
    also = () if mean > 0.7 else (f"expected most of the light to come back, got {mean:g}",)
    return judged(picture, max(0.0, mean - 1), diffuse=False, also=(*also, *beyond(picture)))


@hard_case(name="material/clear-glass", bound=0.01, figure=ENERGY,
           expectation="a ball of clear white glass under a white sky cannot be told from the sky",
           failure="dark rims: light that is totally reflected inside gets lost, or radiance is not scaled by n^2")
def clear_glass(size: Size) -> CaseMeasured:
    """Reflection and refraction share all of the light."""
    picture = furnace(GLASS, size, spp=4)
    return judged(picture, kept(picture), diffuse=False, also=(*undiffuse(picture), *beyond(picture)))


@hard_case(name="material/rough-glass", bound=0.005, figure="deviation from Mitsuba's rough dielectric, relative",
           expectation="a ball of rough white glass loses what Mitsuba's own rough glass loses, and gains nothing",
           failure="glass that shines, or is as dark as stone: Jacobians of refraction")
def rough_glass(size: Size) -> CaseMeasured:
    """Alpha 0.1; the frame's mean is the same at every resolution."""
    picture = furnace(replace(GLASS, roughness=ROUGH), size, spp=4)
    return judged(picture, abs(float(picture.i.mean()) / ROUGH_BALL - 1), diffuse=False,
                  also=(*undiffuse(picture), *beyond(picture)))


@hard_case(name="material/dispersive-glass", bound=0.01, figure=ENERGY,
           expectation="glass of Abbe number 20 keeps the energy of every channel",
           failure="a colour cast: one channel's paths are weighted by another's probability")
def dispersive_glass(size: Size) -> CaseMeasured:
    """The worst of the three channels."""
    picture = furnace(replace(GLASS, abbe=20.0), size, spp=8)
    inside = picture.mask > 1 - 1e-6
    return judged(picture, float(np.abs(picture.i[inside].mean(axis=0) - 1).max()), diffuse=False,
                  also=undiffuse(picture))


@hard_case(name="material/thin-pane", bound=0.01, figure=ENERGY,
           expectation="a pane of thin glass under a white sky cannot be told from the sky",
           failure="a grey pane: what it reflects and what it transmits do not add up")
def thin_pane(size: Size) -> CaseMeasured:
    """Upright, before the camera."""
    pane = quad(replace(GLASS, thin=True), (-3, 0, -3), (6, 0, 0), (0, 0, 6), instance=1)
    picture = render(pane, SKY, Shot(camera=SEEN, max_depth=DEEP), size)
    return judged(picture, kept(picture), diffuse=False, also=(*undiffuse(picture), *beyond(picture)))


@hard_case(name="material/ior-1", bound=5e-3, figure="deviation of the mean of I, relative",
           expectation="a ball of index of refraction 1 cannot be seen",
           failure="NaN: Fresnel's terms and the direction of refraction are 0 / 0 there")
def ior_one(size: Size) -> CaseMeasured:
    """Before a wall that is half as bright as the sky: the picture with the ball against the one without."""
    wall = quad(matte(0.5), (-WIDE, 3, -WIDE), (2 * WIDE, 0, 0), (0, 0, 2 * WIDE))
    air = replace(GLASS, ior=1.0, specular=0.0)
    shot = Shot(camera=SEEN, max_depth=8, spp=4 * size.spp)
    picture, bare = (render(soup, SKY, shot, size) for soup in (merge([ball(air), wall]), wall))
    inside = picture.mask > 1 - 1e-6
    off = abs(float(picture.i[inside].mean() / bare.i[inside].mean()) - 1)
    return judged(picture, off, diffuse=False, also=undiffuse(picture, inside))
