

from dataclasses import fields, replace

import pytest
import torch

from dataset_builder.lightnet.data.batch import Inputs, Prediction
from dataset_builder.lightnet.methods.baselines.dpr import Dpr
from dataset_builder.lightnet.methods.checkpoint import build_method
from dataset_builder.lightnet.methods.method import TRIVIAL, Method, padded, predict
from dataset_builder.lightnet.settings import ModelSpec, TrainingSpec
from tests.lightnet.random_batch import filled, random_batch

SPEC = TrainingSpec(model=ModelSpec(width=4, downs=3))


def lightnet() -> Method:
    """A small network whose heads say something."""
    torch.manual_seed(0)
    method = build_method(SPEC)
    for parameter in method.parameters():
        torch.nn.init.normal_(parameter, 0.1, 0.2)
    return method


def cut(inputs: Inputs, height: int, width: int) -> Inputs:
    """The upper left part."""
    return replace(inputs, **{name: getattr(inputs, name)[..., :height, :width]
                              for name in ("i_s", "s_prime", "inside")})


def test_multiples_are_given_as_they_are() -> None:
    inputs, method = random_batch().inputs, lightnet()
    assert padded(inputs, 8) is inputs
    found, direct = predict(method, inputs), method.eval()(inputs)
    assert all(torch.equal(getattr(found, field.name), getattr(direct, field.name)) for field in fields(Prediction))


@pytest.mark.parametrize(("height", "width"), [(29, 32), (32, 27), (25, 31), (1, 1)])
def test_other_sizes_are_filled_up_with_nothing_and_cut_again(height: int, width: int) -> None:
    method, inputs = lightnet(), cut(random_batch().inputs, height, width)
    wide = padded(inputs, 8)
    assert wide.i_s.shape[-2:] == (-(-height // 8) * 8, -(-width // 8) * 8) and wide.sh is inputs.sh
    for name in ("i_s", "s_prime", "inside"):
        image, given = getattr(wide, name), getattr(inputs, name)
        assert torch.equal(image[..., :height, :width], given) and image.count_nonzero() == given.count_nonzero()
    found, direct = predict(method, inputs), method(wide)
    for field in fields(Prediction):
        part = getattr(found, field.name)
        assert part.shape == (2, 3, height, width)
        torch.testing.assert_close(part, getattr(direct, field.name)[..., :height, :width])


@pytest.mark.parametrize("training", [True, False])
def test_the_mode_is_left_as_it_was_and_no_gradient_is_kept(training: bool) -> None:
    method = build_method(TrainingSpec(method="pix2pix", model=ModelSpec(width=2, downs=5))).train(training)
    moments = {name: buffer.clone() for name, buffer in method.named_buffers()}
    found = predict(method, random_batch().inputs)
    assert not found.i_t.requires_grad and all(module.training == training for module in method.modules())
    assert all(torch.equal(buffer, moments[name]) for name, buffer in method.named_buffers())


def test_the_mode_is_left_as_it_was_after_a_failure() -> None:
    method, inputs = lightnet().train(), random_batch().inputs
    with pytest.raises(RuntimeError):
        predict(method, replace(inputs, s_prime=inputs.s_prime[..., :8, :8]))
    assert method.training


def test_parts_of_a_method_s_own_are_left_whole() -> None:
    found = predict(Dpr(ModelSpec(width=2, downs=1)), cut(random_batch().inputs, 7, 5))
    assert found.i_t.shape == (2, 3, 7, 5) and found.d is None and found.source.shape == (2, 27)


def test_in_bfloat16_it_is_about_the_same_in_float32() -> None:
    method, inputs = lightnet(), random_batch().inputs
    half, whole = predict(method, inputs, "bfloat16").i_t, predict(method, inputs).i_t
    assert half.dtype == torch.float32 and not torch.equal(half, whole)
    assert (half - whole).abs().mean() < 0.05 * whole.abs().mean()


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
