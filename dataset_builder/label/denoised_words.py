"""What may be said of a denoised layer's bias: a figure, what it is at most, or that nobody knows."""

from dataset_builder.label.example_label import Denoised

UNKNOWN = "unknown"


def told_bias(item: Denoised) -> tuple[str, str, str]:
    """(bias of the mean, its error, pixel bias) in words. Earlier versions wrote 0 for a pixel bias that noise hid."""
    if item.known == "unknown":
        return UNKNOWN, UNKNOWN, UNKNOWN
    pixel = f"{item.pixel_bias:.2%}" if item.pixel_bias > 0 else "hidden by noise"
    return f"{item.bias:+.2%}", f"{item.bias_error:.2%}", f"at most {pixel}" if item.known == "at most" else pixel


def told_relmse(item: Denoised) -> tuple[str, str, str]:
    """relMSE before, after and of the reference, in words."""
    if item.known == "unknown":
        return UNKNOWN, UNKNOWN, UNKNOWN
    return f"{item.relmse_raw:.2e}", f"{item.relmse_denoised:.2e}", f"{item.relmse_reference:.2e}"
