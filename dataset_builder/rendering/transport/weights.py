"""How the techniques that find one path share it: the balance heuristic over all of them, in two numbers per edge.

A path from the camera x0 over surfaces x1 .. xk to y0 on a lamp can be found by

    N   a light sample at xk
    H   a direction sampled at xk that meets the lamp by chance
    Lj  a link: x1 .. xj from the camera, the rest from the lamp, joined by a shadow ray, j = 0, 1 or 2; L0 joins the
        light path with the camera itself, and takes no path of less than two surfaces

each weighed by its density over the sum of all (Veach, "Robust Monte Carlo methods for light transport simulation",
1997, sections 9.2 and 10.2; Davidovic, Krivanek, Hasan and Slusallek, "Progressive light transport simulation on the
GPU", ACM TOG 33(3), 2014, for links with stored vertices of light paths). Weights must add up to one for every path,
not be the best. So both sides take the density with which a light path goes on at a surface to be

    p_light(x i-1 | x i, x i+1) = p_i cos_in / cos_out,      p_i = p(x i+1 | x i-1, x i)

which holds for a surface that samples in proportion to f cos, since f is symmetric; p_i is the camera side's density
per steradian, cos_in and cos_out the cosines at x i towards x i-1 and x i+1. With it everything between the link and
the lamp cancels. In units of H over p_k, with a the density of the lamp (`Lamps.emission`),

    H = 1 / a,    N = p_N / (a p_k),    Lj = h_j = s_j d^2 cos_out / (p_j cos_in p_j+1)

where d, cos_in and cos_out belong to the link's edge and its end x j+1, p_0 is the camera's density over directions in
a pixel, s_j the expected number of links per light path and camera path (for L0 light paths per sample of a pixel). A
vertex that scatters by a delta lobe can be neither end of a link, and N is 0 where xk does.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi


def edge(s: mi.Float, distance_squared: mi.Float, pdf: mi.Float, cos_in: mi.Float) -> mi.Float:
    """r_j = s_j d^2 / (p_j cos_in): what is known of h_j when a path arrives at x j+1; 0 after a delta lobe."""
    return dr.select(pdf * cos_in > 0, s * distance_squared / (pdf * cos_in), 0)


def link(r: mi.Float, cos_out: mi.Float, pdf: mi.Float) -> mi.Float:
    """h_j = r_j cos_out / p_j+1, where x j+1 scatters with density `pdf`, 0 for a delta lobe."""
    return dr.select(pdf > 0, r * cos_out / pdf, 0)


def light_sample(pdf: mi.Float, scattered: mi.Float, a: mi.Float, before: mi.Float, here: mi.Float,
                 lone: mi.Bool) -> mi.Float:
    """Weight of N. pdf: p_N. scattered: p_k towards the lamp. before: sum of h_j of all links that end before xk. here:
    r cos_out of the one that ends there. lone: whether the lamp has no size, so that H cannot meet it."""
    met = dr.select(lone, 0, scattered)
    return dr.select(pdf > 0, pdf / (pdf + met + a * (before * scattered + here)), 0)


def met_by_chance(pdf: mi.Float, light_pdf: mi.Float, a: mi.Float, links: mi.Float, delta: mi.Bool) -> mi.Float:
    """Weight of H. pdf: p_k. light_pdf: p_N there. links: sum of h_j. delta: whether a delta lobe led to the lamp."""
    sampled = dr.select(delta | (pdf == 0), 0, light_pdf / pdf)
    return dr.rcp(1 + sampled + a * links)


def linked(own: mi.Float, camera: mi.Float, others: mi.Float) -> mi.Float:
    """Weight of L. own: its h. camera: (H + N) of the path, see `LightVertex`. others: sum of h of the other links."""
    return dr.select(own > 0, own / (own + camera + others), 0)
