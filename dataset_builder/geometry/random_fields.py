"""Gaussian random fields in space: noise that neighbours share, whatever the mesh that samples it looks like."""

from dataclasses import dataclass

import numpy as np

from dataset_builder.errors import UserError

MODES = 128
"""Plane waves per octave. The excess kurtosis of one value is -1.5 / MODES, that of a Gaussian 0."""
CHUNK = 4096
"""Points at a time, to bound memory."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GaussianField:
    """A field of mean 0 and variance 1 with C independent components, a sum of K plane waves."""

    waves: np.ndarray
    """(K, 3) wave vectors, radians per unit of length."""
    cosines: np.ndarray
    """(K, C) amplitudes of cos(k x)."""
    sines: np.ndarray
    """(K, C) amplitudes of sin(k x)."""

    def at(self, points: np.ndarray) -> np.ndarray:
        """(N, C) values at (N, 3) points; that at one point depends on no other point."""
        values = np.empty((len(points), self.cosines.shape[1]))
        for start in range(0, len(points), CHUNK):
            some = slice(start, start + CHUNK)
            # einsum, not @: a threaded product may round by the number of threads
            phases = np.einsum("ni,ki->nk", points[some], self.waves)
            values[some] = np.einsum("nk,kc->nc", np.cos(phases), self.cosines)
            values[some] += np.einsum("nk,kc->nc", np.sin(phases), self.sines)
        return values


def gaussian_field(rng: np.random.Generator, *, length: float, octaves: int = 1, gain: float = 0.5,
                   components: int = 1, axis: np.ndarray | None = None, stretch: float = 1.0) -> GaussianField:
    """A homogeneous field by the spectral method: plane waves of random phase, their wave vectors drawn from the
    spectrum (M. Shinozuka, C.-M. Jan, "Digital Simulation of Random Processes and its Applications", Journal of Sound
    and Vibration 25, 1972).

    length: correlation length of the first octave, in units of the points. One octave has the covariance
    exp(-r^2 / (2 length^2)) at distance r, so exp(-1/2) at r = length. Octave j has length / 2^j and gain^j times the
    amplitude of the first; all together have variance 1. axis: (3,) unit vector; across it, the field is `stretch`
    times as long, so that with a large stretch it is constant on sheets across `axis`. Raises UserError where length,
    gain or stretch is not positive, or octaves < 1.
    """
    for name, value in (("length", length), ("gain", gain), ("stretch", stretch), ("octaves", octaves)):
        if not 0 < value < np.inf:
            raise UserError(f"field: {name}: expected a finite number > 0, got {value:g}")
    amplitudes = float(gain) ** np.arange(octaves)
    amplitudes /= np.sqrt(np.sum(amplitudes**2))
    waves = rng.standard_normal((octaves, MODES, 3)) * (2.0 ** np.arange(octaves) / length)[:, None, None]
    if axis is not None:
        along = np.einsum("omi,i->om", waves, axis)[..., None] * axis
        waves = along + (waves - along) / stretch
    phases = rng.uniform(0, 2 * np.pi, (octaves, MODES, components))
    share = amplitudes[:, None, None] * np.sqrt(2 / MODES)
    return GaussianField(waves=waves.reshape(-1, 3), cosines=(share * np.cos(phases)).reshape(-1, components),
                         sines=(-share * np.sin(phases)).reshape(-1, components))
