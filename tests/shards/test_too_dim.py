"""Layers that half floats cannot hold since there is next to no light in them."""

import numpy as np

from dataset_builder.shards.identities import storable


def test_half_floats_hold_what_is_bright_enough_and_no_layer_is_lost_without_a_word() -> None:
    dim = np.random.default_rng(3).uniform(0.5, 1.5, (8, 8, 3)).astype(np.float32)

    def told(dtype: str = "float16", **scales: float) -> list[str]:
        return [found.reason for found in storable({name: dim * np.float32(scale) for name, scale in scales.items()},
                                                   dtype)]

    # Steps are 6e-8 below 6.1e-5: by hand a mean of 1e-5 loses 6e-8 / 4 / 1e-5 = 0.15%
    for scale, share in ((1e-8, "100.0%"), (1e-5, "0.1%")):
        reason, = told(i_t=scale)
        assert reason.startswith("i_t: expected float16 to lose at most 0.1% of its mean") and f"got {share}" in reason
    assert "192 of 192 values become 0" in told(i_s=1e-8)[0] and "0 of 192 values" in told(i_s=1e-5)[0]
    assert told(i_t=1e-4, depth=2e-3) == told(i_t=1e-9, dtype="float32") == []
    # Nothing beside the image, and no light: left-overs of a difference, errors of what has next to none
    assert told(i_t=1.0, spec=1e-8, air=1e-9, i_t_se=1e-9) == [] and len(told(spec=1e-8)) == 1
    assert len(told(i_t=1.0, s_prime=1e-8)) == 1 and told(d=1e-9, r=1e-9, mask=1e-9) == []
