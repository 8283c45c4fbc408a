from dataclasses import replace

import torch

from dataset_builder.lightnet.methods.baselines.trivial import TRIVIAL
from tests.lightnet.random_batch import filled, random_batch


def test_each_is_its_formula_by_hand() -> None:
    batch = random_batch()
    whole = batch.inputs.inside.expand(-1, 3, -1, -1)
    batch = replace(batch, inputs=replace(filled(batch.inputs, 0.5), s_prime=4 * whole),
                    truth=replace(batch.truth, d=0.25 * whole, r=0.125 * whole))
    found = {name: trivial(batch) for name, trivial in TRIVIAL.items()}
    assert list(found) == ["copy_i_s", "d_s_prime", "dr_s_prime"]
    for name, value in (("copy_i_s", 0.5), ("d_s_prime", 1.0), ("dr_s_prime", 1.5)):
        assert torch.equal(found[name], value * whole)


def test_nothing_stands_outside_the_object() -> None:
    batch = random_batch()
    stray = replace(batch, inputs=replace(batch.inputs, i_s=batch.inputs.i_s + 1, s_prime=batch.inputs.s_prime + 1),
                    truth=replace(batch.truth, d=batch.truth.d + 1))
    for trivial in TRIVIAL.values():
        assert bool((trivial(stray) * (1 - batch.inputs.inside) == 0).all())


def test_with_the_true_shading_the_true_materials_give_the_true_picture() -> None:
    batch = random_batch()
    exact = replace(batch, inputs=replace(
        batch.inputs, s_prime=torch.nan_to_num(batch.truth.i_t / (batch.truth.d + batch.truth.r))))
    torch.testing.assert_close(TRIVIAL["dr_s_prime"](exact), batch.truth.i_t)
