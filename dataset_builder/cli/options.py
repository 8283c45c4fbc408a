"""What the options of several verbs have in common."""

import argparse

DEVICES = ("auto", "cpu", "cuda")
"""Where networks run; auto is CUDA where there is one."""


def positive(text: str) -> int:
    """A whole number from 1 on, as argparse wants it."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number >= 1, got {text}")
    return int(text)
